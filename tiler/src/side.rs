//! How well a line is seen to the side of a vehicle: the one thing about looking that the map
//! stage (which counts exposures) and the reduce stage (which holds footprints against candidates)
//! must agree on.

/// Lines within this distance to the side are seen as well as any, in metres: those of the own lane.
const NEAR_SIDE_M: f64 = 2.2;
/// How much visibility falls per metre beyond.
const SIDE_LOSS_PER_M: f64 = 0.6;
/// What is left of it for lines of the next lane.
const SIDE_VISIBILITY: f64 = 0.29;
/// Lines farther to the side are not seen, in metres.
pub const FAR_SIDE_M: f64 = 6.2;
/// V_dist of a line at a lateral distance: the share of frames in which a line there is seen,
/// relative to one beside the vehicle (measured on the DeeCamp drives: 0.73, 0.42 and 0.21 up to
/// 2.2, 3.2 and 6.2 m).
#[must_use]
pub fn side_visibility(lateral_m: f64) -> f64 {
    let side_m = lateral_m.abs();
    if side_m > FAR_SIDE_M {
        return 0.0;
    }
    (1.0 - SIDE_LOSS_PER_M * (side_m - NEAR_SIDE_M)).clamp(SIDE_VISIBILITY, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falls_from_the_own_lane_to_the_next_and_ends() {
        assert_eq!(side_visibility(-1.8), 1.0);
        assert!((side_visibility(2.7) - 0.7).abs() < 1e-12);
        assert_eq!(side_visibility(5.0), SIDE_VISIBILITY);
        assert_eq!(side_visibility(6.3), 0.0);
    }
}
