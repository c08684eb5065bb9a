//! What city is wanted.

use crate::error::CityError;

/// 2 March 2026, 00:00 UTC: the first day of every simulated campaign, in nanoseconds.
const FIRST_DAY_NS: i64 = 1_772_409_600 * 1_000_000_000;

/// What city is wanted. The same specification gives the same files.
///
/// The default is the city of `tilefold demo`: about three kilometres of road with 18 changes, and
/// 40 drives by 32 vehicles.
#[derive(Debug, Clone, PartialEq)]
pub struct CitySpec {
    /// Everything that is drawn by lot is drawn from here.
    pub seed: u64,
    /// Where the street begins: `[longitude_deg, latitude_deg, height_m]` on WGS 84.
    pub anchor: [f64; 3],
    /// Roads, one behind the other, each with its own lanes; 1 to 100.
    pub roads: u32,
    /// Mean length of a road, in metres; 200 to 10,000.
    pub road_length_m: f64,
    /// Changes of each kind: lines that the map lacks, lines that are not on the road, and lines
    /// that the map has at a wrong place.
    pub changes_per_kind: u32,
    /// Vehicles; each has an id of its own; 1 to 100,000.
    pub vehicles: u32,
    /// Drives along the whole street, dealt to the vehicles in turn; at most 100,000.
    pub drives: u32,
    /// Midnight before the first drive, in nanoseconds since the Unix epoch.
    pub first_day_ns: i64,
    /// Days over which the drives are spread; 1 to 3,650.
    pub days: u32,
}

impl Default for CitySpec {
    fn default() -> Self {
        Self {
            seed: 1,
            anchor: [10.0, 50.0, 300.0],
            roads: 4,
            road_length_m: 700.0,
            changes_per_kind: 6,
            vehicles: 32,
            drives: 40,
            first_day_ns: FIRST_DAY_NS,
            days: 28,
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
        within("roads", f64::from(self.roads), 1.0, 100.0)?;
        within("road_length_m", self.road_length_m, 200.0, 10_000.0)?;
        within("vehicles", f64::from(self.vehicles), 1.0, 1e5)?;
        within("drives", f64::from(self.drives), 0.0, 1e5)?;
        within("days", f64::from(self.days), 1.0, 3_650.0)?;
        // Header stamps end in 2038; ten years of days must fit before.
        within("first_day_ns", self.first_day_ns as f64, 0.0, 1.83e18)
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
