//! Where things are: WGS 84, local east-north-up frames, UTM and geodesic lengths.
//!
//! Conventions, everywhere in Tilefold:
//! * a position on the earth is `[longitude_deg, latitude_deg, height_m]` on the WGS 84 ellipsoid;
//! * a position in a [`LocalFrame`] is `[east_m, north_m, up_m]`, up being the ellipsoid's normal at
//!   the anchor (so far from the anchor "up" leans: 1 m at 3.6 km of distance, in height);
//! * a **yaw** is in radians, counter-clockwise from the east axis of the frame it is in; a
//!   **bearing** is in degrees, clockwise from true north ([`yaw_from_bearing`], [`bearing_from_yaw`]).
//!
//! WGS 84 <-> ECEF <-> ENU is our own and exact to nanometres; UTM comes from `geoconvert`,
//! geodesics from `geographiclib-rs`; MGRS is in [`crate::mgrs`].

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use geoconvert::{LatLon, UtmUps};
use geographiclib_rs::{Geodesic, InverseGeodesic};

/// Semi-major axis of WGS 84, in metres.
pub const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// Flattening of WGS 84.
pub const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// Semi-minor axis of WGS 84, in metres.
pub const SEMI_MINOR_M: f64 = SEMI_MAJOR_M * (1.0 - FLATTENING);
/// First eccentricity squared.
const E2: f64 = FLATTENING * (2.0 - FLATTENING);
/// Second eccentricity squared.
const EP2: f64 = E2 / (1.0 - E2);

/// A position that UTM has no answer for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GeodesyError {
    /// A longitude or latitude outside of the earth, or not a number.
    #[error(
        "position ({longitude_deg}, {latitude_deg}) is not on the earth: a longitude is finite and a latitude lies in -90..=90; check the order (longitude first)"
    )]
    Position {
        /// Longitude, degrees.
        longitude_deg: f64,
        /// Latitude, degrees.
        latitude_deg: f64,
    },
    /// UTM figures that are none.
    #[error(
        "UTM zone {zone}, easting {easting_m} m, northing {northing_m} m is no position: {why}"
    )]
    Utm {
        /// Zone, 1 to 60; 0 for the polar grid.
        zone: u8,
        /// Easting, metres.
        easting_m: f64,
        /// Northing, metres.
        northing_m: f64,
        /// What the conversion says.
        why: String,
    },
}

/// `[longitude_deg, latitude_deg, height_m]` as earth-centred, earth-fixed metres.
#[must_use]
pub fn ecef_from_wgs84([longitude_deg, latitude_deg, height_m]: [f64; 3]) -> [f64; 3] {
    let (sin_lon, cos_lon) = longitude_deg.to_radians().sin_cos();
    let (sin_lat, cos_lat) = latitude_deg.to_radians().sin_cos();
    let normal_m = SEMI_MAJOR_M / (1.0 - E2 * sin_lat * sin_lat).sqrt();
    let across_m = (normal_m + height_m) * cos_lat;
    [
        across_m * cos_lon,
        across_m * sin_lon,
        (normal_m * (1.0 - E2) + height_m) * sin_lat,
    ]
}

/// Earth-centred, earth-fixed metres as `[longitude_deg, latitude_deg, height_m]`, longitude in
/// `-180..=180`.
///
/// Bowring's method (1976) in the parametric latitude with one refinement: below a nanometre for
/// heights between -100 km and 1,000 km. The earth's centre itself has no latitude.
#[must_use]
pub fn wgs84_from_ecef([x_m, y_m, z_m]: [f64; 3]) -> [f64; 3] {
    let across_m = x_m.hypot(y_m);
    let mut beta = (z_m * SEMI_MAJOR_M).atan2(across_m * SEMI_MINOR_M);
    let mut latitude = beta;
    for _ in 0..2 {
        let (sin_beta, cos_beta) = beta.sin_cos();
        latitude = (z_m + EP2 * SEMI_MINOR_M * sin_beta.powi(3))
            .atan2(across_m - E2 * SEMI_MAJOR_M * cos_beta.powi(3));
        beta = (latitude.sin() * (1.0 - FLATTENING)).atan2(latitude.cos());
    }
    let (sin_lat, cos_lat) = latitude.sin_cos();
    // Well-conditioned from the equator to the poles, unlike across / cos(latitude) - N.
    let height_m =
        across_m * cos_lat + z_m * sin_lat - SEMI_MAJOR_M * (1.0 - E2 * sin_lat * sin_lat).sqrt();
    [y_m.atan2(x_m).to_degrees(), latitude.to_degrees(), height_m]
}

/// An east-north-up frame in metres, anchored at a point of the earth.
///
/// ```
/// use tilefold_tiler::geodesy::LocalFrame;
/// let frame = LocalFrame::new([8.4243, 49.0035, 115.0]);
/// let [east_m, north_m, up_m] = frame.to_enu([8.4243, 49.0036, 115.0]);
/// assert!(east_m.abs() < 1e-6 && (north_m - 11.12).abs() < 0.01 && up_m.abs() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalFrame {
    anchor: [f64; 3],
    origin_ecef: [f64; 3],
    /// Rows: the east, north and up axes in ECEF.
    enu_from_ecef: [[f64; 3]; 3],
}

impl LocalFrame {
    /// The frame at `[longitude_deg, latitude_deg, height_m]`. An anchor that is not a number gives
    /// a frame that says only that.
    #[must_use]
    pub fn new(anchor: [f64; 3]) -> Self {
        let (sin_lon, cos_lon) = anchor[0].to_radians().sin_cos();
        let (sin_lat, cos_lat) = anchor[1].to_radians().sin_cos();
        Self {
            anchor,
            origin_ecef: ecef_from_wgs84(anchor),
            enu_from_ecef: [
                [-sin_lon, cos_lon, 0.0],
                [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
                [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
            ],
        }
    }

    /// Where the frame is anchored: `[longitude_deg, latitude_deg, height_m]`.
    #[must_use]
    pub fn anchor(&self) -> [f64; 3] {
        self.anchor
    }

    /// `[longitude_deg, latitude_deg, height_m]` as `[east_m, north_m, up_m]` of this frame.
    #[must_use]
    pub fn to_enu(&self, wgs84: [f64; 3]) -> [f64; 3] {
        let [x_m, y_m, z_m] = ecef_from_wgs84(wgs84);
        let [x0_m, y0_m, z0_m] = self.origin_ecef;
        rotate(&self.enu_from_ecef, [x_m - x0_m, y_m - y0_m, z_m - z0_m])
    }

    /// `[east_m, north_m, up_m]` of this frame as `[longitude_deg, latitude_deg, height_m]`.
    #[must_use]
    pub fn to_wgs84(&self, enu: [f64; 3]) -> [f64; 3] {
        let [dx_m, dy_m, dz_m] = rotate_back(&self.enu_from_ecef, enu);
        let [x0_m, y0_m, z0_m] = self.origin_ecef;
        wgs84_from_ecef([x0_m + dx_m, y0_m + dy_m, z0_m + dz_m])
    }

    /// A direction (not a position) of this frame in the axes of `other`.
    #[must_use]
    pub fn direction_in(&self, other: &Self, enu: [f64; 3]) -> [f64; 3] {
        rotate(&other.enu_from_ecef, rotate_back(&self.enu_from_ecef, enu))
    }

    /// A horizontal heading of this frame as a yaw of `other`: both in radians, counter-clockwise
    /// from their own east. The difference is the meridian convergence between the two anchors.
    ///
    /// A heading that a sensor gave against true north at the vehicle becomes a yaw of the chunk's
    /// frame with `LocalFrame::new(vehicle).yaw_in(&chunk_frame, yaw)`.
    #[must_use]
    pub fn yaw_in(&self, other: &Self, yaw_rad: f64) -> f64 {
        let (sin_yaw, cos_yaw) = yaw_rad.sin_cos();
        let [east, north, _] = self.direction_in(other, [cos_yaw, sin_yaw, 0.0]);
        north.atan2(east)
    }
}

fn rotate(rows: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn rotate_back(rows: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| rows[0][i] * v[0] + rows[1][i] * v[1] + rows[2][i] * v[2])
}

/// `angle_rad` brought into `-pi < angle <= pi`.
#[must_use]
pub fn wrap_angle(angle_rad: f64) -> f64 {
    let wrapped = angle_rad.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

/// The yaw (radians, counter-clockwise from east) of a bearing (degrees, clockwise from north).
#[must_use]
pub fn yaw_from_bearing(bearing_deg: f64) -> f64 {
    wrap_angle(FRAC_PI_2 - bearing_deg.to_radians())
}

/// The bearing (degrees, clockwise from north, `0..360`) of a yaw (radians, counter-clockwise from
/// east).
#[must_use]
pub fn bearing_from_yaw(yaw_rad: f64) -> f64 {
    let bearing_deg = (FRAC_PI_2 - yaw_rad).to_degrees().rem_euclid(360.0);
    // `rem_euclid` of a tiny negative number rounds to the modulus itself.
    if bearing_deg >= 360.0 {
        0.0
    } else {
        bearing_deg
    }
}

/// Length of the geodesic between two `[longitude_deg, latitude_deg, ..]` positions on the
/// ellipsoid, in metres (Karney, 2013). Heights do not enter.
#[must_use]
pub fn geodesic_m(from: [f64; 3], to: [f64; 3]) -> f64 {
    let length_m: f64 = Geodesic::wgs84().inverse(from[1], from[0], to[1], to[0]);
    length_m
}

/// A position in the Universal Transverse Mercator grid, or (zone 0) the polar stereographic one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Utm {
    /// Zone, 1 to 60; 0 beyond 84 degrees north and 80 degrees south (UPS).
    pub zone: u8,
    /// Whether the false northing is that of the northern hemisphere.
    pub north: bool,
    /// Easting, metres.
    pub easting_m: f64,
    /// Northing, metres.
    pub northing_m: f64,
}

impl From<UtmUps> for Utm {
    fn from(utm: UtmUps) -> Self {
        Self {
            zone: u8::try_from(utm.zone()).unwrap_or(0),
            north: utm.is_north(),
            easting_m: utm.easting(),
            northing_m: utm.northing(),
        }
    }
}

/// The UTM (or UPS) position of a point, in its standard zone.
///
/// # Errors
/// If the position is not on the earth.
pub fn utm_from_wgs84(longitude_deg: f64, latitude_deg: f64) -> Result<Utm, GeodesyError> {
    Ok(lat_lon(longitude_deg, latitude_deg)?.to_utmups().into())
}

/// `[longitude_deg, latitude_deg]` of a UTM (or UPS) position.
///
/// # Errors
/// If the zone does not exist or the position lies outside of the grid.
pub fn wgs84_from_utm(utm: &Utm) -> Result<[f64; 2], GeodesyError> {
    let wrong = |why: String| GeodesyError::Utm {
        zone: utm.zone,
        easting_m: utm.easting_m,
        northing_m: utm.northing_m,
        why,
    };
    if !(utm.easting_m.is_finite() && utm.northing_m.is_finite()) {
        return Err(wrong("easting and northing must be finite".to_owned()));
    }
    let at = UtmUps::create(
        i32::from(utm.zone),
        utm.north,
        utm.easting_m,
        utm.northing_m,
    )
    .map_err(|error| wrong(error.to_string()))?
    .to_latlon();
    Ok([at.longitude(), at.latitude()])
}

fn lat_lon(longitude_deg: f64, latitude_deg: f64) -> Result<LatLon, GeodesyError> {
    let wrong = || GeodesyError::Position {
        longitude_deg,
        latitude_deg,
    };
    if !longitude_deg.is_finite() {
        return Err(wrong());
    }
    let wrapped_deg = (longitude_deg + 180.0).rem_euclid(360.0) - 180.0;
    // Inside of the range nothing is rounded.
    let longitude_in_range_deg = if (-180.0..180.0).contains(&longitude_deg) {
        longitude_deg
    } else {
        wrapped_deg
    };
    LatLon::create(latitude_deg, longitude_in_range_deg).map_err(|_| wrong())
}
