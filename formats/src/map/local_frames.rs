//! Where on Earth a point with `local_x` and `local_y` is: Autoware's maps may leave `lat` and `lon`
//! empty and say elsewhere what the local coordinates count from.
//!
//! `map_projector_info.yaml`, beside the map or beside the folder of its tiles, says it for the whole
//! map; without that file, a node's tag `mgrs_code` names its 100 km square. Nothing is guessed.

use std::collections::BTreeMap;
use std::path::Path;

use proj4rs::Proj;
use proj4rs::transform::transform;

use super::mgrs_square::{self, Square};
use super::plain_yaml::{self, Value};

/// The name that Autoware gives to the file.
pub const PROJECTOR_FILE: &str = "map_projector_info.yaml";

/// The scale on the central meridian where the file does not say it.
const UTM_SCALE: f64 = 0.9996;

/// What is known of a map's local coordinates.
#[derive(Default)]
pub struct LocalFrames {
    /// What the file beside the map says, or why it says nothing.
    stated: Option<Result<LocalFrame, String>>,
    /// By the 100 km squares that nodes name.
    squares: BTreeMap<String, Result<LocalFrame, String>>,
}

impl std::fmt::Debug for LocalFrames {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "LocalFrames(stated: {})", self.stated.is_some())
    }
}

impl LocalFrames {
    /// What lies beside `map`. A file that is wrong is told by the first node that needs it.
    #[must_use]
    pub fn beside(map: &Path) -> Self {
        let folder = map.parent().unwrap_or(Path::new(""));
        let folders = [Some(folder), folder.parent()];
        let found = folders.into_iter().flatten().find_map(|folder| {
            let file = folder.join(PROJECTOR_FILE);
            file.is_file().then_some(file)
        });
        Self {
            stated: found.map(|file| {
                let frame = plain_yaml::read(&file).and_then(|yaml| LocalFrame::stated(&yaml));
                frame.map_err(|why| format!("{}: {why}", file.display()))
            }),
            squares: BTreeMap::new(),
        }
    }

    /// `[longitude_deg, latitude_deg]` of a local point; `mgrs_code` is what its node says.
    ///
    /// # Errors
    /// Nothing says what the point counts from, or it is not on the Earth.
    pub fn wgs84_from(
        &mut self,
        local_m: [f64; 2],
        mgrs_code: Option<&str>,
    ) -> Result<[f64; 2], String> {
        let frame = match (&self.stated, mgrs_code) {
            (Some(stated), _) => stated,
            (None, Some(code)) => {
                let code: String = code.chars().take(MGRS_LETTERS).collect();
                let of_code = |code: &String| LocalFrame::mgrs(code);
                self.squares
                    .entry(code.clone())
                    .or_insert_with(|| of_code(&code))
            }
            (None, None) => {
                return Err(format!(
                    "nothing says what local_x and local_y count from: put Autoware's \
                     {PROJECTOR_FILE} beside the map"
                ));
            }
        };
        frame.as_ref().map_err(Clone::clone)?.wgs84_from(local_m)
    }
}

/// `54SVE` of `54SVE037737`.
const MGRS_LETTERS: usize = 5;

/// A plane in metres, and where its origin is.
struct LocalFrame {
    plane: Proj,
    wgs84: Proj,
    origin: Origin,
}

/// How local coordinates lie in the plane.
enum Origin {
    /// They count from this point of the plane.
    At([f64; 2]),
    /// The plane is none, but the Earth's centre; they are east and north of a place on it.
    Tangent(Tangent),
}

impl LocalFrame {
    fn stated(yaml: &BTreeMap<String, Value>) -> Result<Self, String> {
        let kind = yaml.get("projector_type").and_then(Value::text);
        let number = |value: Option<&Value>| value.and_then(Value::number);
        let origin = || {
            let of = |key| number(yaml.get("map_origin").and_then(|origin| origin.at(key)));
            let both = of("longitude").zip(of("latitude"));
            let both = both.filter(|(lon, lat)| lon.abs() <= 180.0 && lat.abs() <= 84.0);
            both.ok_or("map_origin needs latitude and longitude in degrees".to_owned())
        };
        match kind.unwrap_or_default() {
            "MGRS" => {
                let grid = yaml.get("mgrs_grid").and_then(Value::text);
                Self::mgrs(grid.unwrap_or_default())
            }
            "LocalCartesianUTM" => Self::utm_at(origin()?),
            "TransverseMercator" => {
                let scale = number(yaml.get("scale_factor")).unwrap_or(UTM_SCALE);
                let (longitude_deg, latitude_deg) = origin()?;
                Self::plane(&format!(
                    "+proj=tmerc +lat_0={latitude_deg} +lon_0={longitude_deg} +k={scale} \
                     +datum=WGS84"
                ))
            }
            "LocalCartesian" => Self::tangent_at(origin()?),
            "Local" | "local" => Err(
                "projector_type Local has no place on Earth; take MGRS, LocalCartesianUTM, \
                 LocalCartesian or TransverseMercator"
                    .to_owned(),
            ),
            other => Err(format!("projector_type {other:?} is not known")),
        }
    }

    fn plane(definition: &str) -> Result<Self, String> {
        let proj = |text: &str| Proj::from_proj_string(text).map_err(|error| error.to_string());
        Ok(Self {
            plane: proj(definition)?,
            wgs84: proj("+proj=longlat +datum=WGS84")?,
            origin: Origin::At([0.0; 2]),
        })
    }

    fn mgrs(code: &str) -> Result<Self, String> {
        let Square {
            zone,
            is_south,
            corner_m,
        } = mgrs_square::read(code)?;
        let south = if is_south { " +south" } else { "" };
        let mut frame = Self::plane(&format!("+proj=utm +zone={zone}{south} +datum=WGS84"))?;
        frame.origin = Origin::At(corner_m);
        Ok(frame)
    }

    /// UTM in the zone of a place, counted from that place.
    fn utm_at((longitude_deg, latitude_deg): (f64, f64)) -> Result<Self, String> {
        let zone = (((longitude_deg + 180.0) / 6.0).floor() as i32).rem_euclid(60) + 1;
        let south = if latitude_deg < 0.0 { " +south" } else { "" };
        let mut frame = Self::plane(&format!("+proj=utm +zone={zone}{south} +datum=WGS84"))?;
        let mut place = (longitude_deg.to_radians(), latitude_deg.to_radians(), 0.0);
        transform(&frame.wgs84, &frame.plane, &mut place).map_err(|error| error.to_string())?;
        frame.origin = Origin::At([place.0, place.1]);
        Ok(frame)
    }

    fn tangent_at((longitude_deg, latitude_deg): (f64, f64)) -> Result<Self, String> {
        let mut frame = Self::plane("+proj=geocent +datum=WGS84")?;
        let (lon, lat) = (longitude_deg.to_radians(), latitude_deg.to_radians());
        let mut centre = (lon, lat, 0.0);
        transform(&frame.wgs84, &frame.plane, &mut centre).map_err(|error| error.to_string())?;
        frame.origin = Origin::Tangent(Tangent {
            centre_m: [centre.0, centre.1, centre.2],
            east: [-lon.sin(), lon.cos(), 0.0],
            north: [-lat.sin() * lon.cos(), -lat.sin() * lon.sin(), lat.cos()],
        });
        Ok(frame)
    }

    fn wgs84_from(&self, [x, y]: [f64; 2]) -> Result<[f64; 2], String> {
        let mut point = match &self.origin {
            Origin::At([east_m, north_m]) => (x + east_m, y + north_m, 0.0),
            Origin::Tangent(tangent) => tangent.point(x, y),
        };
        transform(&self.plane, &self.wgs84, &mut point)
            .map_err(|error| format!("local ({x}, {y}) cannot be projected: {error}"))?;
        let degrees = [point.0.to_degrees(), point.1.to_degrees()];
        match degrees[0].abs() <= 180.0 && degrees[1].abs() <= 90.0 {
            true => Ok(degrees),
            false => Err(format!("local ({x}, {y}) is not on the Earth")),
        }
    }
}

/// A place on the Earth, and its east and north, from the Earth's centre.
struct Tangent {
    centre_m: [f64; 3],
    east: [f64; 3],
    north: [f64; 3],
}

impl Tangent {
    fn point(&self, east_m: f64, north_m: f64) -> (f64, f64, f64) {
        let axis = |i: usize| self.centre_m[i] + east_m * self.east[i] + north_m * self.north[i];
        (axis(0), axis(1), axis(2))
    }
}
