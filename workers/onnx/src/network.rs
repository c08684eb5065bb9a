//! A model by its card, and a network at work: a session with its buffers.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ort::session::Session;
use tilefold_schemas::Picture;
use tilefold_schemas::observation::Observation;
use tilefold_workers::detector::Detector;

use crate::card::{self, Card, Kind};
use crate::error::OnnxError;
use crate::fit::{Fitter, Placement};
use crate::library::Library;
use crate::model_file::{read_model, sha256};
use crate::session::{self, Output, Wanted};
use crate::{boxes, lines, mask};

/// Classes of marking and of colour in the `lines` of a line-anchor network.
pub(crate) const MARKINGS: usize = tilefold_schemas::observation::MARKINGS.len();
pub(crate) const COLORS: usize = tilefold_schemas::observation::COLORS.len();
/// Probability, dx, up and down come before them.
pub(crate) const GEOMETRY: usize = 4;

/// What a network runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Device {
    /// The processor.
    #[default]
    Cpu,
    /// The graphics card of this number.
    Cuda(i32),
}

/// A model whose card and file belong together; sessions are opened from it.
#[derive(Debug, Clone)]
pub struct Model {
    /// What it is.
    pub card: Card,
    /// Where its file is.
    pub path: PathBuf,
    /// A hash of all that its answers depend on: the model's file, and the card but for its words.
    pub digest: i64,
    pub(crate) bytes: Arc<[u8]>,
    pub(crate) library: Library,
    pub(crate) device: Device,
}

impl Model {
    /// The model of a card, checked against it and run once.
    ///
    /// # Errors
    /// The card, the model or the library cannot be used; CUDA is asked for and is not there.
    pub fn open(
        card_path: &Path,
        library: Option<&Path>,
        device: Device,
    ) -> Result<Self, OnnxError> {
        let card = Card::read(card_path)?;
        let path = card::find_model(card_path, &card)?;
        let bytes = read_model(&path, card_path, &card.sha256)?;
        let model = Self {
            digest: digest(&card),
            card,
            path,
            bytes: bytes.into(),
            library: Library::load(library)?,
            device,
        };
        session::open(&model)?;
        Ok(model)
    }

    /// The library that it runs on.
    #[must_use]
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// A session of its own; one for each worker.
    ///
    /// # Errors
    /// ONNX Runtime refuses.
    pub fn network(&self) -> Result<Network, OnnxError> {
        let input = &self.card.input;
        Ok(Network {
            session: session::open(self)?,
            fitter: Fitter::new(input),
            tensor: vec![0.0; 3 * input.width_px as usize * input.height_px as usize],
            wanted: self.card.wanted_outputs(),
            card: self.card.clone(),
        })
    }
}

/// The words of a card do not change what its model sees.
fn digest(card: &Card) -> i64 {
    let silent = Card {
        name: String::new(),
        about: String::new(),
        model: String::new(),
        sha256: card.sha256.to_ascii_lowercase(),
        ..card.clone()
    };
    tilefold_schemas::id::hash_text(&sha256(format!("{silent:?}").as_bytes()))
}

impl Card {
    pub(crate) fn wanted_input(&self) -> Wanted {
        let input = &self.input;
        Wanted {
            name: input.name.clone(),
            shape: vec![1, 3, i64::from(input.height_px), i64::from(input.width_px)],
        }
    }

    /// The tensor of lines, then that of boxes, as far as there are any.
    pub(crate) fn wanted_outputs(&self) -> Vec<Wanted> {
        let [width, height] = [self.input.width_px, self.input.height_px].map(i64::from);
        let grid = |channels: usize, stride_px: u32| {
            let stride = i64::from(stride_px);
            vec![1, channels as i64, height / stride, width / stride]
        };
        let lines = self.lines.as_ref().map(|lines| Wanted {
            name: lines.output.clone(),
            shape: if self.kind == Kind::LaneSegmentation {
                vec![1, lines.channels as i64, height, width]
            } else {
                grid(
                    GEOMETRY + MARKINGS + COLORS + lines.appearance,
                    lines.stride_px,
                )
            },
        });
        let boxes = self.boxes.as_ref().map(|boxes| Wanted {
            name: boxes.output.clone(),
            shape: grid(boxes.classes.len() + 4 + boxes.appearance, boxes.stride_px),
        });
        lines.into_iter().chain(boxes).collect()
    }

    fn observations(&self, outputs: &[Output<'_>], placement: Placement) -> Vec<Observation> {
        let mut outputs = outputs.iter();
        let mut observations = Vec::new();
        if let (Some(lines), Some(output)) = (&self.lines, self.lines.as_ref().and(outputs.next()))
        {
            observations.extend(match self.kind {
                Kind::LaneSegmentation => mask::read(lines, output, placement),
                _ => lines::read(lines, output, placement),
            });
        }
        if let (Some(boxes), Some(output)) = (&self.boxes, outputs.next()) {
            observations.extend(boxes::read(boxes, output, placement));
        }
        observations
            .into_iter()
            .map(Observation::quantised)
            .collect()
    }
}

/// A network at work.
#[derive(Debug)]
pub struct Network {
    session: Session,
    fitter: Fitter,
    tensor: Vec<f32>,
    wanted: Vec<Wanted>,
    card: Card,
}

impl Network {
    /// The outputs for a tensor as it is, in the card's order; for comparison with other runtimes.
    ///
    /// # Errors
    /// What ONNX Runtime says.
    pub fn run_raw(&mut self, tensor: &[f32]) -> Result<Vec<Vec<f32>>, String> {
        let input = (self.shape(), tensor);
        session::run(&mut self.session, input, &self.wanted, |outputs| {
            outputs
                .iter()
                .map(|output| output.values.to_vec())
                .collect()
        })
    }

    /// The input tensor of a picture.
    ///
    /// # Errors
    /// A picture that is none.
    pub fn input_of(&mut self, picture: &Picture) -> Result<Vec<f32>, String> {
        self.fitter.fit(picture, &mut self.tensor)?;
        Ok(self.tensor.clone())
    }

    fn shape(&self) -> [i64; 4] {
        let input = &self.card.input;
        [1, 3, i64::from(input.height_px), i64::from(input.width_px)]
    }
}

impl Detector for Network {
    fn detect(
        &mut self,
        picture: &Picture,
    ) -> Result<Vec<Observation>, Box<dyn Error + Send + Sync>> {
        let placement = self.fitter.fit(picture, &mut self.tensor)?;
        let input = (self.shape(), self.tensor.as_slice());
        let card = &self.card;
        let observed = session::run(&mut self.session, input, &self.wanted, |outputs| {
            card.observations(outputs, placement)
        });
        Ok(observed?)
    }
}
