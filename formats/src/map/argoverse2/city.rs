//! The coordinates of Argoverse 2's six cities: metres east and north of an origin, on the grid of
//! the city's UTM zone. The origins are those that the data set is published with (`av2`,
//! `geometry/utm.py`).

use proj4rs::Proj;
use proj4rs::transform::transform;

use crate::map::error::MapError;

/// Name, UTM zone (all of the north), latitude and longitude of the origin in degrees.
const CITIES: [(&str, u8, [f64; 2]); 6] = [
    ("ATX", 14, [30.274_642_379_395_07, -97.740_445_740_742_4]),
    ("DTW", 17, [42.299_930_669_129_24, -83.175_557_507_837_17]),
    ("MIA", 17, [25.774_525_799_151_63, -80.196_569_144_494_05]),
    ("PAO", 10, [37.416_065, -122.135_719_633_621_66]),
    ("PIT", 17, [40.441_779_029_893_21, -80.012_943_772_425_84]),
    ("WDC", 18, [38.889_377, -77.035_504_743_908_1]),
];

/// No point of a city is further from its origin along an axis, in metres.
const MAX_CITY_M: f64 = 200_000.0;

/// The frame of a city's maps.
pub(super) struct City {
    pub(super) name: &'static str,
    utm: Proj,
    wgs84: Proj,
    /// Easting and northing in metres.
    origin_m: [f64; 2],
}

impl City {
    /// The city that a file's name says: the file itself does not.
    pub(super) fn of(file: &str) -> Result<Self, MapError> {
        let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
        let is_named = |city: &str| name.split(['_', '.']).any(|word| word == city);
        let known = CITIES.into_iter().find(|(city, ..)| is_named(city));
        known
            .and_then(|(city, zone, origin)| Self::new(city, zone, origin))
            .ok_or_else(|| MapError::City {
                file: file.to_owned(),
                cities: CITIES.map(|(city, ..)| city).join(", "),
            })
    }

    fn new(name: &'static str, zone: u8, [latitude_deg, longitude_deg]: [f64; 2]) -> Option<Self> {
        let utm = Proj::from_proj_string(&format!("+proj=utm +zone={zone} +datum=WGS84")).ok()?;
        let wgs84 = Proj::from_proj_string("+proj=longlat +datum=WGS84").ok()?;
        let mut origin = (longitude_deg.to_radians(), latitude_deg.to_radians(), 0.0);
        transform(&wgs84, &utm, &mut origin).ok()?;
        let origin_m = [origin.0, origin.1];
        Some(Self {
            name,
            utm,
            wgs84,
            origin_m,
        })
    }

    /// `[longitude_deg, latitude_deg, elevation_m]` of a point of the city.
    pub(super) fn wgs84_from(&self, [x, y, z]: [f64; 3]) -> Result<[f64; 3], String> {
        if [x, y, z].into_iter().any(|value| value.abs() > MAX_CITY_M) {
            return Err(format!(
                "its point ({x}, {y}, {z}) is over {MAX_CITY_M} m from the city's origin"
            ));
        }
        let mut point = (x + self.origin_m[0], y + self.origin_m[1], z);
        transform(&self.utm, &self.wgs84, &mut point)
            .map_err(|error| format!("its point ({x}, {y}) cannot be projected: {error}"))?;
        Ok([point.0.to_degrees(), point.1.to_degrees(), point.2])
    }
}
