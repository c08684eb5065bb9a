//! Change detection: precision and recall (Eq 25 and 26), overall, by type and by detail, at the
//! threshold that was asked for and over a range of thresholds.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use tilefold_schemas::Verdict;

use super::bootstrap::Resamples;
use super::known::Known;
use super::pair::{Laid, Paired};
use super::place::{Grid, Place};
use super::score::{Counts, Found, Score};

/// Thresholds T_s of the sweep (method.md, section 11).
pub const SWEEP: [f64; 6] = [0.70, 0.75, 0.80, 0.85, 0.90, 0.95];
/// Types of change.
const TYPES: [Verdict; 3] = [Verdict::Added, Verdict::Removed, Verdict::Modified];

/// Scores over all types and by type.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TypeScores {
    /// All types together.
    #[serde(flatten)]
    pub all: Score,
    /// By type of change.
    pub by_type: BTreeMap<&'static str, Score>,
}

/// Metres of line.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Metres {
    /// That changed.
    pub truth: f64,
    /// That are claimed to have changed.
    pub claimed: f64,
    /// That changed and are claimed so. Much more is claimed than this: claims overreach.
    pub right: f64,
}

/// Scores at one threshold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweepPoint {
    /// T_s.
    pub threshold: f64,
    /// Scores.
    #[serde(flatten)]
    pub scores: TypeScores,
}

/// Change detection.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangeScores {
    /// At the threshold that was asked for.
    #[serde(flatten)]
    pub scores: TypeScores,
    /// Recall by the truth's own word for the change; empty if it has none.
    pub by_detail: BTreeMap<String, Found>,
    /// Metres of line.
    pub metres: Metres,
    /// At each threshold of [`SWEEP`].
    pub sweep: Vec<SweepPoint>,
}

/// One road network: its true changes and what is claimed there.
#[derive(Debug)]
pub(super) struct Network<'a> {
    pub(super) grid: Grid,
    pub(super) known: &'a [Known<'a>],
    /// Which changes count. Those that nobody looked at are not missed, and what little is claimed
    /// of them is not wrong.
    pub(super) in_view: Vec<bool>,
    pub(super) laid: Laid<'a>,
}

/// Counts by place.
type ByPlace = BTreeMap<Place, Counts>;

/// What was counted at one threshold.
#[derive(Debug, Default)]
struct Tally {
    all: ByPlace,
    by_type: BTreeMap<&'static str, ByPlace>,
    by_detail: BTreeMap<String, ByPlace>,
}

impl Tally {
    fn of(networks: &[Network<'_>], threshold: f64) -> Self {
        let mut tally = Self::default();
        for verdict in TYPES {
            tally.by_type.insert(verdict.name(), ByPlace::new());
        }
        for network in networks {
            tally.count(network, &network.laid.pair(threshold));
        }
        tally
    }

    fn count(&mut self, network: &Network<'_>, paired: &Paired) {
        for (index, known) in network.known.iter().enumerate() {
            if !network.in_view[index] {
                continue;
            }
            let counts = Counts {
                truth: 1,
                found: u64::from(paired.is_found(index)),
                wrong: 0,
            };
            let place = network.grid.of_change(known.change);
            self.add(place, known.change.change_type, counts);
            if let Some(detail) = &known.change.detail {
                let by_place = self.by_detail.entry(detail.clone()).or_default();
                by_place.entry(place).or_default().add(&counts, 1);
            }
        }
        for index in paired.wrong() {
            if network
                .laid
                .touches_any(index, |change| !network.in_view[change])
            {
                continue;
            }
            let claim = &network.laid.claims[index];
            let counts = Counts {
                wrong: 1,
                ..Counts::default()
            };
            self.add(network.grid.of_claim(claim), claim.verdict, counts);
        }
    }

    fn add(&mut self, place: Place, verdict: Verdict, counts: Counts) {
        let by_type = self.by_type.entry(verdict.name()).or_default();
        for by_place in [&mut self.all, by_type] {
            by_place.entry(place).or_default().add(&counts, 1);
        }
    }

    fn scores(&self, resamples: &Resamples) -> TypeScores {
        let by_type = self.by_type.iter();
        TypeScores {
            all: resamples.score(&self.all),
            by_type: by_type
                .map(|(name, by_place)| (*name, resamples.score(by_place)))
                .collect(),
        }
    }
}

/// Scores networks together.
pub(super) fn score(
    networks: &[Network<'_>],
    threshold: f64,
    resamples: &Resamples,
) -> ChangeScores {
    let tally = Tally::of(networks, threshold);
    let details = tally.by_detail.iter();
    let sweep = SWEEP.map(|threshold| SweepPoint {
        threshold,
        scores: Tally::of(networks, threshold).scores(resamples),
    });
    ChangeScores {
        scores: tally.scores(resamples),
        by_detail: details
            .map(|(detail, by_place)| (detail.clone(), resamples.found(by_place)))
            .collect(),
        metres: metres(networks, threshold),
        sweep: sweep.into(),
    }
}

fn metres(networks: &[Network<'_>], threshold: f64) -> Metres {
    let mut metres = Metres::default();
    for network in networks {
        let covers = network.laid.pair(threshold).covers;
        for (known, cover) in network.known.iter().zip(covers) {
            metres.truth += known.length_m();
            metres.right += known.length_m() * cover.share();
        }
        let claims = network.laid.claims.iter();
        metres.claimed += claims
            .filter(|claim| claim.posterior >= threshold)
            .map(|claim| claim.length_m())
            .sum::<f64>();
    }
    metres
}

/// All places where something is claimed, true, or looked at.
pub(super) fn places(networks: &[Network<'_>], looked_at: &BTreeSet<Place>) -> BTreeSet<Place> {
    let mut places = looked_at.clone();
    for network in networks {
        let changes = network.known.iter();
        places.extend(changes.map(|known| network.grid.of_change(known.change)));
        let claims = network.laid.claims.iter();
        places.extend(claims.map(|claim| network.grid.of_claim(claim)));
    }
    places
}
