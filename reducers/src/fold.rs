//! How evidence is folded: by which model, and how many vehicles a verdict takes.

use crate::sensor::SensorModel;

/// How evidence becomes a posterior.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FusionModel {
    /// The paper's equations as printed.
    Paper,
    /// Likelihood ratios of a detection model.
    #[default]
    Calibrated,
}

impl FusionModel {
    /// All models.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Calibrated];

    /// The name in records and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Calibrated => "calibrated",
        }
    }
}

/// How evidence is folded.
#[derive(Debug, Clone, PartialEq)]
pub struct Fold {
    /// How evidence becomes a posterior.
    pub model: FusionModel,
    /// A verdict takes at least this many vehicles, and so does the place at which a candidate
    /// begins.
    pub quorum: usize,
    /// How the fleet's detectors err.
    pub sensor: SensorModel,
    /// Only what was seen until then counts, nanoseconds since the Unix epoch; none: all of it.
    pub as_of_ns: Option<i64>,
}

impl Fold {
    /// What layers are made with: one vehicle alone is never believed.
    #[must_use]
    pub fn of_fleet(model: FusionModel, sensor: SensorModel) -> Self {
        Self {
            model,
            quorum: 2,
            sensor,
            as_of_ns: None,
        }
    }

    /// What one vehicle says by itself: to be compared with what many say, not to be published.
    #[must_use]
    pub fn of_one(model: FusionModel, sensor: SensorModel) -> Self {
        Self {
            model,
            quorum: 1,
            sensor,
            as_of_ns: None,
        }
    }

    /// Whether something first seen at a time counts.
    #[must_use]
    pub fn counts(&self, first_ns: i64) -> bool {
        self.as_of_ns.is_none_or(|as_of_ns| first_ns <= as_of_ns)
    }
}
