//! What an observation's state is, and how badly it goes on with a track.
//!
//! A line is (x, y, theta, S): a point on it, its direction and its length in the picture; a box is
//! (cx, cy, a, h). Where a line begins and ends says little, as paint comes and goes at both ends: its
//! point is the one nearest to where the track's is expected, so that only its distance across counts.

use tilefold_schemas::observation::{Observation, Place, Seen};

use super::kalman::{Behaviour, Filter};

/// Chi-square, 95 %, of the numbers that are gated: across and theta of a line, four of a box.
const GATE_LINE: f64 = 5.991;
const GATE_BOX: f64 = 9.488;
/// Pixels in all that follows are of a picture of this width.
const OF_WIDTH_PX: f64 = 640.0;

const POINT: Behaviour = Behaviour {
    measured: 5.0,
    rate: 60.0,
    change: 120.0,
};
const THETA_RAD: Behaviour = Behaviour {
    measured: 0.04,
    rate: 0.4,
    change: 0.6,
};
const LENGTH: Behaviour = Behaviour {
    measured: 40.0,
    rate: 100.0,
    change: 300.0,
};
const CENTRE: Behaviour = Behaviour {
    measured: 6.0,
    rate: 180.0,
    change: 300.0,
};
/// Of the logarithm.
const ASPECT: Behaviour = Behaviour {
    measured: 0.25,
    rate: 0.8,
    change: 1.0,
};
const HEIGHT: Behaviour = Behaviour {
    measured: 6.0,
    rate: 80.0,
    change: 150.0,
};
const LINE: [Behaviour; 4] = [POINT, POINT, THETA_RAD, LENGTH];
const BOX: [Behaviour; 4] = [CENTRE, CENTRE, ASPECT, HEIGHT];

/// Things that are tracked apart from one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Group {
    Line,
    Paint,
    Vehicle,
}

impl Group {
    pub(crate) const ALL: [Self; 3] = [Self::Line, Self::Paint, Self::Vehicle];

    pub(crate) fn of(observation: &Observation) -> Self {
        match (&observation.place, observation.seen) {
            (Place::Line(_), _) => Self::Line,
            (_, Seen::Vehicle) => Self::Vehicle,
            _ => Self::Paint,
        }
    }

    fn behaviours(self) -> &'static [Behaviour; 4] {
        match self {
            Self::Line => &LINE,
            Self::Paint | Self::Vehicle => &BOX,
        }
    }

    pub(crate) fn gate(self) -> f64 {
        match self {
            Self::Line => GATE_LINE,
            Self::Paint | Self::Vehicle => GATE_BOX,
        }
    }
}

/// The chord of a line or the edges of a box, in pixels of a picture of the reference width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Shape {
    Chord([f64; 2], [f64; 2]),
    Edges([f64; 4]),
}

impl Shape {
    /// None for what has no extent.
    pub(crate) fn of(observation: &Observation, width_px: u32) -> Option<Self> {
        let unit = OF_WIDTH_PX / f64::from(width_px.max(1));
        match &observation.place {
            Place::Line(points) => {
                let (base, end) = (points.first()?, points.last()?);
                let chord = [base, end].map(|point| point.map(|value| value * unit));
                (chord[0] != chord[1]).then_some(Self::Chord(chord[0], chord[1]))
            }
            Place::Box(edges) => {
                let edges = edges.map(|value| value * unit);
                (edges[0] < edges[2] && edges[1] < edges[3]).then_some(Self::Edges(edges))
            }
        }
    }

    /// The four numbers, of a line as seen from where its point is expected.
    fn measured(&self, expected: Option<[f64; 2]>) -> [f64; 4] {
        match *self {
            Self::Chord(base, end) => {
                let (dx, dy) = (end[0] - base[0], end[1] - base[1]);
                let length = dx.hypot(dy);
                let along = expected.map_or(0.5, |at| {
                    ((at[0] - base[0]) * dx + (at[1] - base[1]) * dy) / (length * length)
                });
                let along = along.clamp(0.0, 1.0);
                // Up in the picture is 90 degrees.
                let theta = (-dy).atan2(dx);
                [base[0] + along * dx, base[1] + along * dy, theta, length]
            }
            Self::Edges([left, top, right, bottom]) => {
                let (width, height) = (right - left, bottom - top);
                [
                    (left + right) / 2.0,
                    (top + bottom) / 2.0,
                    (width / height).ln(),
                    height,
                ]
            }
        }
    }
}

/// The state of a track.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct State {
    group: Group,
    numbers: [Filter; 4],
}

impl State {
    pub(crate) fn new(group: Group, shape: &Shape) -> Self {
        let measured = shape.measured(None);
        let behaviours = group.behaviours();
        Self {
            group,
            numbers: [0, 1, 2, 3].map(|i| Filter::new(measured[i], &behaviours[i])),
        }
    }

    pub(crate) fn predict(&mut self, seconds: f64) {
        let behaviours = self.group.behaviours();
        for (number, behaviour) in self.numbers.iter_mut().zip(behaviours) {
            number.predict(seconds, behaviour);
        }
    }

    pub(crate) fn update(&mut self, shape: &Shape) {
        let measured = self.seen(shape);
        let behaviours = self.group.behaviours();
        for (number, (value, behaviour)) in
            self.numbers.iter_mut().zip(measured.iter().zip(behaviours))
        {
            number.update(*value, behaviour);
        }
    }

    /// Squared Mahalanobis distance; none beyond the gate.
    pub(crate) fn distance2(&self, shape: &Shape) -> Option<f64> {
        let measured = self.seen(shape);
        let behaviours = self.group.behaviours();
        // The length of a line is carried along, but paint that comes into view is no other line.
        let counted = if self.group == Group::Line { 3 } else { 4 };
        let distance2: f64 = (0..counted)
            .map(|i| self.numbers[i].distance2(measured[i], &behaviours[i]))
            .sum();
        (distance2 <= self.group.gate()).then_some(distance2)
    }

    fn seen(&self, shape: &Shape) -> [f64; 4] {
        shape.measured(Some([self.numbers[0].value, self.numbers[1].value]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_seen_farther_down_is_the_same_line() {
        let state = State::new(Group::Line, &Shape::Chord([200.0, 300.0], [300.0, 200.0]));
        // The same straight line, longer.
        let longer = Shape::Chord([150.0, 350.0], [310.0, 190.0]);
        assert!(state.distance2(&longer).unwrap() < 1e-9);
        // Beside it.
        assert_eq!(
            state.distance2(&Shape::Chord([240.0, 300.0], [340.0, 200.0])),
            None
        );
        // Across it.
        assert_eq!(
            state.distance2(&Shape::Chord([200.0, 200.0], [300.0, 300.0])),
            None
        );
    }

    #[test]
    fn a_box_that_comes_nearer_is_the_same_box() {
        let mut state = State::new(Group::Paint, &Shape::Edges([300.0, 200.0, 340.0, 215.0]));
        state.predict(0.1);
        assert!(
            state
                .distance2(&Shape::Edges([297.0, 208.0, 343.0, 226.0]))
                .is_some()
        );
        assert_eq!(
            state.distance2(&Shape::Edges([400.0, 200.0, 440.0, 215.0])),
            None
        );
    }
}
