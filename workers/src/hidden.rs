//! What a frame cannot see of the road before it: what lies outside the image, and what other
//! vehicles hide (V_occ; method.md, section 6).
//!
//! A box in metres hides a point of the road if the line of sight to it passes through the box; the
//! outline of a vehicle in the image hides the pixels inside it.

use nalgebra::{Isometry3, Point3, Vector3};
use tilefold_schemas::log::{DetectionSpace, VehicleFrame};
use tilefold_tiler::recording::{Recording, Stamped};

use crate::camera::Camera;
use crate::frames::FrameTree;

/// Vehicles seen this far in time from a frame are those that the frame has around it.
const MAX_APART_NS: i64 = 150_000_000;
/// The eye of a channel whose camera is not known, in the vehicle frame, in metres: behind the
/// windscreen.
const EYE_M: [f64; 3] = [1.5, 0.0, 1.4];
/// Lines of sight are looked at in steps of this share.
const SIGHT_STEPS: usize = 32;

/// What hides the road from one frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Hidden<'a> {
    /// Known of channels in pixels only.
    camera: Option<&'a Camera>,
    eye_m: Vector3<f64>,
    boxes: Vec<Solid>,
    /// Outlines in pixels of the camera.
    outlines: Vec<Vec<[f64; 2]>>,
}

/// A box as a prism that stands upright in the vehicle frame.
#[derive(Debug, Clone, PartialEq)]
struct Solid {
    /// Counter-clockwise.
    footprint_m: Vec<[f64; 2]>,
    top_m: f64,
    bottom_m: f64,
}

/// All vehicles of a recording, to be asked for a frame's.
#[derive(Debug)]
pub struct Traffic<'a> {
    recording: &'a Recording,
    tree: &'a FrameTree,
    camera: Option<&'a Camera>,
}

impl<'a> Traffic<'a> {
    /// The traffic around a channel; `camera` is its camera, if it has one.
    #[must_use]
    pub fn new(recording: &'a Recording, tree: &'a FrameTree, camera: Option<&'a Camera>) -> Self {
        Self {
            recording,
            tree,
            camera,
        }
    }

    /// The vehicles around the frame of this stamp: of every source the nearest in time.
    #[must_use]
    pub fn at(&self, stamp_ns: i64) -> Hidden<'a> {
        let mut hidden = Hidden {
            camera: self.camera,
            eye_m: self.camera.map_or(Vector3::from(EYE_M), |camera| {
                camera.vehicle_from_camera.translation.vector
            }),
            ..Hidden::default()
        };
        let all = &self.recording.vehicles;
        let first = all.partition_point(|frame| frame.stamp_ns < stamp_ns - MAX_APART_NS);
        let near = all[first..]
            .iter()
            .take_while(|frame| frame.stamp_ns <= stamp_ns + MAX_APART_NS);
        let apart_ns = |frame: &&Stamped<VehicleFrame>| (frame.stamp_ns - stamp_ns).abs();
        if let Some(nearest_ns) = near.clone().map(|frame| apart_ns(&frame)).min() {
            near.filter(|frame| apart_ns(frame) == nearest_ns)
                .for_each(|frame| self.add(frame, &mut hidden));
        }
        hidden
    }

    fn add(&self, frame: &Stamped<VehicleFrame>, hidden: &mut Hidden<'_>) {
        match (frame.value.space, self.camera) {
            (DetectionSpace::Metres, _) => {
                let Some(vehicle_from_frame) = self.tree.vehicle_from(&frame.frame_id) else {
                    return;
                };
                let boxes = frame.value.vehicles.iter();
                hidden.boxes.extend(
                    boxes.filter_map(|corners| Solid::around(corners, &vehicle_from_frame)),
                );
            }
            (DetectionSpace::Pixels, Some(_)) => {
                let outlines = frame.value.vehicles.iter().map(|corners| {
                    let pixels = corners.iter().map(|&[u, v, _]| [u, v]);
                    hull(pixels.collect())
                });
                let outlines = outlines.filter(|outline| outline.len() >= 3);
                hidden.outlines.extend(outlines);
            }
            // An outline in nobody's image hides nothing that is known.
            (DetectionSpace::Pixels, None) => {}
        }
    }
}

impl Hidden<'_> {
    /// Whether there is no other vehicle.
    #[must_use]
    pub fn is_nothing(&self) -> bool {
        self.boxes.is_empty() && self.outlines.is_empty()
    }

    /// Whether a point (vehicle frame, metres) lies in the camera's image, if the camera is known.
    #[must_use]
    pub fn is_in_image(&self, point_m: [f64; 3]) -> bool {
        self.camera.is_none_or(|camera| {
            let pixel = camera.pixel_from_vehicle(point_m);
            pixel.is_some_and(|pixel| camera.shows(pixel))
        })
    }

    /// Whether a point (vehicle frame, metres) is behind or under a vehicle.
    #[must_use]
    pub fn hides(&self, point_m: [f64; 3]) -> bool {
        let target = Vector3::from(point_m);
        let is_in = |pixel: [f64; 2]| {
            let mut outlines = self.outlines.iter();
            outlines.any(|outline| contains(outline, pixel))
        };
        let pixel = self
            .camera
            .and_then(|camera| camera.pixel_from_vehicle(point_m));
        let mut boxes = self.boxes.iter();
        boxes.any(|solid| solid.is_between(self.eye_m, target)) || pixel.is_some_and(is_in)
    }

    /// V_occ of a line through these points (vehicle frame, metres): the share of its longest run
    /// that is not hidden. What is left in pieces is worth less than what is left in one.
    #[must_use]
    pub fn open_share(&self, points_m: impl Iterator<Item = [f64; 3]>) -> f64 {
        if self.is_nothing() {
            return 1.0;
        }
        let (mut run, mut longest, mut all) = (0_u32, 0_u32, 0_u32);
        for point_m in points_m {
            run = if self.hides(point_m) { 0 } else { run + 1 };
            longest = longest.max(run);
            all += 1;
        }
        f64::from(longest) / f64::from(all.max(1))
    }
}

impl Solid {
    fn around(corners: &[[f64; 3]], vehicle_from_frame: &Isometry3<f64>) -> Option<Self> {
        let corners = corners
            .iter()
            .map(|corner| vehicle_from_frame * Point3::from(*corner));
        let corners: Vec<Point3<f64>> = corners.collect();
        let heights = corners.iter().map(|corner| corner.z);
        let footprint_m = hull(corners.iter().map(|corner| [corner.x, corner.y]).collect());
        (footprint_m.len() >= 3).then(|| Self {
            footprint_m,
            bottom_m: heights.clone().fold(f64::INFINITY, f64::min),
            top_m: heights.fold(f64::NEG_INFINITY, f64::max),
        })
    }

    fn is_between(&self, eye_m: Vector3<f64>, target: Vector3<f64>) -> bool {
        // What stands over the own origin is the own vehicle.
        if contains(&self.footprint_m, [0.0, 0.0]) {
            return false;
        }
        // A vehicle's box may float a little over the road, or sink into it.
        let bottom_m = self.bottom_m.min(0.0);
        let within = |share: f64| {
            let at = eye_m.lerp(&target, share);
            (bottom_m..=self.top_m).contains(&at.z) && contains(&self.footprint_m, [at.x, at.y])
        };
        (1..=SIGHT_STEPS).any(|step| within(step as f64 / SIGHT_STEPS as f64))
    }
}

/// The convex hull, counter-clockwise (Andrew, 1979); fewer than three points if they lie in a line.
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let mut side: Vec<[f64; 2]> = Vec::new();
        for &point in points {
            while let [.., a, b] = side[..]
                && turn(a, b, point) <= 0.0
            {
                side.pop();
            }
            side.push(point);
        }
        side.pop();
        side
    };
    let mut hull = half(&mut points.iter());
    hull.extend(half(&mut points.iter().rev()));
    hull
}

/// Whether a counter-clockwise convex polygon holds a point.
fn contains(polygon: &[[f64; 2]], point: [f64; 2]) -> bool {
    let nexts = polygon.iter().cycle().skip(1);
    let mut edges = polygon.iter().zip(nexts);
    edges.all(|(from, to)| turn(*from, *to, point) >= 0.0)
}

/// Positive if a, b, c turn to the left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::tests::camera;

    /// A box of a car of 1.5 m height on the ground.
    fn car(ahead_m: (f64, f64), left_m: (f64, f64)) -> Vec<[f64; 3]> {
        let corner = |x, y, z| [x, y, z];
        let mut corners = Vec::new();
        for x in [ahead_m.0, ahead_m.1] {
            for y in [left_m.0, left_m.1] {
                corners.extend([corner(x, y, 0.0), corner(x, y, 1.5)]);
            }
        }
        corners
    }

    fn recording(space: DetectionSpace, stamp_ns: i64, vehicle: Vec<[f64; 3]>) -> Recording {
        let mut recording = Recording::default();
        recording.vehicles.push(Stamped {
            stamp_ns,
            frame_id: String::new(),
            digest: 0,
            value: VehicleFrame {
                space,
                vehicles: vec![vehicle],
            },
        });
        recording
    }

    fn line(left_m: f64) -> impl Iterator<Item = [f64; 3]> {
        (3..=20).map(move |x| [f64::from(x), left_m, 0.0])
    }

    #[test]
    fn a_car_ahead_hides_what_is_under_and_behind_it() {
        let tree = FrameTree::default();
        let recording = recording(DetectionSpace::Metres, 0, car((10.0, 14.0), (-0.9, 0.9)));
        let hidden = Traffic::new(&recording, &tree, None).at(100_000_000);
        assert!(!hidden.hides([8.0, 0.0, 0.0]), "before it");
        assert!(hidden.hides([12.0, 0.0, 0.0]), "under it");
        assert!(hidden.hides([18.0, 0.0, 0.0]), "behind it");
        assert!(!hidden.hides([12.0, 1.8, 0.0]), "beside it");
        // Of 18 metres the first 7 are open.
        assert_eq!(hidden.open_share(line(0.0)), 7.0 / 18.0);
        assert_eq!(hidden.open_share(line(3.0)), 1.0);
    }

    #[test]
    fn a_line_with_a_hole_is_worth_its_longest_piece() {
        // A car to the left of the line of sight hides a part of a line farther left.
        let tree = FrameTree::default();
        let recording = recording(DetectionSpace::Metres, 0, car((6.0, 8.0), (1.5, 3.2)));
        let hidden = Traffic::new(&recording, &tree, None).at(0);
        let open: Vec<bool> = line(4.0).map(|point| !hidden.hides(point)).collect();
        let count = open.iter().filter(|open| **open).count();
        let longest = open.split(|open| !open).map(<[bool]>::len).max().unwrap();
        assert!(count > longest, "{open:?}");
        assert_eq!(hidden.open_share(line(4.0)), longest as f64 / 18.0);
    }

    #[test]
    fn vehicles_of_another_time_hide_nothing_nor_does_the_own_one() {
        let tree = FrameTree::default();
        let late = recording(
            DetectionSpace::Metres,
            200_000_000,
            car((10.0, 14.0), (-1.0, 1.0)),
        );
        assert!(Traffic::new(&late, &tree, None).at(0).is_nothing());
        let own = recording(DetectionSpace::Metres, 0, car((-1.0, 3.5), (-0.9, 0.9)));
        assert_eq!(
            Traffic::new(&own, &tree, None).at(0).open_share(line(0.0)),
            1.0
        );
        assert_eq!(Hidden::default().open_share(line(0.0)), 1.0);
    }

    #[test]
    fn an_outline_hides_the_pixels_inside_it() {
        let tree = FrameTree::default();
        let camera = camera();
        let [u, v] = camera.pixel_from_vehicle([12.0, 0.0, 0.0]).unwrap();
        let (left, right, top, bottom) = (u - 60.0, u + 60.0, v - 80.0, v + 5.0);
        let outline = vec![
            [left, top, 0.0],
            [right, top, 0.0],
            [right, bottom, 0.0],
            [left, bottom, 0.0],
        ];
        let recording = recording(DetectionSpace::Pixels, 0, outline);
        let hidden = Traffic::new(&recording, &tree, Some(&camera)).at(0);
        assert!(hidden.hides([12.0, 0.0, 0.0]));
        assert!(hidden.hides([20.0, 0.0, 0.0]));
        assert!(!hidden.hides([6.0, 0.0, 0.0]));
        assert!(!hidden.hides([12.0, 3.0, 0.0]));
        assert!(Traffic::new(&recording, &tree, None).at(0).is_nothing());
    }
}
