//! One leg of a drive: its motion without a break, and what the sensors say of it.
//!
//! Every sensor has a rate, a phase and a latency of its own: stamps do not fall together, and
//! messages are in the order in which they were recorded.

use tilefold_formats::log_write::Dialect;
use tilefold_schemas::log::{
    DetectionFrame, DetectionSpace, FramePose, GnssFix, Imu, Odometry, Payload, Quaternion,
    Transform,
};
use tilefold_tiler::geodesy::LocalFrame;

use super::in_order::{InOrder, Sensor};
use super::{DETECTIONS_TOPIC, Drive, MS, Match, stream};
use crate::course::{Course, Motion};
use crate::detector::{Detector, Lots};
use crate::inertial::{Inertial, Wheels};
use crate::mounting::clock_offset_s;
use crate::noise::Noise;
use crate::odometer::{Odometer, about_up};
use crate::pictures::{CAMERA_FRAME, Mounted, Pictures, VEHICLE_FRAME};
use crate::random::Random;
use crate::receiver::Receiver;
use crate::spec::LogProfile;
use crate::traffic::Traffic;

/// Where odometry begins; drifts (REP 105).
const ODOMETRY_FRAME: &str = "odom";
/// Pictures for each message about the camera.
const CALIBRATION_EVERY: usize = 5;

/// When a sensor speaks, in nanoseconds: from its phase on, every period, recorded after its
/// latency.
#[derive(Clone, Copy)]
struct Clock {
    phase_ns: i64,
    period_ns: i64,
    latency_ns: i64,
}

impl Clock {
    const GNSS_PHASE_NS: i64 = 35 * MS;
    const HEADING_PHASE_NS: i64 = 10 * MS;
    const WHEEL_PHASE_NS: i64 = 20 * MS;
    const CAMERA_PHASE_NS: i64 = 500 * MS;

    fn new(rate_hz: f64, phase_ns: i64, latency_ns: i64) -> Self {
        Self {
            phase_ns,
            period_ns: ((1e9 / rate_hz) as i64).max(MS),
            latency_ns,
        }
    }

    fn period_s(self) -> f64 {
        self.period_ns as f64 * 1e-9
    }
}

/// A message before it is written.
pub(super) struct Record {
    pub(super) topic: &'static str,
    pub(super) frame_id: &'static str,
    pub(super) stamp_ns: i64,
    pub(super) log_time_ns: i64,
    pub(super) content: Content,
}

/// What a message holds.
pub(super) enum Content {
    Said(Payload),
    /// A picture, taken when its turn comes: a drive's pictures do not fit into memory.
    Picture {
        seconds: f64,
    },
}

/// A leg whose motion is drawn.
pub(super) struct Leg<'a> {
    drive: &'a Drive<'a>,
    number: usize,
    noise: &'a Noise,
    course: &'a Course,
    traffic: Traffic<'a>,
    mounted: Mounted,
    start_ns: i64,
}

impl<'a> Leg<'a> {
    /// The leg of this number, counted from 0, that begins at a time.
    pub(super) fn new(
        drive: &'a Drive<'a>,
        number: usize,
        course: &'a Course,
        start_ns: i64,
    ) -> Self {
        let city = drive.city;
        let noise = city.noise.of(drive.vehicle());
        let mut camera = Random::new(city.spec.seed, "camera", drive.vehicle());
        let mut lots = drive.random(&stream("traffic", number));
        Self {
            drive,
            number,
            noise,
            course,
            traffic: Traffic::draw(&noise.detector.traffic, &city.ground, course, &mut lots),
            mounted: Mounted::draw(noise, &mut camera),
            start_ns,
        }
    }

    /// A stream of lots of this leg's own.
    fn random(&self, name: &str) -> Random {
        self.drive.random(&stream(name, self.number))
    }

    /// All messages in the order in which they were recorded, made as they are asked for.
    pub(super) fn records<'b>(
        &'b self,
        dialect: Dialect,
        matches: &'b mut Vec<Match>,
    ) -> InOrder<'b> {
        let seen = match self.drive.city.spec.profile {
            LogProfile::Detections => self.frames(matches),
            LogProfile::Camera => self.camera(),
        };
        InOrder::new([self.fixes(), self.headings(dialect), self.odometry(), seen])
    }

    /// The camera at work, if logs hold pictures.
    pub(super) fn pictures(&self) -> Option<Pictures<'_>> {
        let renderer = self.drive.city.renderer.as_ref()?;
        let lots = (self.drive.random("conditions"), self.random("body"));
        let seed = self.drive.city.spec.seed ^ u64::from(self.drive.index) << 32;
        let way = (self.course, &self.traffic);
        Some(Pictures::new(
            renderer,
            way,
            (&self.mounted, self.noise),
            lots,
            seed,
        ))
    }

    /// Pictures to be taken, and what is said of the camera.
    fn camera(&self) -> Sensor<'_> {
        let clock = Clock::new(self.noise.camera.rate_hz, Clock::CAMERA_PHASE_NS, 45 * MS);
        let late_s = clock_offset_s(&self.noise.clock, &mut self.drive.random("clock"));
        let of_camera =
            move |topic, stamp_ns, said| record(topic, CAMERA_FRAME, stamp_ns, clock, said);
        let ticks = self.ticks(clock).enumerate();
        Box::new(ticks.flat_map(move |(index, (stamp_ns, seconds))| {
            let calibration = (index % CALIBRATION_EVERY == 0).then(|| {
                let said = self.mounted.calibration();
                of_camera("/camera/camera_info", stamp_ns, said)
            });
            let picture = Record {
                topic: "/camera/image/compressed",
                frame_id: CAMERA_FRAME,
                stamp_ns,
                log_time_ns: stamp_ns + clock.latency_ns,
                content: Content::Picture {
                    seconds: seconds - late_s,
                },
            };
            let is_first = index == 0 && self.number == 0;
            let mounting =
                is_first.then(|| of_camera("/tf_static", stamp_ns, self.mounted.transform()));
            calibration.into_iter().chain([picture]).chain(mounting)
        }))
    }

    /// Stamps of a sensor with the seconds since the leg's begin.
    fn ticks(&self, clock: Clock) -> impl Iterator<Item = (i64, f64)> + use<> {
        let start_ns = self.start_ns;
        // Positions go on behind the last frame, as they begin before the first.
        let end_ns = (self.course.seconds() * 1e9) as i64 - clock.phase_ns;
        (0..)
            .map(move |tick| clock.phase_ns + tick * clock.period_ns)
            .take_while(move |since_ns| *since_ns < end_ns)
            .map(move |since_ns| (start_ns + since_ns, since_ns as f64 * 1e-9))
    }

    fn fixes(&self) -> Sensor<'_> {
        let clock = Clock::new(self.noise.gnss.rate_hz, Clock::GNSS_PHASE_NS, 60 * MS);
        let mut receiver = Receiver::draw(&self.noise.gnss, self.random("position"));
        let city = self.drive.city;
        let mut last = None;
        Box::new(self.ticks(clock).map(move |(stamp_ns, seconds)| {
            let here = self.course.motion(seconds).place;
            let closeness = city.ground.closeness([here.east_m, here.north_m]);
            let error = receiver.next_fix(clock.period_s(), closeness);
            let motion = self.course.motion(seconds - error.delay_s);
            let [east_m, north_m, up_m] = error.error_m;
            let [longitude_deg, latitude_deg, altitude_m] = city.world.on_earth([
                motion.place.east_m + east_m,
                motion.place.north_m + north_m,
                motion.up_m + up_m,
            ]);
            let fix = Payload::Gnss(GnssFix {
                latitude_deg,
                longitude_deg,
                altitude_m,
                covariance_enu_m2: Some(receiver.claimed_covariance_m2()),
                has_fix: error.has_fix,
            });
            let payload = last.take().filter(|_| error.is_repeated).unwrap_or(fix);
            last = Some(payload.clone());
            record("/gnss/fix", VEHICLE_FRAME, stamp_ns, clock, payload)
        }))
    }

    fn headings(&self, dialect: Dialect) -> Sensor<'_> {
        let clock = Clock::new(self.noise.imu.rate_hz, Clock::HEADING_PHASE_NS, 3 * MS);
        let mut inertial = Inertial::draw(&self.noise.imu, self.random("heading"));
        let yaw_variance_rad2 = self.noise.imu.claimed_yaw_deg.to_radians().powi(2);
        Box::new(self.ticks(clock).map(move |(stamp_ns, seconds)| {
            let motion = self.course.motion(seconds);
            let yaw_rad = self.true_yaw_rad(&motion) + inertial.yaw_error_rad(clock.period_s());
            let rate_rad_s = motion.yaw_rate_rad_s + inertial.yaw_rate_error_rad_s();
            let orientation = about_up(yaw_rad);
            let (topic, frame_id, payload) = match dialect {
                Dialect::Ros2 => {
                    let imu = imu(orientation, yaw_variance_rad2, rate_rad_s);
                    ("/imu", VEHICLE_FRAME, imu)
                }
                Dialect::Foxglove => ("/heading", "enu", pose(orientation)),
            };
            record(topic, frame_id, stamp_ns, clock, payload)
        }))
    }

    /// What the wheels say, if they say anything; where a log has a tree of frames, also as its
    /// root: `odom` -> `base_link`.
    fn odometry(&self) -> Sensor<'_> {
        let noise = &self.noise.wheel;
        if noise.rate_hz == 0.0 {
            return Box::new(std::iter::empty());
        }
        let clock = Clock::new(noise.rate_hz, Clock::WHEEL_PHASE_NS, 5 * MS);
        let Drive { city, .. } = self.drive;
        let mut vehicle = Random::new(city.spec.seed, "wheels of a vehicle", self.drive.vehicle());
        let wheels = Wheels::draw(noise, &mut vehicle, self.random("wheels"));
        let gyro = Inertial::draw(&self.noise.imu, self.random("gyro beside the wheels"));
        let mut odometer = Odometer::new(wheels, gyro);
        let has_tree = city.spec.profile == LogProfile::Camera;
        Box::new(self.ticks(clock).flat_map(move |(stamp_ns, seconds)| {
            let measured = odometer.measure(self.course, seconds, clock.period_s());
            let said = |topic, said| record(topic, ODOMETRY_FRAME, stamp_ns, clock, said);
            let in_tree = has_tree.then(|| said("/tf", vehicle_in_odometry(&measured)));
            [said("/odom", Payload::Odometry(measured))]
                .into_iter()
                .chain(in_tree)
        }))
    }

    fn frames<'b>(&'b self, matches: &'b mut Vec<Match>) -> Sensor<'b> {
        let rate_hz = self.noise.detector.view.rate_hz;
        let clock = Clock::new(rate_hz, Clock::CAMERA_PHASE_NS, 45 * MS);
        let Drive { city, .. } = self.drive;
        let lots = Lots {
            drive: &|name| self.random(name),
            vehicle: Random::new(city.spec.seed, "mounting", self.drive.vehicle()),
        };
        let mut detector = Detector::new(city, self.noise, self.course, lots);
        let late_s = clock_offset_s(&self.noise.clock, &mut self.drive.random("clock"));
        Box::new(self.ticks(clock).map(move |(stamp_ns, seconds)| {
            let motion = self.course.motion(seconds - late_s);
            let around = self.traffic.at(seconds - late_s);
            let seen = detector.look(&motion, &around, stamp_ns, clock.period_s());
            if city.spec.matching_truth {
                for (detection, seen) in seen.iter().enumerate() {
                    matches.extend(seen.parts.iter().map(|&part| Match {
                        stamp_ns,
                        detection,
                        part,
                    }));
                }
            }
            let payload = Payload::Detections(DetectionFrame {
                space: DetectionSpace::Metres,
                detections: seen.into_iter().map(|seen| seen.detection).collect(),
            });
            record(DETECTIONS_TOPIC, VEHICLE_FRAME, stamp_ns, clock, payload)
        }))
    }

    /// A yaw of the city's plane as one against true north where the vehicle is.
    fn true_yaw_rad(&self, motion: &Motion) -> f64 {
        let world = self.drive.city.world;
        let place = &motion.place;
        let here = LocalFrame::new(world.on_earth([place.east_m, place.north_m, 0.0]));
        world.frame.yaw_in(&here, place.yaw_rad)
    }
}

fn record(
    topic: &'static str,
    frame_id: &'static str,
    stamp_ns: i64,
    clock: Clock,
    payload: Payload,
) -> Record {
    Record {
        topic,
        frame_id,
        stamp_ns,
        log_time_ns: stamp_ns + clock.latency_ns,
        content: Content::Said(payload),
    }
}

fn imu(orientation: Quaternion, yaw_variance_rad2: f64, yaw_rate_rad_s: f64) -> Payload {
    Payload::Imu(Imu {
        orientation: Some(orientation),
        yaw_variance_rad2: Some(yaw_variance_rad2),
        angular_velocity_rad_s: Some([0.0, 0.0, yaw_rate_rad_s]),
    })
}

fn vehicle_in_odometry(odometry: &Odometry) -> Payload {
    Payload::Transforms {
        transforms: vec![Transform {
            parent_frame: ODOMETRY_FRAME.to_owned(),
            child_frame: VEHICLE_FRAME.to_owned(),
            translation_m: odometry.pose.position_m,
            rotation: odometry.pose.orientation,
        }],
        is_static: false,
    }
}

fn pose(orientation: Quaternion) -> Payload {
    Payload::Pose(FramePose {
        position_m: [0.0; 3],
        orientation,
    })
}
