//! The static frame tree of a vehicle: where sensors are mounted.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use tilefold_schemas::log::Transform;
use tilefold_tiler::recording::Series;

/// Frames are followed at most this deep, so that a cycle ends.
const MAX_DEPTH: usize = 32;

/// Static transforms by child frame.
#[derive(Debug, Clone, Default)]
pub struct FrameTree {
    parents: BTreeMap<String, (String, Isometry3<f64>)>,
}

impl FrameTree {
    /// The tree of all static transforms of a recording; a later one replaces an earlier one.
    #[must_use]
    pub fn new(static_transforms: &Series<Vec<Transform>>) -> Self {
        let mut tree = Self::default();
        for transform in static_transforms.iter().flat_map(|entry| &entry.value) {
            if let Some(parent_from_child) = isometry(transform) {
                tree.parents.insert(
                    transform.child_frame.clone(),
                    (transform.parent_frame.clone(), parent_from_child),
                );
            }
        }
        tree
    }

    /// Where `frame` is in the vehicle frame: the root of its tree. A frame that no transform
    /// mentions is taken to be the vehicle frame itself, and `None` is for a cycle.
    #[must_use]
    pub fn vehicle_from(&self, frame: &str) -> Option<Isometry3<f64>> {
        let mut vehicle_from_frame = Isometry3::identity();
        let mut at = frame;
        for _ in 0..MAX_DEPTH {
            let Some((parent, parent_from_child)) = self.parents.get(at) else {
                return Some(vehicle_from_frame);
            };
            vehicle_from_frame = parent_from_child * vehicle_from_frame;
            at = parent;
        }
        None
    }

    /// Whether some transform places `frame`.
    #[must_use]
    pub fn places(&self, frame: &str) -> bool {
        self.parents.contains_key(frame)
    }
}

fn isometry(transform: &Transform) -> Option<Isometry3<f64>> {
    let [x, y, z, w] = transform.rotation;
    // `try_new` refuses a zero quaternion, from which normalising would make NaN.
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9)?;
    let isometry = Isometry3::from_parts(Vector3::from(transform.translation_m).into(), rotation);
    isometry
        .translation
        .vector
        .iter()
        .chain(isometry.rotation.coords.iter())
        .all(|value| value.is_finite())
        .then_some(isometry)
}

/// Yaw of an orientation: counter-clockwise from the parent's x axis, in radians.
/// None for a quaternion that is no rotation.
#[must_use]
pub fn yaw_rad([x, y, z, w]: [f64; 4]) -> Option<f64> {
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9)?;
    let forward = rotation * Vector3::x();
    let yaw = forward.y.atan2(forward.x);
    yaw.is_finite().then_some(yaw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_tiler::recording::Stamped;

    fn transform(parent: &str, child: &str, x: f64) -> Transform {
        Transform {
            parent_frame: parent.to_owned(),
            child_frame: child.to_owned(),
            translation_m: [x, 0.0, 0.0],
            rotation: [0.0, 0.0, 0.0, 2.0],
        }
    }

    fn tree(transforms: Vec<Transform>) -> FrameTree {
        FrameTree::new(&vec![Stamped {
            stamp_ns: 0,
            frame_id: String::new(),
            digest: 0,
            value: transforms,
        }])
    }

    #[test]
    fn follows_the_tree_to_its_root() {
        let tree = tree(vec![
            transform("base_link", "mast", 1.0),
            transform("mast", "camera", 0.5),
        ]);
        let camera = tree.vehicle_from("camera").unwrap();
        assert!((camera.translation.x - 1.5).abs() < 1e-12);
        assert_eq!(tree.vehicle_from("base_link"), Some(Isometry3::identity()));
    }

    #[test]
    fn a_cycle_is_no_tree() {
        let tree = tree(vec![transform("a", "b", 1.0), transform("b", "a", 1.0)]);
        assert_eq!(tree.vehicle_from("a"), None);
    }

    #[test]
    fn yaw_is_counter_clockwise_from_east_and_zero_quaternions_have_none() {
        let half = (0.25 * std::f64::consts::PI).sin();
        assert!(
            (yaw_rad([0.0, 0.0, half, half]).unwrap() - std::f64::consts::FRAC_PI_2).abs() < 1e-9
        );
        assert_eq!(yaw_rad([0.0; 4]), None);
    }
}
