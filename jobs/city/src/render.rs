//! The camera profile: pictures of a world as a vehicle's camera takes them, and the truth about
//! each.
//!
//! A [`Renderer`] holds what is the same in every picture of a world. A picture goes this way:
//! `camera` and `eye` (where pixels look, row by row) -> `terrain`, `field` (the ground that they
//! meet) -> `layout`, `marks`, `glyph`, `repairs` (what lies on it) and `stand`, `solids`,
//! `roadside`, `traffic` (what stands on it) -> `sky`, `light`, `shadow`, `ground` (how it is lit) ->
//! `picture` (light of every pixel) -> `develop` (lens, shutter, sensor: bytes) and `truth`.
//!
//! Frames: the world's plane in double precision outside; inside, single precision in a local frame
//! whose origin is a corner of the ground's tiles near the vehicle. All lots are hashes of places and
//! seeds: the same shot gives the same bytes with any number of threads.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use jpeg_encoder::{ColorType, Encoder, EncodingError};
use nalgebra::Isometry3;

use crate::world::{Point, World};

mod buckets;
mod camera;
mod cells;
mod conditions;
mod develop;
mod eye;
mod field;
mod glyph;
mod ground;
mod layout;
mod light;
mod marks;
mod noise;
mod picture;
mod repairs;
mod roadside;
mod shadow;
mod sky;
mod solids;
mod stand;
mod terrain;
mod traffic;
mod truth;
mod vector;

pub use camera::{Camera, Lens, mounting};
pub use conditions::{Category, Conditions};
pub use traffic::TrafficVehicle;
pub use truth::{FrameTruth, PaintTruth, VehicleTruth};

use buckets::Buckets;
use develop::SunImage;
use eye::{Pose, Rays, Way};
use field::Field;
use glyph::Glyph;
use ground::{GroundPicture, Textures};
use layout::LayoutSource;
use light::{Light, VehicleFrame};
use noise::{REPEAT_M, Texture, hash};
use picture::{Film, Picture};
use repairs::Repairs;
use roadside::Roadside;
use shadow::Shadows;
use sky::Sky;
use solids::{Solid, Surroundings};
use stand::{Squares, Standing};
use terrain::{TILES_M, Terrain};
use truth::Witness;
use vector::{V2, V3, v2, v3};

/// Cameras whose rays are kept.
const CAMERAS: usize = 8;

/// A moment in which a picture is taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot<'a> {
    /// When the first row's exposure begins, in nanoseconds of the Unix epoch.
    pub time_ns: i64,
    /// The vehicle's pose, with roll and pitch, when the first row's exposure begins and when the
    /// last row's ends: `conditions.exposure_s` plus the camera's `readout_s` later. Its origin is on
    /// the ground; metres in the city's plane and up.
    pub map_from_vehicle: [Isometry3<f64>; 2],
    /// Light and weather.
    pub conditions: Conditions,
    /// Other vehicles.
    pub traffic: &'a [TrafficVehicle],
}

/// A picture and the truth about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// Red, green and blue (sRGB), row by row from the top.
    pub rgb: Vec<u8>,
    /// What is in it.
    pub truth: FrameTruth,
}

/// A picture that could not be written as JPEG.
#[derive(Debug, thiserror::Error)]
#[error(
    "a picture of {width_px} x {height_px} pixels cannot be written as JPEG: {source}; JPEG holds up to 65,535 pixels a side"
)]
pub struct JpegError {
    width_px: u32,
    height_px: u32,
    source: EncodingError,
}

impl Frame {
    /// The picture as a JPEG file; `quality` is 1 to 100.
    ///
    /// # Errors
    /// If it is larger than JPEG can hold.
    pub fn jpeg(&self, quality: u8) -> Result<Vec<u8>, JpegError> {
        let mut bytes = Vec::new();
        let [width, height] = [self.width_px, self.height_px].map(|px| px.min(65_535) as u16);
        let encoder = Encoder::new(&mut bytes, quality.clamp(1, 100));
        let encoded = encoder.encode(&self.rgb, width, height, ColorType::Rgb);
        encoded.map_err(|source| JpegError {
            width_px: self.width_px,
            height_px: self.height_px,
            source,
        })?;
        Ok(bytes)
    }
}

/// Takes pictures of a world.
pub struct Renderer<'a> {
    world: &'a World,
    terrain: Terrain,
    standing: Standing,
    repairs: Repairs,
    paint: Buckets,
    textures: Textures,
    glyphs: Vec<Glyph>,
    rays: Mutex<VecDeque<(Camera, Arc<Rays>)>>,
}

impl<'a> Renderer<'a> {
    /// A renderer of a world.
    #[must_use]
    pub fn new(world: &'a World) -> Self {
        let roadside = Roadside::new(world);
        Self {
            world,
            terrain: Terrain::new(world, roadside.lamps.clone()),
            standing: Standing::new(world, roadside),
            repairs: Repairs::new(world),
            paint: layout::paint_buckets(world),
            textures: Textures::new(),
            glyphs: Glyph::all(),
            rays: Mutex::default(),
        }
    }

    /// Takes a picture. The same arguments give the same bytes, whatever was taken before and
    /// however many threads there are. Pictures of no pixels are empty.
    #[must_use]
    pub fn render(&self, camera: &Camera, shot: &Shot, seed: u64) -> Frame {
        let (width_px, height_px) = (camera.width_px, camera.height_px);
        let truth = FrameTruth {
            time_ns: shot.time_ns,
            width_px,
            height_px,
            category: shot.conditions.category.name(),
            paint: Vec::new(),
            vehicles: Vec::new(),
        };
        let mut frame = Frame {
            width_px,
            height_px,
            rgb: Vec::new(),
            truth,
        };
        // A pixel's size comes from its neighbours.
        if width_px >= 2 && height_px >= 2 {
            self.take(camera, shot, seed, &mut frame);
        }
        frame
    }

    fn take(&self, camera: &Camera, shot: &Shot, seed: u64, frame: &mut Frame) {
        let stage = Stage::new(camera, shot);
        let rays = self.rays(camera);
        let middle = stage.way.pose(f64::from(camera.height_px) / 2.0, 0.5);
        let field = Field::new(&self.terrain, stage.origin, &middle, rays.widest_cos());
        let seed = hash(seed as i32, (seed >> 32) as i32, 5);
        let mut solids = self.solids(shot, &stage);
        let light = stage.light(shot, seed);
        let eye = middle.at.flat();
        let is_sunny = light.sky.sunlight.luma() > 0.0;
        let shadows = Shadows::new(&solids, is_sunny.then_some(light.sky.to_sun), eye);
        shade(&mut solids, &shadows, &self.textures.blots);
        let source = LayoutSource {
            world: self.world,
            paint: &self.paint,
            repairs: &self.repairs,
        };
        let layout = source.lay(
            shot.time_ns,
            stage.eye(&middle),
            stage.origin,
            camera.k[0] as f32,
        );
        let wet = shot.conditions.wet as f32;
        let picture = Picture {
            way: &stage.way,
            rays: &rays,
            field: &field,
            ground: GroundPicture {
                textures: &self.textures,
                glyphs: &self.glyphs,
                layout: &layout,
                shadows: &shadows,
                light: &light,
                anchor: stage.anchor(),
                wet,
            },
            squares: &Squares::new(&solids, &stage.way, &rays),
            mirrored: &picture::mirrored(&solids, wet),
            solids: &solids,
            around: Surroundings {
                noise: &self.textures.blots,
                lamps: shot.conditions.lamps,
                night: is_night(&shot.conditions),
            },
            haze_per_m: shot.conditions.haze_per_m as f32,
            seed,
        };
        let film = picture.take();
        self.testify(
            &stage,
            &rays,
            &field,
            &film,
            &solids,
            shot,
            &mut frame.truth,
        );
        let sun = is_sunny
            .then(|| stage.sun(&light, &middle, &rays))
            .flatten();
        frame.rgb = develop::develop(film, &shot.conditions, sun, seed);
    }

    #[expect(clippy::too_many_arguments, reason = "all parts of one picture")]
    fn testify(
        &self,
        stage: &Stage,
        rays: &Rays,
        field: &Field,
        film: &Film,
        solids: &[Solid],
        shot: &Shot,
        truth: &mut FrameTruth,
    ) {
        let witness = Witness {
            way: &stage.way,
            rays,
            field,
            film,
            origin: stage.origin,
        };
        let at = shot.map_from_vehicle[0].translation.vector;
        let near = self.paint.near([at.x, at.y], layout::REACH_M).into_iter();
        let there = near
            .map(|index| &self.world.paint[index as usize])
            .filter(|paint| paint.is_there(shot.time_ns));
        truth.paint = there.filter_map(|paint| witness.paint(paint)).collect();
        truth.paint.sort_by_key(|paint| paint.id);
        truth.vehicles = witness.vehicles(solids);
    }

    fn solids(&self, shot: &Shot, stage: &Stage) -> Vec<Solid> {
        let at = shot.map_from_vehicle[0].translation.vector;
        self.standing.around(
            self.world,
            shot.traffic,
            [at.x, at.y, at.z],
            stage.origin,
            shot.conditions.trees,
        )
    }

    /// The camera's rays, kept from picture to picture.
    fn rays(&self, camera: &Camera) -> Arc<Rays> {
        let mut kept = self.rays.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, rays)) = kept.iter().find(|(known, _)| known == camera) {
            return Arc::clone(rays);
        }
        let rays = Arc::new(Rays::new(camera));
        kept.push_back((camera.clone(), Arc::clone(&rays)));
        if kept.len() > CAMERAS {
            kept.pop_front();
        }
        rays
    }
}

/// Whether lamps are the light that counts.
fn is_night(conditions: &Conditions) -> bool {
    conditions.lamps && conditions.sky < 0.1
}

/// What stands in a shadow is in the shade as a whole.
fn shade(solids: &mut [Solid], shadows: &Shadows, noise: &Texture) {
    for solid in solids.iter_mut().filter(|solid| solid.vehicle.is_some()) {
        // Beside its own shadow: a metre towards the light is above its roof.
        let beside = [
            solid.ahead,
            solid.ahead * -1.0,
            solid.ahead.left(),
            solid.ahead.left() * -1.0,
        ];
        let reach = solid.size.flat().norm() * 0.6;
        let lit = beside.map(|way| shadows.sun(solid.foot.flat() + way * reach, 0.5, noise));
        solid.in_sun = lit.into_iter().fold(0.0, f32::max);
    }
}

/// Where a picture is taken: its local frame and the camera's way in it.
struct Stage<'a> {
    origin: Point,
    way: Way<'a>,
}

impl<'a> Stage<'a> {
    fn new(camera: &'a Camera, shot: &Shot) -> Self {
        let at = shot.map_from_vehicle[0].translation.vector;
        // A corner of the far tiles, and so of the near ones.
        let corner = |metres: f64| (metres / TILES_M[1]).floor() * TILES_M[1];
        let origin = [corner(at.x), corner(at.y), at.z.round()];
        let local = shot.map_from_vehicle.map(|mut pose| {
            pose.translation.vector -= nalgebra::Vector3::from(origin);
            pose
        });
        Self {
            origin,
            way: Way {
                camera,
                local_from_vehicle: local,
                exposure_s: shot.conditions.exposure_s.max(0.0),
            },
        }
    }

    /// The camera's place in the city's plane.
    fn eye(&self, pose: &Pose) -> Point {
        let local = [pose.at.x, pose.at.y, pose.at.z];
        [0, 1, 2].map(|axis| self.origin[axis] + f64::from(local[axis]))
    }

    /// The origin's place within the textures.
    fn anchor(&self) -> V2 {
        let [east, north] = [0, 1].map(|axis| self.origin[axis].rem_euclid(REPEAT_M) as f32);
        v2(east, north)
    }

    fn light(&self, shot: &Shot, seed: u32) -> Light {
        let drift = v2((seed & 0xFF) as f32, (seed >> 8 & 0xFF) as f32);
        let vehicle = &self.way.local_from_vehicle[0];
        let single =
            |vector: nalgebra::Vector3<f64>| v3(vector.x as f32, vector.y as f32, vector.z as f32);
        let axis = |axis: nalgebra::Vector3<f64>| single(vehicle.rotation * axis);
        Light {
            sky: Sky::new(&shot.conditions, drift),
            lamps: shot.conditions.lamps,
            vehicle: VehicleFrame {
                at: single(vehicle.translation.vector),
                ahead: axis(nalgebra::Vector3::x()),
                left: axis(nalgebra::Vector3::y()),
                up: axis(nalgebra::Vector3::z()),
            },
        }
    }

    /// Where the sun is in the picture, or would be; none if it is behind.
    fn sun(&self, light: &Light, pose: &Pose, rays: &Rays) -> Option<SunImage> {
        let V3 { x, y, z } = pose.turn_back(light.sky.to_sun);
        let direction = [x, y, z].map(f64::from);
        let [u, v] = self.way.camera.pixel_within(direction, rays.limit)?;
        Some(SunImage {
            pixel: v2(u as f32, v as f32),
            light: light.sky.sunlight,
        })
    }
}
