//! Where a detector believes what it sees to be: back on flat ground, with the mounting that it
//! believes in.

use tilefold_schemas::element::ElementKind;

use super::Sight;
use super::look::{CAMERA_M, Look};
use crate::course::Motion;
use crate::noise::{DetectorNoise, MountingNoise};
use crate::random::Random;
use crate::relief::Relief;

/// The errors of one vehicle's camera against what is believed of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    roll_rad: f64,
    pitch_rad: f64,
    yaw_rad: f64,
    /// Forward, left and up.
    position_m: [f64; 3],
    /// How much of the body's leaning the detector does not know of.
    dynamics: f64,
    /// How much wider than it is a road is seen, less 1.
    widening: f64,
    bias_m: f64,
}

impl View {
    pub(super) fn draw(
        noise: &DetectorNoise,
        mounting: &MountingNoise,
        vehicle: &mut Random,
    ) -> Self {
        Self {
            roll_rad: vehicle.normal(mounting.roll_rad),
            pitch_rad: vehicle.normal(mounting.pitch_rad),
            yaw_rad: vehicle.normal(mounting.yaw_rad),
            position_m: [0, 1, 2].map(|_| vehicle.normal(mounting.position_m)),
            dynamics: mounting.dynamics,
            widening: vehicle.normal(noise.lateral_scale),
            bias_m: vehicle.normal(noise.pass_bias_m),
        }
    }

    /// Where the points of a sight are believed to be; none if a ray does not meet the ground.
    pub(super) fn believed(
        &self,
        motion: &Motion,
        look: &Look<'_>,
        relief: &Relief,
        sight: &Sight,
    ) -> Option<Vec<[f64; 2]>> {
        let moved = sight.points.iter().map(|&point| {
            let [x_m, y_m] = self.through_camera(motion, point, look.rise_m(point, relief))?;
            Some([x_m, y_m * (1.0 + self.widening) + self.bias_m])
        });
        match sight.kind {
            // What is too far up to be believed on the ground ends a line.
            ElementKind::LaneMarking => {
                let points: Vec<[f64; 2]> = moved.map_while(|point| point).collect();
                (points.len() > 2).then_some(points)
            }
            _ => moved.collect(),
        }
    }

    /// A point of the true ground, seen with the true attitude and laid on flat ground with the
    /// believed one. Angles are small: rotations are added up.
    fn through_camera(&self, motion: &Motion, [x_m, y_m]: [f64; 2], up_m: f64) -> Option<[f64; 2]> {
        let pitch_rad = self.pitch_rad + self.dynamics * motion.pitch_rad;
        let roll_rad = self.roll_rad + self.dynamics * motion.roll_rad;
        let [forward_m, left_m, height_m] = self.position_m;
        let (x_m, y_m) = (x_m - forward_m, y_m - left_m);
        let z_m = up_m - CAMERA_M - height_m;
        let ray_x = x_m + self.yaw_rad * y_m - pitch_rad * z_m;
        let ray_y = y_m - self.yaw_rad * x_m + roll_rad * z_m;
        let ray_z = z_m + pitch_rad * x_m - roll_rad * y_m;
        let scale = -CAMERA_M / ray_z;
        (ray_z < -0.1).then_some([scale * ray_x, scale * ray_y])
    }
}
