//! What a network says of one frame, in pixels of the picture as it was taken: lines and boxes with
//! their scores and appearance, before they are tracked.
//!
//! Every number is quantised when it is made ([`Observation::quantised`]), so that what follows is
//! the same on any machine that gave the network the same answer to six bits or so.

use crate::element::{Color, ElementKind, Marking, SignClass};

/// Classes of [`Observation::marking`], in the order of its entries.
pub const MARKINGS: [Marking; 7] = [
    Marking::Solid,
    Marking::Dashed,
    Marking::SolidSolid,
    Marking::SolidDashed,
    Marking::DashedSolid,
    Marking::DashedDashed,
    Marking::Other,
];

/// Classes of [`Observation::color`], in the order of its entries.
pub const COLORS: [Color; 3] = [Color::White, Color::Yellow, Color::Other];

/// What something in a picture is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Seen {
    /// A lane marking: a line.
    LaneMarking,
    /// A stop line: a box.
    StopLine,
    /// A pedestrian crossing: a box.
    Crosswalk,
    /// An arrow, text or symbol on the road: a box.
    Sign(SignClass),
    /// Another vehicle, which hides what is behind it: a box.
    Vehicle,
}

impl Seen {
    /// The class of this name, as model cards and annotations have it.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "lane_marking" => Some(Self::LaneMarking),
            "stop_line" => Some(Self::StopLine),
            "crosswalk" => Some(Self::Crosswalk),
            "vehicle" => Some(Self::Vehicle),
            "unknown" => None,
            sign => SignClass::from_name(sign).map(Self::Sign),
        }
    }

    /// The name in files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::LaneMarking => "lane_marking",
            Self::StopLine => "stop_line",
            Self::Crosswalk => "crosswalk",
            Self::Vehicle => "vehicle",
            Self::Sign(sign) => sign.name(),
        }
    }

    /// What kind of element it is; none for vehicles.
    #[must_use]
    pub fn kind(self) -> Option<ElementKind> {
        match self {
            Self::LaneMarking => Some(ElementKind::LaneMarking),
            Self::StopLine => Some(ElementKind::StopLine),
            Self::Crosswalk => Some(ElementKind::Crosswalk),
            Self::Sign(_) => Some(ElementKind::GroundSign),
            Self::Vehicle => None,
        }
    }

    /// The class of a ground sign; unknown for all else.
    #[must_use]
    pub fn sign(self) -> SignClass {
        match self {
            Self::Sign(sign) => sign,
            _ => SignClass::Unknown,
        }
    }
}

/// Where something is in the picture.
#[derive(Debug, Clone, PartialEq)]
pub enum Place {
    /// A polyline, from the nearest point (the lowest in the picture) to the farthest.
    Line(Vec<[f64; 2]>),
    /// Left, top, right and bottom edge.
    Box([f64; 4]),
}

impl Place {
    /// Its polyline; of a box, its edges as a closed one.
    #[must_use]
    pub fn outline(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Line(points) => points.clone(),
            Self::Box([left, top, right, bottom]) => [
                [*left, *top],
                [*right, *top],
                [*right, *bottom],
                [*left, *bottom],
                [*left, *top],
            ]
            .to_vec(),
        }
    }
}

/// One thing that a network saw.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// What it is.
    pub seen: Seen,
    /// Where, in pixels of the picture as it was taken.
    pub place: Place,
    /// In `[0, 1]`.
    pub score: f64,
    /// Mean log-probability of each of [`MARKINGS`]; empty where the network does not say.
    pub marking: Vec<f64>,
    /// Mean log-probability of each of [`COLORS`]; empty where the network does not say.
    pub color: Vec<f64>,
    /// Appearance, of unit length; empty where the network gives none.
    pub appearance: Vec<f64>,
}

/// What was seen in one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ObservationFrame {
    /// Width and height of the picture.
    pub size_px: [u32; 2],
    /// What was seen, in the order of the network's output.
    pub observations: Vec<Observation>,
}

impl Observation {
    /// The same, of numbers that have a place on a grid: pixels in sixteenths, scores in 1/1024,
    /// log-probabilities and appearance in 1/256.
    #[must_use]
    pub fn quantised(mut self) -> Self {
        match &mut self.place {
            Place::Line(points) => points.iter_mut().flatten().for_each(|v| quantise(v, 16.0)),
            Place::Box(edges) => edges.iter_mut().for_each(|v| quantise(v, 16.0)),
        }
        quantise(&mut self.score, 1024.0);
        let of_class = self.marking.iter_mut().chain(&mut self.color);
        of_class
            .chain(&mut self.appearance)
            .for_each(|value| quantise(value, 256.0));
        self
    }
}

fn quantise(value: &mut f64, steps: f64) {
    // Adding zero turns -0 into 0: both would be equal, but not their bytes.
    *value = (*value * steps).round() / steps + 0.0;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_their_classes() {
        let signs = SignClass::ALL[1..].iter().map(|&sign| Seen::Sign(sign));
        let rest = [
            Seen::LaneMarking,
            Seen::StopLine,
            Seen::Crosswalk,
            Seen::Vehicle,
        ];
        for seen in rest.into_iter().chain(signs) {
            assert_eq!(Seen::from_name(seen.name()), Some(seen));
        }
        assert_eq!(Seen::from_name("unknown"), None);
    }

    #[test]
    fn quantising_twice_changes_nothing_more() {
        let once = Observation {
            seen: Seen::LaneMarking,
            place: Place::Line(vec![[1.23456, -0.001], [7.7, 9.1]]),
            score: 0.7234,
            marking: vec![-0.12345; 7],
            color: Vec::new(),
            appearance: vec![0.333; 8],
        }
        .quantised();
        assert_eq!(once.clone().quantised(), once);
        assert_eq!(once.place, Place::Line(vec![[1.25, 0.0], [7.6875, 9.125]]));
    }
}
