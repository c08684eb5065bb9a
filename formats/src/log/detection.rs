//! Drawn lines to detections: what scenes and image annotations have in common.
//!
//! What a line is comes from metadata: `class` is the name of an [`ElementKind`], `type` that of a
//! [`Marking`] (of a [`SignClass`] for ground signs), `color` that of a [`Color`], and `score` is
//! in `[0, 1]`, 1 if absent.

use tilefold_schemas::limits::{MAX_DETECTIONS_PER_FRAME, MAX_POINTS_PER_DETECTION};
use tilefold_schemas::log::{Detection, DetectionFrame, DetectionSpace, Payload};
use tilefold_schemas::{Color, ElementKind, Marking, SignClass};

use super::decode::{Decoded, Loss};
use super::error::DecodeError;
use super::sound;

/// How points make lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// One line through all points.
    Strip,
    /// The same, closed.
    Loop,
    /// A line for every two points.
    Pairs,
}

/// What metadata says about a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Attributes {
    kind: ElementKind,
    marking: Marking,
    color: Color,
    sign: SignClass,
    score: f64,
}

impl Attributes {
    /// Reads metadata, of which the last of a key counts; `None` if its class is absent or none
    /// of ours.
    pub(crate) fn read<'a>(
        metadata: impl Iterator<Item = (&'a str, &'a str)>,
    ) -> Result<Option<Self>, DecodeError> {
        let [mut class, mut style, mut color, mut score] = [None; 4];
        for (key, value) in metadata {
            match key {
                "class" => class = Some(value),
                "type" => style = Some(value),
                "color" => color = Some(value),
                "score" => score = Some(value),
                _ => {}
            }
        }
        let Some(kind) = class.and_then(ElementKind::from_name) else {
            return Ok(None);
        };
        let is_sign = kind == ElementKind::GroundSign;
        let marking = style.filter(|_| !is_sign).and_then(Marking::from_name);
        let sign = style.filter(|_| is_sign).and_then(SignClass::from_name);
        Ok(Some(Self {
            kind,
            marking: marking.unwrap_or_default(),
            color: color.and_then(Color::from_name).unwrap_or_default(),
            sign: sign.unwrap_or_default(),
            score: score.map_or(Ok(1.0), read_score)?,
        }))
    }

    fn is_outline(&self) -> bool {
        matches!(self.kind, ElementKind::Crosswalk | ElementKind::GroundSign)
    }

    fn detection(&self, points: Vec<[f64; 3]>) -> Detection {
        Detection {
            kind: self.kind,
            marking: self.marking,
            color: self.color,
            sign: self.sign,
            score: self.score,
            points,
        }
    }
}

fn read_score(text: &str) -> Result<f64, DecodeError> {
    let score = text.trim().parse().unwrap_or(f64::NAN);
    if !(0.0..=1.0).contains(&score) {
        return Err(sound::value_error("score", score, "0 to 1"));
    }
    Ok(score)
}

/// Gathers the detections of one message into frames, one for each stamp and frame name.
#[derive(Debug)]
pub(crate) struct Frames {
    space: DetectionSpace,
    frames: Vec<Frame>,
    detections: usize,
    too_short: u64,
    not_lines: u64,
}

#[derive(Debug)]
struct Frame {
    stamp_ns: Option<i64>,
    frame_id: String,
    detections: Vec<Detection>,
}

impl Frames {
    /// No frames yet.
    pub(crate) fn new(space: DetectionSpace) -> Self {
        Self {
            space,
            frames: Vec::new(),
            detections: 0,
            too_short: 0,
            not_lines: 0,
        }
    }

    /// The frame of this stamp and name, made if need be: "looked" even if nothing is added.
    pub(crate) fn open(&mut self, stamp_ns: Option<i64>, frame_id: &str) -> usize {
        let is_it = |frame: &Frame| frame.stamp_ns == stamp_ns && frame.frame_id == frame_id;
        if let Some(at) = self.frames.iter().rposition(is_it) {
            return at;
        }
        self.frames.push(Frame {
            stamp_ns,
            frame_id: frame_id.to_owned(),
            detections: Vec::new(),
        });
        self.frames.len() - 1
    }

    /// Whether there is no frame.
    pub(crate) fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Notes something of ours that is not drawn as a line.
    pub(crate) fn lose_not_line(&mut self) {
        self.not_lines += 1;
    }

    /// Adds what `points` draw to the frame `at`.
    pub(crate) fn add(
        &mut self,
        at: usize,
        attributes: &Attributes,
        shape: Shape,
        mut points: Vec<[f64; 3]>,
    ) -> Result<(), DecodeError> {
        check_count(
            "points in a detection",
            points.len(),
            MAX_POINTS_PER_DETECTION,
        )?;
        if shape == Shape::Pairs {
            self.too_short += points.len() as u64 % 2;
            return points
                .chunks_exact(2)
                .try_for_each(|pair| self.add_line(at, attributes.detection(pair.to_vec()), 2));
        }
        let is_closed = points.len() > 1 && points.first() == points.last();
        if attributes.is_outline() && is_closed {
            points.pop();
        } else if !attributes.is_outline() && shape == Shape::Loop && !is_closed {
            points.extend(points.first().copied());
        }
        let needed = if attributes.is_outline() { 3 } else { 2 };
        self.add_line(at, attributes.detection(points), needed)
    }

    fn add_line(
        &mut self,
        at: usize,
        detection: Detection,
        needed: usize,
    ) -> Result<(), DecodeError> {
        if detection.points.len() < needed {
            self.too_short += 1;
            return Ok(());
        }
        self.detections += 1;
        check_count(
            "detections in a frame",
            self.detections,
            MAX_DETECTIONS_PER_FRAME,
        )?;
        if let Some(frame) = self.frames.get_mut(at) {
            frame.detections.push(detection);
        }
        Ok(())
    }

    /// Hands the frames on; what was lost of them.
    pub(crate) fn finish(self, decoded: &mut Vec<Decoded>) -> Option<Loss> {
        decoded.extend(self.frames.into_iter().map(|frame| Decoded {
            stamp_ns: frame.stamp_ns,
            frame_id: frame.frame_id,
            payload: Payload::Detections(DetectionFrame {
                space: self.space,
                detections: frame.detections,
            }),
        }));
        let count = self.too_short + self.not_lines;
        (count > 0).then(|| Loss {
            reason: format!(
                "{} detections have too few points for a line or an outline, {} are not drawn as lines",
                self.too_short, self.not_lines
            ),
            count,
        })
    }
}

pub(super) fn check_count(what: &'static str, got: usize, limit: usize) -> Result<(), DecodeError> {
    if got > limit {
        return Err(DecodeError::TooMany { what, got, limit });
    }
    Ok(())
}
