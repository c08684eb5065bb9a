//! Model cards: the TOML file beside an ONNX file that says what the network takes and gives.
//!
//! A key that no card has is an error, so that a misspelt threshold is not a default.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use tilefold_schemas::limits::MAX_MODEL_CARD_BYTES;
use tilefold_schemas::observation::Seen;

use crate::error::OnnxError;
use crate::model_file::read_limited;

/// What a model is, and how it is run.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// Name for people.
    pub name: String,
    /// Which of the three forms of output.
    pub kind: Kind,
    /// File name of the model.
    pub model: String,
    /// SHA-256 of the model's file, in hexadecimal digits.
    pub sha256: String,
    /// Where it is from, its licence, what it was trained on; for people.
    #[serde(default)]
    pub about: String,
    /// What it takes.
    pub input: Input,
    /// Lines, for the kinds `line_anchor` and `lane_segmentation`.
    pub lines: Option<Lines>,
    /// Boxes, for the kind `boxes`, and for `line_anchor` if it has them.
    pub boxes: Option<Boxes>,
}

/// Form of a network's output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A grid of cells that say where a line passes and where it goes on.
    LineAnchor,
    /// A mask of lane paint, as large as the input.
    LaneSegmentation,
    /// A grid of cells that say how far the edges of a box are.
    Boxes,
}

/// What a network takes.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Name of the tensor, `[1, 3, height, width]` of 32-bit floats.
    pub name: String,
    /// Pixels.
    pub width_px: u32,
    /// Pixels.
    pub height_px: u32,
    /// Order of the channels.
    #[serde(default)]
    pub color: ColorOrder,
    /// How a picture of another shape is brought to this size.
    #[serde(default)]
    pub fit: Fit,
    /// What a byte is multiplied by, before the mean is taken off.
    #[serde(default = "by_255")]
    pub scale: f64,
    /// Taken off each channel, in the order red, green, blue.
    #[serde(default)]
    pub mean: [f64; 3],
    /// What each channel is divided by then.
    #[serde(default = "ones")]
    pub std: [f64; 3],
}

/// Order of the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorOrder {
    /// Red first.
    #[default]
    Rgb,
    /// Blue first, as OpenCV reads files.
    Bgr,
}

/// How a picture of another shape is brought to the input's size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// Width and height each by its own factor.
    #[default]
    Stretch,
    /// Both by one factor; the rest is grey (114).
    Letterbox,
}

/// Where lines are in the output.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lines {
    /// Name of the tensor.
    pub output: String,
    /// Least probability of a cell or pixel.
    #[serde(default = "half")]
    pub threshold: f32,
    /// Least mean probability of a line.
    #[serde(default)]
    pub min_score: f32,
    /// Least number of rows that a line goes through: of cells, or of pixels for a mask.
    #[serde(default = "three")]
    pub min_rows: usize,
    /// Rows that a line may lack and still be one.
    #[serde(default = "one")]
    pub max_gap_rows: usize,
    /// For `line_anchor`: pixels of the input a cell, and numbers in its appearance.
    #[serde(default = "eight")]
    pub stride_px: u32,
    /// Numbers in the appearance of a cell.
    #[serde(default)]
    pub appearance: usize,
    /// For `lane_segmentation`: the channel that is paint.
    #[serde(default)]
    pub channel: usize,
    /// For `lane_segmentation`: what the output is.
    #[serde(default)]
    pub activation: Activation,
    /// For `lane_segmentation`: the channels there are.
    #[serde(default = "two")]
    pub channels: usize,
}

/// What the numbers of a mask are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// Logits of which the softmax over the channels is the probability.
    #[default]
    Softmax,
    /// Logits, each for itself.
    Sigmoid,
    /// Probabilities.
    None,
}

/// Where boxes are in the output.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Boxes {
    /// Name of the tensor.
    pub output: String,
    /// Names of its classes, in the order of the channels.
    pub classes: Vec<String>,
    /// Least probability of a box.
    #[serde(default = "half")]
    pub threshold: f32,
    /// Boxes of a class that overlap by more than this (intersection over union) are one.
    #[serde(default = "half")]
    pub max_overlap: f32,
    /// Pixels of the input a cell.
    #[serde(default = "eight")]
    pub stride_px: u32,
    /// Numbers in the appearance of a cell.
    #[serde(default)]
    pub appearance: usize,
}

impl Boxes {
    /// Its classes; checked when the card was read.
    pub(crate) fn seen(&self) -> Vec<Option<Seen>> {
        self.classes
            .iter()
            .map(|name| Seen::from_name(name))
            .collect()
    }
}

fn by_255() -> f64 {
    1.0 / 255.0
}
fn ones() -> [f64; 3] {
    [1.0; 3]
}
fn half() -> f32 {
    0.5
}
fn one() -> usize {
    1
}
fn two() -> usize {
    2
}
fn three() -> usize {
    3
}
fn eight() -> u32 {
    8
}

impl Card {
    /// Reads a card.
    ///
    /// # Errors
    /// It cannot be read, is no card, or contradicts itself.
    pub fn read(path: &Path) -> Result<Self, OnnxError> {
        let bytes = read_limited(path, "model card", MAX_MODEL_CARD_BYTES)?;
        let refuse = |reason: String| OnnxError::Card {
            path: path.to_owned(),
            reason,
        };
        let text = std::str::from_utf8(&bytes).map_err(|error| refuse(error.to_string()))?;
        let card: Self = toml::from_str(text)
            .map_err(|error| refuse(error.to_string().trim_end().to_owned()))?;
        card.check().map_err(refuse)?;
        Ok(card)
    }

    fn check(&self) -> Result<(), String> {
        let is_digest =
            self.sha256.len() == 64 && self.sha256.bytes().all(|b| b.is_ascii_hexdigit());
        if !is_digest {
            return Err(
                "`sha256` must have 64 hexadecimal digits; `sha256sum FILE` prints them".to_owned(),
            );
        }
        if Path::new(&self.model).file_name() != Some(self.model.as_ref()) {
            return Err(format!(
                "`model` must be a file's name, not a path, but is {:?}",
                self.model
            ));
        }
        self.input.check()?;
        match self.kind {
            Kind::Boxes if self.boxes.is_none() => {
                Err("the kind `boxes` needs a table [boxes]".to_owned())
            }
            Kind::Boxes if self.lines.is_some() => {
                Err("the kind `boxes` has no [lines]".to_owned())
            }
            Kind::LineAnchor | Kind::LaneSegmentation if self.lines.is_none() => {
                Err("this kind needs a table [lines]".to_owned())
            }
            Kind::LaneSegmentation if self.boxes.is_some() => {
                Err("the kind `lane_segmentation` has no [boxes]".to_owned())
            }
            _ => Ok(()),
        }?;
        self.lines
            .as_ref()
            .map_or(Ok(()), |lines| lines.check(self.kind, &self.input))?;
        self.boxes
            .as_ref()
            .map_or(Ok(()), |boxes| boxes.check(&self.input))
    }
}

/// Pixels of an input's side, at most.
const MAX_INPUT_PX: u32 = 8192;

impl Input {
    fn check(&self) -> Result<(), String> {
        for (key, side) in [("width_px", self.width_px), ("height_px", self.height_px)] {
            if !(8..=MAX_INPUT_PX).contains(&side) {
                return Err(format!(
                    "input.{key} must be 8 to {MAX_INPUT_PX}, but is {side}"
                ));
            }
        }
        let is_sound = self.std.iter().all(|std| *std > 0.0 && std.is_finite())
            && self
                .mean
                .iter()
                .chain([&self.scale])
                .all(|value| value.is_finite());
        is_sound
            .then_some(())
            .ok_or_else(|| "input.scale, mean and std must be finite, std above 0".to_owned())
    }

    fn check_stride(&self, stride_px: u32) -> Result<(), String> {
        let divides = |side: u32| stride_px > 0 && side.is_multiple_of(stride_px);
        (divides(self.width_px) && divides(self.height_px))
            .then_some(())
            .ok_or_else(|| {
                format!(
                    "stride_px = {stride_px} does not divide the input's {} x {} pixels",
                    self.width_px, self.height_px
                )
            })
    }
}

fn check_share(key: &str, value: f32) -> Result<(), String> {
    (0.0..=1.0)
        .contains(&value)
        .then_some(())
        .ok_or_else(|| format!("{key} must be 0 to 1, but is {value}"))
}

impl Lines {
    fn check(&self, kind: Kind, input: &Input) -> Result<(), String> {
        check_share("lines.threshold", self.threshold)?;
        check_share("lines.min_score", self.min_score)?;
        if self.channel >= self.channels {
            return Err(format!(
                "lines.channel = {} is none of {} channels (from 0 on)",
                self.channel, self.channels
            ));
        }
        // A mask is as large as its input.
        match kind {
            Kind::LineAnchor => input.check_stride(self.stride_px),
            _ => Ok(()),
        }
    }
}

impl Boxes {
    fn check(&self, input: &Input) -> Result<(), String> {
        check_share("boxes.threshold", self.threshold)?;
        check_share("boxes.max_overlap", self.max_overlap)?;
        let is_known = |name: &&String| {
            Seen::from_name(name).is_none_or(|seen| seen == Seen::LaneMarking) && *name != "ignore"
        };
        if let Some(name) = self.classes.iter().find(is_known) {
            return Err(format!(
                "boxes.classes has {name:?}; known are stop_line, crosswalk, vehicle, the ground signs (straight_arrow, ...) and `ignore` for what is not used"
            ));
        }
        input.check_stride(self.stride_px)
    }
}

/// Where the model of a card is: beside it, or in a folder of `TILEFOLD_MODELS`.
///
/// # Errors
/// In neither.
pub fn find_model(card_path: &Path, card: &Card) -> Result<PathBuf, OnnxError> {
    let beside = card_path.with_file_name(&card.model);
    let folders = std::env::var_os("TILEFOLD_MODELS").unwrap_or_default();
    let elsewhere = std::env::split_paths(&folders).filter(|folder| !folder.as_os_str().is_empty());
    let elsewhere = elsewhere.map(|folder| folder.join(&card.model));
    let mut places = std::iter::once(beside).chain(elsewhere);
    places
        .find(|place| place.is_file())
        .ok_or_else(|| OnnxError::NoModel {
            card: card_path.to_owned(),
            model: card.model.clone(),
        })
}
