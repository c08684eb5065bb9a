//! What can be true. Every number passes here before it enters a noun, so that no NaN, infinity or
//! absurd value does.

use tilefold_schemas::limits::{
    MAX_ALTITUDE_M, MAX_CAMERA_PARAMETER, MAX_DISTORTION_COEFFICIENTS, MAX_POSITION_M,
    MAX_QUATERNION_NORM, MAX_SPEED_M_S, MAX_TURN_RATE_RAD_S, MAX_VARIANCE, MIN_QUATERNION_NORM,
};
use tilefold_schemas::log::{CameraCalibration, FramePose, GnssFix, Quaternion};

use super::error::DecodeError;

const NANOSECONDS: i64 = 1_000_000_000;

/// A header stamp in nanoseconds since the Unix epoch; `None` if it was left at zero.
pub(crate) fn stamp(seconds: i64, nanoseconds: u32) -> Result<Option<i64>, DecodeError> {
    if i64::from(nanoseconds) >= NANOSECONDS {
        return Err(DecodeError::Value {
            what: "nanoseconds of a stamp",
            value: f64::from(nanoseconds),
            expected: "less than 1e9",
        });
    }
    let stamp_ns = seconds
        .saturating_mul(NANOSECONDS)
        .saturating_add(i64::from(nanoseconds));
    Ok((stamp_ns != 0).then_some(stamp_ns))
}

/// A position in metres.
pub(crate) fn position(position_m: [f64; 3]) -> Result<[f64; 3], DecodeError> {
    for value in position_m {
        if !is_within(value, MAX_POSITION_M) {
            return Err(pose_error(
                "position in metres",
                value,
                "at most 1e8 either way",
            ));
        }
    }
    Ok(position_m)
}

/// An orientation: not normalised, but long enough to be.
pub(crate) fn orientation(quaternion: Quaternion) -> Result<Quaternion, DecodeError> {
    let norm = quaternion
        .iter()
        .map(|part| part * part)
        .sum::<f64>()
        .sqrt();
    if !(MIN_QUATERNION_NORM..=MAX_QUATERNION_NORM).contains(&norm) {
        return Err(pose_error("length of a quaternion", norm, "1e-3 to 1e3"));
    }
    Ok(quaternion)
}

/// A pose.
pub(crate) fn pose(position_m: [f64; 3], quaternion: Quaternion) -> Result<FramePose, DecodeError> {
    Ok(FramePose {
        position_m: position(position_m)?,
        orientation: orientation(quaternion)?,
    })
}

/// A linear velocity in metres per second.
pub(crate) fn velocity(velocity_m_s: [f64; 3]) -> Result<[f64; 3], DecodeError> {
    values(
        velocity_m_s,
        MAX_SPEED_M_S,
        "velocity in m/s",
        "at most 1e3 either way",
    )
}

/// An angular velocity in radians per second.
pub(crate) fn turn_rate(rate_rad_s: [f64; 3]) -> Result<[f64; 3], DecodeError> {
    values(
        rate_rad_s,
        MAX_TURN_RATE_RAD_S,
        "angular velocity in rad/s",
        "at most 1e3 either way",
    )
}

/// A GNSS position; `altitude_m` is NaN where the receiver gives none.
pub(crate) fn fix(
    latitude_deg: f64,
    longitude_deg: f64,
    altitude_m: f64,
    covariance_enu_m2: Option<[f64; 9]>,
    has_fix: bool,
) -> Result<GnssFix, DecodeError> {
    let altitude_m = if altitude_m.is_nan() { 0.0 } else { altitude_m };
    for (what, value, limit, expected) in [
        ("latitude in degrees", latitude_deg, 90.0, "-90 to 90"),
        ("longitude in degrees", longitude_deg, 360.0, "-360 to 360"),
        (
            "altitude in metres",
            altitude_m,
            MAX_ALTITUDE_M,
            "at most 1e5 either way",
        ),
    ] {
        if !is_within(value, limit) {
            return Err(pose_error(what, value, expected));
        }
    }
    Ok(GnssFix {
        latitude_deg,
        longitude_deg: wrap_degrees(longitude_deg),
        altitude_m,
        covariance_enu_m2: covariance_enu_m2.map(covariance).transpose()?.flatten(),
        has_fix,
    })
}

/// A row-major 3x3 covariance; `None` if it is all zero, which states nothing.
pub(crate) fn covariance(matrix: [f64; 9]) -> Result<Option<[f64; 9]>, DecodeError> {
    for (at, value) in matrix.into_iter().enumerate() {
        let is_diagonal = at % 4 == 0;
        if !is_within(value, MAX_VARIANCE) || (is_diagonal && value < 0.0) {
            return Err(pose_error("covariance", value, "0 to 1e12 on the diagonal"));
        }
    }
    Ok((matrix != [0.0; 9]).then_some(matrix))
}

/// Camera intrinsics.
pub(crate) fn calibration(
    calibration: CameraCalibration,
) -> Result<CameraCalibration, DecodeError> {
    if calibration.d.len() > MAX_DISTORTION_COEFFICIENTS {
        return Err(DecodeError::TooMany {
            what: "distortion coefficients",
            got: calibration.d.len(),
            limit: MAX_DISTORTION_COEFFICIENTS,
        });
    }
    for value in calibration.d.iter().chain(&calibration.k) {
        if !is_within(*value, MAX_CAMERA_PARAMETER) {
            return Err(value_error(
                "camera parameter",
                *value,
                "at most 1e6 either way",
            ));
        }
    }
    for focal_px in [calibration.k[0], calibration.k[4]] {
        if focal_px <= 0.0 {
            return Err(value_error(
                "focal length in pixels",
                focal_px,
                "more than 0",
            ));
        }
    }
    Ok(calibration)
}

/// Whether `value` is a number, and at most `limit` either way.
pub(crate) fn is_within(value: f64, limit: f64) -> bool {
    value.abs() <= limit
}

/// A number that is no position and cannot be true.
pub(crate) fn value_error(what: &'static str, value: f64, expected: &'static str) -> DecodeError {
    DecodeError::Value {
        what,
        value,
        expected,
    }
}

fn pose_error(what: &'static str, value: f64, expected: &'static str) -> DecodeError {
    DecodeError::Pose {
        what,
        value,
        expected,
    }
}

fn values(
    values: [f64; 3],
    limit: f64,
    what: &'static str,
    expected: &'static str,
) -> Result<[f64; 3], DecodeError> {
    match values.into_iter().find(|value| !is_within(*value, limit)) {
        Some(value) => Err(value_error(what, value, expected)),
        None => Ok(values),
    }
}

/// Longitudes in `[-180, 180]` stay as they are, bit for bit.
fn wrap_degrees(longitude_deg: f64) -> f64 {
    if longitude_deg > 180.0 {
        longitude_deg - 360.0
    } else if longitude_deg < -180.0 {
        longitude_deg + 360.0
    } else {
        longitude_deg
    }
}
