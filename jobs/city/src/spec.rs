//! What city is wanted.

use std::path::PathBuf;

use crate::edit::Campaign;
use crate::error::CityError;

/// 2 March 2026, 00:00 UTC: the first day of every simulated campaign, in nanoseconds.
const FIRST_DAY_NS: i64 = 1_772_409_600 * 1_000_000_000;

/// Which world is driven through.
#[derive(Debug, Clone, PartialEq)]
pub enum Site {
    /// A city drawn by seed, with about so many kilometres of road; 1 to 2,000.
    Drawn {
        /// Kilometres of road.
        km: f64,
    },
    /// A Lanelet2 map.
    Mapped {
        /// The map's file.
        map: PathBuf,
    },
}

/// What the vehicles' logs hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogProfile {
    /// Detections in metres, as made on the vehicle: fast, for whole cities.
    Detections,
    /// Compressed camera images with calibration and mounting.
    Camera,
}

/// What city is wanted. The same specification gives the same files.
///
/// The default is the city of `tilefold demo`.
#[derive(Debug, Clone, PartialEq)]
pub struct CitySpec {
    /// Everything that is drawn by lot is drawn from here.
    pub seed: u64,
    /// Where a drawn city's middle is: `[longitude_deg, latitude_deg, height_m]` on WGS 84.
    pub anchor: [f64; 3],
    /// The world.
    pub site: Site,
    /// Share of the map's elements to which something happens; 0 to 0.5. At 0 the map is right.
    pub change_share: f64,
    /// Share of these that happens while the vehicles drive, the rest before; 0 to 1.
    pub during_share: f64,
    /// Vehicles; each has an id of its own; 1 to 100,000.
    pub vehicles: u32,
    /// Drives, dealt to the vehicles in turn; at most 1,000,000.
    pub drives: u32,
    /// Length of a drive in kilometres; 0.2 to 100.
    pub drive_km: f64,
    /// Days over which the drives are spread; 1 to 3,650.
    pub days: u32,
    /// What logs hold.
    pub profile: LogProfile,
    /// How well the vehicles measure: a preset of [`crate::noise`] or a file.
    pub noise: String,
    /// Whether a table says which element every detection is of.
    pub matching_truth: bool,
}

impl Default for CitySpec {
    fn default() -> Self {
        Self {
            seed: 1,
            anchor: [10.0, 50.0, 300.0],
            site: Site::Drawn { km: 3.0 },
            change_share: 0.06,
            during_share: 0.0,
            vehicles: 32,
            drives: 48,
            drive_km: 2.5,
            days: 28,
            profile: LogProfile::Detections,
            noise: "paper_like".to_owned(),
            matching_truth: false,
        }
    }
}

impl CitySpec {
    /// Refuses what cannot be built, naming the field and its limits.
    pub(crate) fn check(&self) -> Result<(), CityError> {
        let [longitude_deg, latitude_deg, height_m] = self.anchor;
        within("anchor longitude", longitude_deg, -180.0, 180.0)?;
        within("anchor latitude", latitude_deg, -80.0, 80.0)?;
        within("anchor height", height_m, -500.0, 9_000.0)?;
        if let Site::Drawn { km } = self.site {
            within("km", km, 1.0, 2_000.0)?;
        }
        within("change share", self.change_share, 0.0, 0.5)?;
        within("during share", self.during_share, 0.0, 1.0)?;
        within("vehicles", f64::from(self.vehicles), 1.0, 1e5)?;
        within("drives", f64::from(self.drives), 0.0, 1e6)?;
        within("drive km", self.drive_km, 0.2, 100.0)?;
        within("days", f64::from(self.days), 1.0, 3_650.0)
    }

    /// When the vehicles drive and things change.
    pub(crate) fn campaign(&self) -> Campaign {
        Campaign {
            begin_ns: FIRST_DAY_NS,
            days: f64::from(self.days),
            during: self.during_share,
        }
    }
}

fn within(field: &'static str, value: f64, least: f64, most: f64) -> Result<(), CityError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(CityError::Spec {
        field,
        value,
        least,
        most,
    })
}
