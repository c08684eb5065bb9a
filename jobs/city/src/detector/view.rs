//! Where a detector believes what it sees to be: back on flat ground, with the mounting that it
//! believes in.

use tilefold_schemas::element::ElementKind;

use super::Sight;
use super::look::CAMERA_M;
use crate::mounting::Misalignment;
use crate::noise::Lateral;
use crate::random::Random;

/// A ray that sinks less than this on a way of 1 m height does not meet the ground, in metres.
const LEAST_SINK_M: f64 = 0.1;

/// The errors of one vehicle's camera against what is believed of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    misalignment: Misalignment,
    /// Lateral distances are given times this.
    scale: f64,
    bias_m: f64,
}

impl View {
    pub(super) fn draw(noise: &Lateral, misalignment: Misalignment, vehicle: &mut Random) -> Self {
        Self {
            misalignment,
            scale: noise.scale + vehicle.normal(noise.scale_spread),
            bias_m: noise.bias_m,
        }
    }

    /// Where the points of a sight are believed to be, the body leaning by roll and pitch (radians)
    /// and the ground rising above the vehicle's plane as `rise_m` says; none if a ray does not meet
    /// the ground.
    pub(super) fn believed(
        &self,
        leaning: [f64; 2],
        sight: &Sight,
        rise_m: impl Fn([f64; 2]) -> f64,
    ) -> Option<Vec<[f64; 2]>> {
        let moved = sight.points.iter().map(|&point| {
            let [x_m, y_m] = self.through_camera(leaning, point, rise_m(point))?;
            Some([x_m, y_m * self.scale + self.bias_m])
        });
        match sight.kind {
            // What is too far up to be believed on the ground ends a line.
            ElementKind::LaneMarking => Some(moved.map_while(|point| point).collect()),
            _ => moved.collect(),
        }
    }

    /// A point of the true ground, seen with the true attitude and laid on flat ground with the
    /// believed one. Angles are small: rotations are added up.
    fn through_camera(
        &self,
        [body_roll_rad, body_pitch_rad]: [f64; 2],
        [x_m, y_m]: [f64; 2],
        up_m: f64,
    ) -> Option<[f64; 2]> {
        let [roll_rad, pitch_rad, yaw_rad] = self.misalignment.roll_pitch_yaw_rad;
        let (roll_rad, pitch_rad) = (roll_rad + body_roll_rad, pitch_rad + body_pitch_rad);
        let [forward_m, left_m, height_m] = self.misalignment.position_m;
        let (x_m, y_m) = (x_m - forward_m, y_m - left_m);
        let z_m = up_m - CAMERA_M - height_m;
        let ray_x = x_m + yaw_rad * y_m - pitch_rad * z_m;
        let ray_y = y_m - yaw_rad * x_m + roll_rad * z_m;
        let ray_z = z_m + pitch_rad * x_m - roll_rad * y_m;
        let scale = -CAMERA_M / ray_z;
        (ray_z < -LEAST_SINK_M).then_some([scale * ray_x, scale * ray_y])
    }
}
