//! The camera of one drive: which camera its vehicle has, and the pictures that it takes.
//!
//! A vehicle keeps its camera: one of a few lens models, mounted at a height of its own, and a little
//! otherwise than its calibration says. Light and weather are those of the drive.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use tilefold_schemas::log::{CameraCalibration, CameraFrame, EncodedImage, Payload, Transform};

use crate::course::{Course, Motion};
use crate::error::CityError;
use crate::mounting::{Body, Misalignment};
use crate::noise::Noise;
use crate::random::Random;
use crate::render::mounting;
use crate::render::{
    Camera, Category, Conditions, FrameTruth, Lens, Renderer, Shot, TrafficVehicle,
};
use crate::traffic::{Traffic, Vehicle};

/// Size of the pictures.
const SIZE_PX: [u32; 2] = [640, 360];
/// Horizontal fields of view, in radians.
const VIEW_RAD: (f64, f64) = (0.95, 1.25);
/// Heights of cameras above the ground, in metres: cars, vans and lorries.
const HEIGHTS_M: [f64; 4] = [1.25, 1.45, 1.8, 2.4];
/// How far cameras look down, in radians.
const DOWN_RAD: (f64, f64) = (0.03, 0.09);
/// Seconds from the first row to the last.
const READOUT_S: (f64, f64) = (0.0, 0.02);
/// Quality of the JPEG files.
const QUALITY: u8 = 88;
/// The frames of the vehicle and of its camera.
pub(crate) const VEHICLE_FRAME: &str = "base_link";
pub(crate) const CAMERA_FRAME: &str = "camera_optical_frame";
/// How many drives are in which light and weather, cumulative.
const CATEGORIES: [(f64, Category); 8] = [
    (0.4, Category::Normal),
    (0.52, Category::Crowded),
    (0.6, Category::Glare),
    (0.68, Category::Backlight),
    (0.78, Category::Night),
    (0.87, Category::Rain),
    (0.96, Category::Shadow),
    (1.0, Category::Fog),
];
/// Reflectances of vehicles.
const PAINTS: [[f32; 3]; 6] = [
    [0.7, 0.7, 0.7],
    [0.05, 0.05, 0.06],
    [0.3, 0.32, 0.34],
    [0.45, 0.05, 0.04],
    [0.05, 0.1, 0.35],
    [0.1, 0.22, 0.12],
];

/// What the log says of the camera, and what it really is.
pub(crate) struct Mounted {
    stated: Camera,
    true_camera: Camera,
}

impl Mounted {
    /// The camera of a vehicle.
    pub(crate) fn draw(noise: &Noise, vehicle: &mut Random) -> Self {
        let view_rad = vehicle.between(VIEW_RAD.0, VIEW_RAD.1);
        let height_m = HEIGHTS_M[vehicle.index(HEIGHTS_M.len())];
        let down_rad = vehicle.between(DOWN_RAD.0, DOWN_RAD.1);
        let stated = Camera {
            lens: lens(vehicle),
            vehicle_from_camera: mounting([1.6, 0.0, height_m], [0.0, down_rad, 0.0]),
            readout_s: vehicle.between(READOUT_S.0, READOUT_S.1),
            ..Camera::ahead(SIZE_PX[0], SIZE_PX[1], view_rad)
        };
        let wrong = Misalignment::draw(&noise.mounting, vehicle);
        let [roll, pitch, yaw] = wrong.roll_pitch_yaw_rad;
        let [x_m, y_m, z_m] = wrong.position_m;
        let true_camera = Camera {
            vehicle_from_camera: mounting(
                [1.6 + x_m, y_m, height_m + z_m],
                [roll, down_rad + pitch, yaw],
            ),
            ..stated.clone()
        };
        Self {
            stated,
            true_camera,
        }
    }

    /// What a calibration topic says.
    pub(crate) fn calibration(&self) -> Payload {
        let [fx, fy, cx, cy] = self.stated.k;
        Payload::Calibration(CameraCalibration {
            width_px: self.stated.width_px,
            height_px: self.stated.height_px,
            distortion_model: self.stated.lens.name().to_owned(),
            d: self.stated.lens.coefficients(),
            k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        })
    }

    /// What `/tf_static` says.
    pub(crate) fn transform(&self) -> Payload {
        let at = self.stated.vehicle_from_camera;
        let turn = at.rotation.quaternion();
        Payload::Transforms {
            transforms: vec![Transform {
                parent_frame: VEHICLE_FRAME.to_owned(),
                child_frame: CAMERA_FRAME.to_owned(),
                translation_m: [at.translation.x, at.translation.y, at.translation.z],
                rotation: [turn.i, turn.j, turn.k, turn.w],
            }],
            is_static: true,
        }
    }
}

fn lens(vehicle: &mut Random) -> Lens {
    match vehicle.index(4) {
        0 => Lens::Pinhole,
        1 => Lens::PlumbBob([-0.28, 0.09, 0.0004, -0.0003, -0.012]),
        2 => Lens::RationalPolynomial([0.42, 0.11, 0.0002, 0.0003, 0.01, 0.75, 0.2, 0.03]),
        _ => Lens::KannalaBrandt([-0.012, 0.004, -0.003, 0.0006]),
    }
}

/// The camera of one leg at work.
pub(crate) struct Pictures<'a> {
    renderer: &'a Renderer<'a>,
    course: &'a Course,
    traffic: &'a Traffic<'a>,
    mounted: &'a Mounted,
    body: Body,
    category: Category,
    seed: u64,
    last_s: f64,
}

impl<'a> Pictures<'a> {
    pub(crate) fn new(
        renderer: &'a Renderer<'a>,
        (course, traffic): (&'a Course, &'a Traffic<'a>),
        (mounted, noise): (&'a Mounted, &Noise),
        (mut conditions, body): (Random, Random),
        seed: u64,
    ) -> Self {
        Self {
            renderer,
            course,
            traffic,
            mounted,
            body: Body::draw(&noise.mounting, body),
            category: category(&mut conditions),
            seed,
            last_s: 0.0,
        }
    }

    /// The picture whose first row is exposed `seconds` after the leg's begin, and what is in it.
    ///
    /// # Errors
    /// If it cannot be written as JPEG.
    pub(crate) fn take(
        &mut self,
        seconds: f64,
        time_ns: i64,
    ) -> Result<(Payload, FrameTruth), CityError> {
        let motion = self.course.motion(seconds);
        let leaning = self.body.roll_pitch_rad((seconds - self.last_s).max(1e-3));
        self.last_s = seconds;
        let conditions = Conditions::draw(self.category, motion.place.yaw_rad, self.seed);
        let camera = &self.mounted.true_camera;
        let end_s = seconds + conditions.exposure_s + camera.readout_s;
        let around = self.traffic.at(seconds);
        let traffic: Vec<TrafficVehicle> = around
            .iter()
            .map(|vehicle| drawn(vehicle, motion.speed_m_s))
            .collect();
        let shot = Shot {
            time_ns,
            map_from_vehicle: [
                pose(&motion, leaning),
                pose(&self.course.motion(end_s), leaning),
            ],
            conditions,
            traffic: &traffic,
        };
        let seed = self.seed.wrapping_add(time_ns.cast_unsigned());
        let frame = self.renderer.render(camera, &shot, seed);
        let image = EncodedImage {
            format: "jpeg".to_owned(),
            data: frame.jpeg(QUALITY)?.into(),
        };
        Ok((Payload::Image(CameraFrame::Encoded(image)), frame.truth))
    }
}

fn category(conditions: &mut Random) -> Category {
    let lot = conditions.unit();
    let found = CATEGORIES.iter().find(|(chance, _)| lot < *chance);
    found.map_or(Category::Normal, |(_, category)| *category)
}

/// Pose of a vehicle whose body leans by roll and pitch besides its motion's own.
fn pose(motion: &Motion, [roll_rad, pitch_rad]: [f64; 2]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(
        motion.roll_rad + roll_rad,
        motion.pitch_rad + pitch_rad - motion.slope_rad,
        motion.place.yaw_rad,
    );
    let at = Translation3::new(motion.place.east_m, motion.place.north_m, motion.up_m);
    Isometry3::from_parts(at, turn)
}

fn drawn(vehicle: &Vehicle, speed_m_s: f64) -> TrafficVehicle {
    let [east_m, north_m, up_m] = vehicle.at;
    TrafficVehicle {
        map_from_vehicle: Isometry3::from_parts(
            Translation3::new(east_m, north_m, up_m),
            UnitQuaternion::from_euler_angles(0.0, 0.0, vehicle.yaw_rad),
        ),
        size_m: vehicle.size_m,
        color: PAINTS[vehicle.number % PAINTS.len()],
        speed_m_s,
    }
}
