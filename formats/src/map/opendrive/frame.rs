//! From the coordinates of an OpenDRIVE file to WGS 84: its `geoReference` (a PROJ string, or an EPSG
//! code alone or at the end of WKT) and the `offset` of its header.

use proj4rs::Proj;
use proj4rs::transform::transform;

use super::tree::Node;
use crate::map::fence::Place;
use crate::map::xml::shown;

/// The frame that a file's coordinates are in.
pub(super) struct Frame {
    /// What the file's coordinates are, once moved.
    projection: Proj,
    wgs84: Proj,
    /// Where the file's origin is in the projection, in metres.
    offset_m: [f64; 3],
    /// How the file's axes are turned against the projection's, in radians.
    heading_rad: f64,
}

impl Frame {
    /// The frame of a document, or where and why it has none.
    pub(super) fn of(root: &Node) -> Result<Self, (Place, String)> {
        let header = root.all("header").next().unwrap_or(root);
        let Some(reference) = header.all("geoReference").next() else {
            let what = "there is no geoReference: without one nobody knows where the roads are";
            return Err((header.place, what.to_owned()));
        };
        let projection = projection(&reference.text).map_err(|why| (reference.place, why))?;
        let wgs84 = Proj::from_proj_string("+proj=longlat +datum=WGS84 +no_defs")
            .map_err(|error| (reference.place, error.to_string()))?;
        let mut frame = Self {
            projection,
            wgs84,
            offset_m: [0.0; 3],
            heading_rad: 0.0,
        };
        if let Some(offset) = header.all("offset").next() {
            frame.shift(offset).map_err(|why| (offset.place, why))?;
        }
        Ok(frame)
    }

    fn shift(&mut self, offset: &Node) -> Result<(), String> {
        for (value, key) in self.offset_m.iter_mut().zip(["x", "y", "z"]) {
            *value = offset.number_or(key, 0.0)?;
        }
        self.heading_rad = offset.number_or("hdg", 0.0)?;
        Ok(())
    }

    /// `[longitude_deg, latitude_deg, elevation_m]` of a point of the file.
    pub(super) fn wgs84_from(&self, [x, y, z]: [f64; 3]) -> Result<[f64; 3], String> {
        let (sin, cos) = self.heading_rad.sin_cos();
        let mut point = (
            x * cos - y * sin + self.offset_m[0],
            x * sin + y * cos + self.offset_m[1],
            z + self.offset_m[2],
        );
        let moved = transform(&self.projection, &self.wgs84, &mut point);
        let degrees = [point.0.to_degrees(), point.1.to_degrees(), point.2];
        let is_on_earth = degrees[0].abs() <= 180.0 && degrees[1].abs() <= 90.0;
        match moved {
            Ok(()) if is_on_earth && point.2.is_finite() => Ok(degrees),
            Ok(()) => Err(format!("its point ({x}, {y}) is not on the Earth")),
            Err(error) => Err(format!("its point ({x}, {y}) cannot be projected: {error}")),
        }
    }
}

fn projection(text: &str) -> Result<Proj, String> {
    let text = text.trim();
    let wrong = |why: String| {
        format!(
            "the geoReference {:?} is no PROJ string or UTM code that is read ({why}); write one such \
             as \"+proj=utm +zone=32 +datum=WGS84\" or \"EPSG:32632\"",
            shown(text)
        )
    };
    let definition = match epsg(text) {
        Some(code) => utm(code).ok_or_else(|| wrong(format!("EPSG:{code} is no UTM zone")))?,
        None => text.to_owned(),
    };
    let projection =
        Proj::from_proj_string(&definition).map_err(|error| wrong(error.to_string()))?;
    match projection.is_latlong() || projection.is_geocent() {
        true => Err(wrong("it has no metres on a plane".to_owned())),
        false => Ok(projection),
    }
}

/// The code of `EPSG:25832`, of `urn:ogc:def:crs:EPSG::25832`, or of WKT: the last one there is that of
/// the whole, because the parts of it come first.
fn epsg(text: &str) -> Option<u32> {
    if text.starts_with('+') {
        return None;
    }
    let (_, code) = text.rsplit_once("EPSG")?;
    let code = code.trim_start_matches(['"', ',', ':', ' ']);
    let digits = code
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(code.len());
    code[..digits].parse().ok()
}

/// UTM on WGS 84 or ETRS89, which differ by less than a metre and by nothing within a map.
fn utm(code: u32) -> Option<String> {
    let (zone, south, ellipsoid) = match code {
        32_601..=32_660 => (code - 32_600, "", "+datum=WGS84"),
        32_701..=32_760 => (code - 32_700, " +south", "+datum=WGS84"),
        25_828..=25_838 => (code - 25_800, "", "+ellps=GRS80 +towgs84=0,0,0"),
        _ => return None,
    };
    Some(format!(
        "+proj=utm +zone={zone}{south} {ellipsoid} +units=m"
    ))
}
