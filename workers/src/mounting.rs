//! The mounting of a camera, refined per drive: roll, pitch, yaw and height that lay the lines seen
//! in pixels on the map's (method.md, section 4).
//!
//! A degree of pitch is a metre and a half at ten metres, and what a log says of its mounting is
//! often a drawing. Robust Gauss-Newton over the lateral residuals of matched lines, with the
//! registration of the chain taken anew at every round. What is common to all lines of a frame is
//! the vehicle's place, not the camera's: it is taken out of every frame. The prior around the
//! stated mounting is tight, but has the tails of a Cauchy distribution, so that a mounting which
//! clearly does not fit may go far. What the drive cannot tell stays as stated.

mod drive;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::camera::Camera;
use crate::clock;
use crate::local_map::LocalMap;
use crate::look::{Look, SeenFrame, place};
use crate::map_chunk::cut;
use crate::pixels::{Casting, Pixels};
use crate::pose::Trajectory;
use crate::surface::{Heights, Surface};
use drive::Drive;

/// How far a stated mounting is usually off: roll, pitch and yaw in radians, height in metres.
const PRIOR_SIGMA: [f64; 4] = [0.0087, 0.0087, 0.0087, 0.10];
/// Turns of estimating lag and mounting; the second one mostly changes nothing any more.
const MAX_TURNS: usize = 3;

/// What was found out about a mounting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mounting {
    /// What was added to the stated roll, pitch and yaw (radians, about the vehicle's axes through
    /// the camera) and height (metres); 0 where it was not observed.
    pub correction: [f64; 4],
    /// Their standard deviations; that of the prior where not observed.
    pub sigma: [f64; 4],
    /// Which of them the drive could tell.
    pub is_observed: [bool; 4],
    /// Pairs of a seen and a map line that it was told from.
    pub pairs: usize,
    /// Median distance of matched lines from the map's after registration, in metres, as stated...
    pub stated_miss_m: f64,
    /// ... and as refined.
    pub refined_miss_m: f64,
}

impl Mounting {
    /// The stated mounting, of which nothing was found out.
    fn stated(pairs: usize, miss_m: f64) -> Self {
        Self {
            correction: [0.0; 4],
            sigma: PRIOR_SIGMA,
            is_observed: [false; 4],
            pairs,
            stated_miss_m: miss_m,
            refined_miss_m: miss_m,
        }
    }
}

/// A stated mounting with a correction.
#[must_use]
pub fn corrected(camera: &Camera, [roll, pitch, yaw, height_m]: [f64; 4]) -> Camera {
    let stated = camera.vehicle_from_camera;
    let turned = UnitQuaternion::from_euler_angles(roll, pitch, yaw) * stated.rotation;
    let raised = stated.translation.vector + Vector3::new(0.0, 0.0, height_m);
    let mut corrected = camera.clone();
    corrected.vehicle_from_camera = Isometry3::from_parts(raised.into(), turned);
    corrected
}

/// Refines the mounting of the camera of a chunk, and casts `frames` anew with it onto flat ground.
/// A mounting that is off hides the lag between the clocks, and a lag hides what the mounting is off:
/// both are estimated by turns.
#[must_use]
pub fn settle(
    pixels: &Pixels,
    frames: &mut [SeenFrame],
    trajectory: &Trajectory,
    map: &LocalMap<'_>,
    heights: Option<&Heights>,
) -> (Casting, Mounting) {
    let mut lag_ns = clock::estimate(frames, trajectory, map).lag_ns;
    let mut turn = 1;
    loop {
        let (looks, _) = place(frames.to_vec(), trajectory, lag_ns);
        let stated = pixels.cast_on(heights, &looks);
        let (refined, mounting) = refine(pixels, stated, &looks, map);
        for frame in frames.iter_mut() {
            frame.lines = pixels.lines(frame.stamp_ns, &refined.camera, &Surface::FLAT);
        }
        let lag_before_ns = lag_ns;
        lag_ns = clock::estimate(frames, trajectory, map).lag_ns;
        if lag_ns == lag_before_ns || turn == MAX_TURNS {
            return (refined, mounting);
        }
        turn += 1;
    }
}

/// Refines the mounting of a camera over the looks of a chunk. `stated` is the camera as the log has it, and the road.
#[must_use]
pub fn refine(
    pixels: &Pixels,
    stated: Casting,
    looks: &[Look],
    map: &LocalMap<'_>,
) -> (Casting, Mounting) {
    let cross_cuts = cut(looks, map);
    let mounting = Drive::new(pixels, &stated, looks, &cross_cuts, map).mounting();
    let camera = corrected(&stated.camera, mounting.correction);
    (Casting { camera, ..stated }, mounting)
}
