//! Detections in pixels, kept as the rays that saw them: the lens is taken out once, and rays are
//! cast onto the road again whenever the camera's mounting or the road is known better.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use tilefold_schemas::log::DetectionFrame;
use tilefold_tiler::recording::Stamped;

use crate::camera::Camera;
use crate::look::{Look, SeenLine, lane_markings};
use crate::surface::{Heights, Surface};

/// Trusted range of rays cast onto the road, metres ahead: nearer is the bonnet, farther a degree
/// of pitch is metres.
const RANGE_M: (f64, f64) = (3.0, 20.0);

/// A line as rays of the camera.
#[derive(Debug, Clone, PartialEq)]
struct RayLine {
    /// What it is; without points.
    line: SeenLine,
    rays: Vec<Vector3<f64>>,
}

/// Lines of frames in pixels, by stamp.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixels {
    /// The camera as the log has it.
    pub camera: Camera,
    frames: BTreeMap<i64, Vec<RayLine>>,
}

impl Pixels {
    /// No frames of a camera yet.
    #[must_use]
    pub fn new(camera: Camera) -> Self {
        Self {
            camera,
            frames: BTreeMap::new(),
        }
    }

    /// Adds the lane markings of a frame.
    pub fn add(&mut self, frame: &Stamped<DetectionFrame>) {
        let ray = |&[u, v, _]: &[f64; 3]| self.camera.ray([u, v]);
        let lines = lane_markings(&frame.value).map(|(detection, of)| RayLine {
            line: SeenLine {
                detection,
                marking: of.marking,
                color: of.color,
                points_m: Vec::new(),
            },
            rays: of.points.iter().filter_map(ray).collect(),
        });
        let lines = lines.collect();
        self.frames.insert(frame.stamp_ns, lines);
    }

    /// The camera as the log has it, over the road around all looks.
    #[must_use]
    pub fn cast_on(&self, heights: Option<&Heights>, looks: &[Look]) -> Casting {
        let poses = looks.iter().map(|look| &look.pose);
        let surfaces = heights.map(|heights| {
            let surfaces = poses.map(|pose| (pose.stamp_ns, heights.around(pose)));
            surfaces.collect()
        });
        Casting {
            camera: self.camera.clone(),
            surfaces: surfaces.unwrap_or_default(),
        }
    }

    /// The lines of a frame as `camera`, which may be mounted otherwise, sees them on the road.
    #[must_use]
    pub fn lines(&self, stamp_ns: i64, camera: &Camera, surface: &Surface) -> Vec<SeenLine> {
        let lines = self.frames.get(&stamp_ns).into_iter().flatten();
        let laid = lines.filter_map(|RayLine { line, rays }| {
            let road = rays.iter().filter_map(|ray| road(camera, *ray, surface));
            line.through(road)
        });
        laid.collect()
    }
}

/// A camera where it really is, and the road that it looks at.
#[derive(Debug, Clone, PartialEq)]
pub struct Casting {
    /// The camera.
    pub camera: Camera,
    /// The road around each look, by stamp; flat where it is not known.
    pub surfaces: BTreeMap<i64, Surface>,
}

impl Casting {
    /// Casts the lines of all looks anew.
    pub fn cast(&self, pixels: &Pixels, looks: &mut [Look]) {
        for look in looks {
            let stamp_ns = look.pose.stamp_ns;
            look.lines = pixels.lines(stamp_ns, &self.camera, self.surface(stamp_ns));
        }
    }

    /// Where a pixel of a frame shows the road (x forward, y left, metres), within the trusted
    /// range.
    #[must_use]
    pub fn road_from_pixel(&self, stamp_ns: i64, pixel: [f64; 2]) -> Option<[f64; 2]> {
        road(
            &self.camera,
            self.camera.ray(pixel)?,
            self.surface(stamp_ns),
        )
    }

    /// The road around a look.
    pub(crate) fn surface(&self, stamp_ns: i64) -> &Surface {
        self.surfaces.get(&stamp_ns).unwrap_or(&Surface::FLAT)
    }
}

/// Where a ray meets the road (x forward, y left, metres), within the trusted range.
fn road(camera: &Camera, ray: Vector3<f64>, surface: &Surface) -> Option<[f64; 2]> {
    let [x, y, _] = camera.road_from_ray(ray, surface)?;
    (RANGE_M.0 <= x && x <= RANGE_M.1).then_some([x, y])
}
