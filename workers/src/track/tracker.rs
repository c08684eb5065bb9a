//! The life of tracks: born of what fits none, believed after a few hits, carried through short
//! occlusion, given up.
//!
//! Two stages: believed tracks choose first, then those on trial take what is left. One on trial
//! ends with its second miss in a row; a believed one coasts.

use tilefold_schemas::observation::{Observation, ObservationFrame};
use tilefold_tiler::recording::Stamped;

use super::assign::assign;
use super::association::{Group, Shape, State};

/// A track is believed after so many hits, of a mean score of at least [`SURE_SCORE`] after the
/// smaller number.
const HITS: usize = 3;
const HITS_IF_SURE: usize = 2;
const SURE_SCORE: f64 = 0.8;
/// Misses in a row that end a track on trial.
const MISSES_ON_TRIAL: u32 = 2;
/// How long a believed track is carried on without a hit, in nanoseconds.
const COAST_NS: i64 = 700_000_000;
/// What a track without an observation and an observation without a track cost, each: a pair that
/// costs more than both is none.
const ALONE: f64 = 0.5;

/// What counts how much when observations go on with tracks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Share of the place in the cost; the rest is that of the appearance.
    pub place: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self { place: 0.7 }
    }
}

/// One thing, followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Frames and observations in them, ascending.
    pub hits: Vec<(usize, usize)>,
    /// Whether it was seen often enough to be one.
    pub is_believed: bool,
    group: Group,
    state: State,
    appearance: Vec<f64>,
    last_ns: i64,
    misses: u32,
    score_sum: f64,
}

/// Follows what is seen through frames in the order of their time.
#[derive(Debug, Default)]
pub struct Tracker {
    weights: Weights,
    open: Vec<Track>,
    done: Vec<Track>,
    frames: usize,
    last_ns: Option<i64>,
}

impl Tracker {
    /// With other weights than the usual ones.
    #[must_use]
    pub fn weighing(weights: Weights) -> Self {
        Self {
            weights,
            ..Self::default()
        }
    }

    /// All tracks of settled frames, in the order in which they began.
    #[must_use]
    pub fn follow(mut self, frames: &[Stamped<ObservationFrame>]) -> Vec<Track> {
        for frame in frames {
            self.step(frame);
        }
        self.done.extend(self.open);
        self.done.sort_by(|a, b| a.hits.cmp(&b.hits));
        self.done
    }

    fn step(&mut self, frame: &Stamped<ObservationFrame>) {
        let number = self.frames;
        self.frames += 1;
        let since_ns = self
            .last_ns
            .replace(frame.stamp_ns)
            .unwrap_or(frame.stamp_ns);
        let seconds = (frame.stamp_ns - since_ns) as f64 * 1e-9;
        self.give_up(frame.stamp_ns);
        self.open
            .iter_mut()
            .for_each(|track| track.state.predict(seconds));
        let width_px = frame.value.size_px[0];
        let observations = &frame.value.observations;
        let shapes: Vec<Option<Shape>> = observations
            .iter()
            .map(|observation| Shape::of(observation, width_px))
            .collect();
        let mut is_free: Vec<bool> = shapes.iter().map(Option::is_some).collect();
        for group in Group::ALL {
            for is_believed in [true, false] {
                self.stage((group, is_believed), (number, frame), &shapes, &mut is_free);
            }
        }
        let born = observations.iter().zip(&shapes).enumerate();
        for (index, (observation, shape)) in born.filter(|(index, _)| is_free[*index]) {
            if let Some(shape) = shape {
                self.open.push(Track::new(
                    (number, index),
                    frame.stamp_ns,
                    observation,
                    shape,
                ));
            }
        }
    }

    /// Ends what has not been seen for too long.
    fn give_up(&mut self, now_ns: i64) {
        let is_lost = |track: &mut Track| {
            let coasted = now_ns - track.last_ns > COAST_NS;
            coasted || (!track.is_believed && track.misses >= MISSES_ON_TRIAL)
        };
        self.done.extend(self.open.extract_if(.., is_lost));
    }

    fn stage(
        &mut self,
        (group, is_believed): (Group, bool),
        (number, frame): (usize, &Stamped<ObservationFrame>),
        shapes: &[Option<Shape>],
        is_free: &mut [bool],
    ) {
        let observations = &frame.value.observations;
        let wanted: Vec<usize> = (0..observations.len())
            .filter(|index| is_free[*index] && Group::of(&observations[*index]) == group)
            .collect();
        let is_asked = |track: &&mut Track| {
            track.group == group
                && track.is_believed == is_believed
                && track.last_ns < frame.stamp_ns
        };
        let mut asked: Vec<&mut Track> = self.open.iter_mut().filter(is_asked).collect();
        let weights = self.weights;
        let cost: Vec<Vec<Option<f64>>> = asked
            .iter()
            .map(|track| {
                let of = |&index: &usize| {
                    track.cost(&observations[index], shapes[index].as_ref()?, weights)
                };
                wanted.iter().map(of).collect()
            })
            .collect();
        for (track, taken) in asked.iter_mut().zip(assign(&cost, wanted.len(), ALONE)) {
            let Some(index) = taken.map(|column| wanted[column]) else {
                track.misses += 1;
                continue;
            };
            is_free[index] = false;
            if let Some(shape) = &shapes[index] {
                track.take((number, index), frame.stamp_ns, &observations[index], shape);
            }
        }
    }
}

impl Track {
    fn new(hit: (usize, usize), stamp_ns: i64, observation: &Observation, shape: &Shape) -> Self {
        let group = Group::of(observation);
        Self {
            hits: vec![hit],
            is_believed: false,
            group,
            state: State::new(group, shape),
            appearance: observation.appearance.clone(),
            last_ns: stamp_ns,
            misses: 0,
            score_sum: observation.score,
        }
    }

    fn take(
        &mut self,
        hit: (usize, usize),
        stamp_ns: i64,
        observation: &Observation,
        shape: &Shape,
    ) {
        self.hits.push(hit);
        self.state.update(shape);
        self.last_ns = stamp_ns;
        self.misses = 0;
        self.score_sum += observation.score;
        // Light changes slowly: what was seen last counts as much as all before it.
        if self.appearance.len() == observation.appearance.len() {
            let both = self.appearance.iter_mut().zip(&observation.appearance);
            both.for_each(|(mean, value)| *mean = 0.5 * (*mean + value));
        } else {
            self.appearance.clone_from(&observation.appearance);
        }
        let hits = self.hits.len();
        let is_sure = self.score_sum / hits as f64 >= SURE_SCORE;
        self.is_believed |= hits >= HITS || (is_sure && hits >= HITS_IF_SURE);
    }

    /// How badly an observation goes on with it; none beyond the gate.
    fn cost(&self, observation: &Observation, shape: &Shape, weights: Weights) -> Option<f64> {
        let place = self.state.distance2(shape)? / self.group.gate();
        let unlike = unlikeness(&self.appearance, &observation.appearance);
        Some(unlike.map_or(place, |unlike| {
            weights.place * place + (1.0 - weights.place) * unlike
        }))
    }
}

/// 1 - cosine; none where one of them has no appearance.
fn unlikeness(a: &[f64], b: &[f64]) -> Option<f64> {
    let length = |vector: &[f64]| vector.iter().map(|value| value * value).sum::<f64>().sqrt();
    let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let lengths = length(a) * length(b);
    (lengths > 1e-9 && a.len() == b.len()).then(|| 1.0 - product / lengths)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_schemas::observation::{Place, Seen};

    fn line(x_px: f64, appearance: [f64; 2]) -> Observation {
        Observation {
            seen: Seen::LaneMarking,
            place: Place::Line(vec![[x_px, 350.0], [x_px + 40.0, 220.0]]),
            score: 0.7,
            marking: Vec::new(),
            color: Vec::new(),
            appearance: appearance.to_vec(),
        }
    }

    fn frames(of: Vec<Vec<Observation>>) -> Vec<Stamped<ObservationFrame>> {
        let frame = |(number, observations)| Stamped {
            stamp_ns: number as i64 * 100_000_000,
            frame_id: String::new(),
            digest: 0,
            value: ObservationFrame {
                size_px: [640, 360],
                observations,
            },
        };
        of.into_iter().enumerate().map(frame).collect()
    }

    const LIKE: [f64; 2] = [1.0, 0.0];

    #[test]
    fn a_line_is_followed_through_a_gap_and_one_flash_is_not_believed() {
        let seen = |frame: i32| {
            let mut all = vec![line(200.0 + f64::from(frame), LIKE)];
            if frame == 4 {
                all.push(line(450.0, LIKE));
            }
            if (8..12).contains(&frame) {
                all.clear();
            }
            all
        };
        let tracks = Tracker::default().follow(&frames((0..20).map(seen).collect()));
        let believed: Vec<&Track> = tracks.iter().filter(|track| track.is_believed).collect();
        assert_eq!((tracks.len(), believed.len()), (2, 1));
        assert_eq!(believed[0].hits.len(), 16);
    }

    #[test]
    fn appearance_tells_neighbours_apart() {
        // Two lines step by half of their distance: place alone cannot say which is which.
        let seen = |frame: i32| {
            let aside = if frame >= 10 { 7.0 } else { 0.0 };
            vec![line(200.0 + aside, LIKE), line(214.0 + aside, [0.0, 1.0])]
        };
        let frames = frames((0..20).map(seen).collect());
        let pure = |tracks: &[Track]| {
            tracks
                .iter()
                .all(|track| track.hits.iter().all(|hit| hit.1 == track.hits[0].1))
        };
        assert!(pure(&Tracker::default().follow(&frames)));
    }

    #[test]
    fn what_was_away_for_long_is_a_new_thing() {
        let seen = |frame: i32| {
            if (5..15).contains(&frame) {
                Vec::new()
            } else {
                vec![line(200.0, LIKE)]
            }
        };
        let tracks = Tracker::default().follow(&frames((0..20).map(seen).collect()));
        assert_eq!(tracks.len(), 2);
    }
}
