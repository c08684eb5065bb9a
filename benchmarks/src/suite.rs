//! The suites: which cities are driven through, by how many vehicles, and how their sensors err.
//!
//! Tuning seeds are for whoever chooses parameters, reporting seeds for the figures that are
//! published. Nobody looks at the latter while choosing.

use std::error::Error;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;
use tilefold_city::{CityFiles, CitySpec, Site};

/// Which seeds of a suite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Seeds {
    /// To choose parameters on.
    Tuning,
    /// To publish.
    #[default]
    Reporting,
}

impl Seeds {
    /// The seeds themselves: the same for every suite, so that suites differ in one thing only.
    pub(crate) fn all(self) -> &'static [u64] {
        match self {
            Self::Tuning => &[101, 102, 103],
            Self::Reporting => &[201, 202, 203, 204],
        }
    }
}

/// Where the roads come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Roads {
    /// Drawn by lot.
    Drawn,
    /// A real map.
    Mapped,
}

/// A suite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Suite {
    /// Name on the command line and of its raw results.
    pub(crate) name: &'static str,
    /// What it is, for the report.
    pub(crate) what: &'static str,
    /// Where the roads come from.
    pub(crate) roads: Roads,
    /// How sensors err: a preset of the simulator.
    pub(crate) noise: &'static str,
    /// Vehicles of the fleet.
    pub(crate) vehicles: u32,
    /// Drives by them...
    pub(crate) drives: u32,
    /// ... of this length each, in kilometres.
    pub(crate) drive_km: f64,
}

/// The suite that others differ from in one thing each.
const PAPER_LIKE: Suite = Suite {
    name: "paper-like",
    what: "a fleet as in the paper: about ten passes over everything, ordinary sensors",
    roads: Roads::Drawn,
    noise: "paper_like",
    vehicles: 16,
    drives: 32,
    drive_km: 3.0,
};

/// All suites, in the order of the report.
pub(crate) const SUITES: [Suite; 8] = [
    PAPER_LIKE,
    Suite {
        name: "good-gnss",
        what: "lane-level receivers",
        noise: "good_gnss",
        ..PAPER_LIKE
    },
    Suite {
        name: "worst-gnss",
        what: "receivers between high buildings",
        noise: "worst_gnss",
        ..PAPER_LIKE
    },
    Suite {
        name: "sparse-fleet",
        what: "few vehicles: ten drives by five of them",
        vehicles: 5,
        drives: 10,
        ..PAPER_LIKE
    },
    Suite {
        name: "dense-fleet",
        what: "many vehicles: eighty drives by forty of them",
        vehicles: 40,
        drives: 80,
        ..PAPER_LIKE
    },
    Suite {
        name: "bad-vehicles",
        what: "some vehicles with bad mountings and clocks",
        noise: "bad_vehicles",
        ..PAPER_LIKE
    },
    Suite {
        name: "night-and-rain",
        what: "detectors by night and in rain",
        noise: "night_rain",
        ..PAPER_LIKE
    },
    Suite {
        name: "real-map",
        what: "the roads of a real map",
        roads: Roads::Mapped,
        ..PAPER_LIKE
    },
];

/// The suites of these names; all of them if none is named.
pub(crate) fn named(names: &[String]) -> Result<Vec<&'static Suite>, Box<dyn Error>> {
    if names.is_empty() {
        return Ok(SUITES.iter().collect());
    }
    names
        .iter()
        .map(|name| {
            let found = SUITES.iter().find(|suite| suite.name == name);
            found.ok_or_else(|| {
                let all: Vec<&str> = SUITES.iter().map(|suite| suite.name).collect();
                format!("there is no suite {name:?}; there are {}", all.join(", ")).into()
            })
        })
        .collect()
}

impl Suite {
    /// Why it cannot be made, if it cannot.
    pub(crate) fn obstacle(&self) -> Option<&'static str> {
        let lacks = self.roads == Roads::Mapped && !real_map().is_file();
        lacks.then_some("there is no real map: set TILEFOLD_TEST_DATA to the folder of real data")
    }

    /// Makes the city of a seed in a folder. This is the only place that knows the simulator.
    pub(crate) fn simulate(&self, seed: u64, folder: &Path) -> Result<CityFiles, Box<dyn Error>> {
        let spec = CitySpec {
            seed,
            site: match self.roads {
                Roads::Drawn => Site::Drawn { km: 5.0 },
                Roads::Mapped => Site::Mapped { map: real_map() },
            },
            vehicles: self.vehicles,
            drives: self.drives,
            drive_km: self.drive_km,
            noise: self.noise.to_owned(),
            matching_truth: true,
            ..CitySpec::default()
        };
        Ok(tilefold_city::write(&spec, folder)?)
    }
}

/// A real Lanelet2 map, beside the checkout.
fn real_map() -> PathBuf {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA").map_or(beside, PathBuf::from);
    folder.join("maps/karlsruhe/mapping_example.osm")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn suites_have_names_of_their_own_and_seeds_do_not_meet() {
        let names: BTreeSet<&str> = SUITES.iter().map(|suite| suite.name).collect();
        assert_eq!(names.len(), SUITES.len());
        let tuning: BTreeSet<_> = Seeds::Tuning.all().iter().collect();
        assert!(
            Seeds::Reporting
                .all()
                .iter()
                .all(|seed| !tuning.contains(seed))
        );
    }

    #[test]
    fn names_are_looked_up() {
        assert_eq!(named(&[]).unwrap().len(), SUITES.len());
        let found = named(&["sparse-fleet".to_owned()]).unwrap();
        assert_eq!(found[0].drives, 10);
        let error = named(&["best".to_owned()]).unwrap_err().to_string();
        assert!(
            error.contains("\"best\"") && error.contains("real-map"),
            "{error}"
        );
    }
}
