//! provisional: replaced on merge
/// How well vehicles measure.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Noise {
    /// Detector.
    pub detector: DetectorNoise,
    /// Mounting.
    pub mounting: MountingNoise,
    /// Clock.
    pub clock: ClockNoise,
}
/// Mounting.
#[derive(Debug, Clone, PartialEq)]
pub struct MountingNoise {
    pub roll_rad: f64,
    pub pitch_rad: f64,
    pub yaw_rad: f64,
    pub position_m: f64,
    pub dynamics: f64,
}
impl Default for MountingNoise {
    fn default() -> Self {
        Self { roll_rad: 0.005, pitch_rad: 0.005, yaw_rad: 0.005, position_m: 0.03, dynamics: 1.0 }
    }
}
/// Clock.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockNoise {
    pub offset_s: f64,
}
impl Default for ClockNoise {
    fn default() -> Self {
        Self { offset_s: 0.02 }
    }
}
/// Detector.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectorNoise {
    pub rate_hz: f64,
    pub near_m: f64,
    pub far_m: f64,
    pub side_m: f64,
    pub sign_far_m: f64,
    pub point_every_m: f64,
    pub miss: f64,
    pub miss_at_side: f64,
    pub miss_at_far: f64,
    pub concentration: f64,
    pub hidden_per_s: f64,
    pub hidden_s: f64,
    pub blind_per_s: f64,
    pub blind_s: f64,
    pub lateral_m: f64,
    pub lateral_at_side_m: f64,
    pub lateral_kept_s: f64,
    pub pass_bias_m: f64,
    pub lateral_scale: f64,
    pub slope_rad: f64,
    pub point_m: f64,
    pub point_per_m: f64,
    pub kerb: f64,
    pub shadows_per_km: f64,
    pub clutter_per_s: f64,
    pub ghost: f64,
    pub mistaken: f64,
    pub unrecognised: f64,
    pub color_mistaken: f64,
    pub sign_miss: f64,
    pub sign_mistaken: f64,
    pub sign_m: f64,
    pub traffic_per_lane_km: f64,
}
impl Default for DetectorNoise {
    fn default() -> Self {
        Self {
            rate_hz: 10.0,
            near_m: 4.0,
            far_m: 25.0,
            side_m: 7.0,
            sign_far_m: 18.0,
            point_every_m: 2.0,
            miss: 0.06,
            miss_at_side: 0.35,
            miss_at_far: 0.3,
            concentration: 8.0,
            hidden_per_s: 0.04,
            hidden_s: 1.5,
            blind_per_s: 0.01,
            blind_s: 2.0,
            lateral_m: 0.05,
            lateral_at_side_m: 0.15,
            lateral_kept_s: 0.6,
            pass_bias_m: 0.05,
            lateral_scale: 0.02,
            slope_rad: 0.004,
            point_m: 0.02,
            point_per_m: 0.002,
            kerb: 0.15,
            shadows_per_km: 2.0,
            clutter_per_s: 0.1,
            ghost: 0.08,
            mistaken: 0.05,
            unrecognised: 0.1,
            color_mistaken: 0.03,
            sign_miss: 0.2,
            sign_mistaken: 0.07,
            sign_m: 0.15,
            traffic_per_lane_km: 12.0,
        }
    }
}
impl Noise {
    /// Provisional.
    pub fn named(_: &str) -> Result<Self, crate::error::CityError> {
        Ok(Self::default())
    }
}
