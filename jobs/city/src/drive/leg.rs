//! One leg of a drive: its motion without a break, and what the sensors say of it.
//!
//! Every sensor has a rate, a phase and a latency of its own: stamps do not fall together, and
//! messages are in the order in which they were recorded.

use tilefold_formats::log_write::Dialect;
use tilefold_schemas::log::{
    DetectionFrame, DetectionSpace, FramePose, GnssFix, Imu, Payload, Quaternion,
};
use tilefold_tiler::geodesy::LocalFrame;

use super::{DETECTIONS_TOPIC, Drive, MS, Match, stream};
use crate::course::{Course, Motion};
use crate::detector::{Detector, Lots};
use crate::inertial::Inertial;
use crate::mounting::clock_offset_s;
use crate::noise::Noise;
use crate::pictures::{CAMERA_FRAME, Mounted, Pictures};
use crate::random::Random;
use crate::receiver::Receiver;
use crate::spec::LogProfile;
use crate::traffic::Traffic;

/// Pictures per second, and how many there are for each message about the camera.
const PICTURES_HZ: f64 = 5.0;
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

    /// All messages in the order in which they were recorded.
    pub(super) fn records(&self, dialect: Dialect, matches: &mut Vec<Match>) -> Vec<Record> {
        let mut records = self.fixes();
        records.extend(self.headings(dialect));
        match self.drive.city.spec.profile {
            LogProfile::Detections => records.extend(self.frames(matches)),
            LogProfile::Camera => records.extend(self.camera()),
        }
        records.sort_by_key(|record| (record.log_time_ns, record.topic));
        records
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
    fn camera(&self) -> Vec<Record> {
        let clock = Clock::new(PICTURES_HZ, Clock::CAMERA_PHASE_NS, 45 * MS);
        let late_s = clock_offset_s(&self.noise.clock, &mut self.drive.random("clock"));
        let mut records = Vec::new();
        for (index, (stamp_ns, seconds)) in self.ticks(clock).enumerate() {
            if index == 0 && self.number == 0 {
                let transform = self.mounted.transform();
                records.push(record(
                    "/tf_static",
                    CAMERA_FRAME,
                    stamp_ns,
                    clock,
                    transform,
                ));
            }
            if index % CALIBRATION_EVERY == 0 {
                let said = self.mounted.calibration();
                records.push(record(
                    "/camera/camera_info",
                    CAMERA_FRAME,
                    stamp_ns,
                    clock,
                    said,
                ));
            }
            records.push(Record {
                topic: "/camera/image/compressed",
                frame_id: CAMERA_FRAME,
                stamp_ns,
                log_time_ns: stamp_ns + clock.latency_ns,
                content: Content::Picture {
                    seconds: seconds - late_s,
                },
            });
        }
        records
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

    fn fixes(&self) -> Vec<Record> {
        let clock = Clock::new(self.noise.gnss.rate_hz, Clock::GNSS_PHASE_NS, 60 * MS);
        let mut receiver = Receiver::draw(&self.noise.gnss, self.random("position"));
        let city = self.drive.city;
        let mut last = None;
        self.ticks(clock)
            .map(|(stamp_ns, seconds)| {
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
                record("/gnss/fix", "base_link", stamp_ns, clock, payload)
            })
            .collect()
    }

    fn headings(&self, dialect: Dialect) -> Vec<Record> {
        let clock = Clock::new(self.noise.imu.rate_hz, Clock::HEADING_PHASE_NS, 3 * MS);
        let mut inertial = Inertial::draw(&self.noise.imu, self.random("heading"));
        let yaw_variance_rad2 = self.noise.imu.claimed_yaw_deg.to_radians().powi(2);
        self.ticks(clock)
            .map(|(stamp_ns, seconds)| {
                let motion = self.course.motion(seconds);
                let yaw_rad = self.true_yaw_rad(&motion) + inertial.yaw_error_rad(clock.period_s());
                let rate_rad_s = motion.yaw_rate_rad_s + inertial.yaw_rate_error_rad_s();
                let orientation = about_up(yaw_rad);
                let (topic, frame_id, payload) = match dialect {
                    Dialect::Ros2 => {
                        let imu = imu(orientation, yaw_variance_rad2, rate_rad_s);
                        ("/imu", "base_link", imu)
                    }
                    Dialect::Foxglove => ("/heading", "enu", pose(orientation)),
                };
                record(topic, frame_id, stamp_ns, clock, payload)
            })
            .collect()
    }

    fn frames(&self, matches: &mut Vec<Match>) -> Vec<Record> {
        let rate_hz = self.noise.detector.view.rate_hz;
        let clock = Clock::new(rate_hz, Clock::CAMERA_PHASE_NS, 45 * MS);
        let Drive { city, .. } = self.drive;
        let lots = Lots {
            drive: &|name| self.random(name),
            vehicle: Random::new(city.spec.seed, "mounting", self.drive.vehicle()),
        };
        let mut detector = Detector::new(city, self.noise, self.course, lots);
        let late_s = clock_offset_s(&self.noise.clock, &mut self.drive.random("clock"));
        let mut frames = Vec::new();
        for (stamp_ns, seconds) in self.ticks(clock) {
            let motion = self.course.motion(seconds - late_s);
            let around = self.traffic.at(seconds - late_s);
            let seen = detector.look(&motion, &around, stamp_ns, clock.period_s());
            for (detection, seen) in seen.iter().enumerate() {
                matches.extend(seen.parts.iter().map(|&part| Match {
                    stamp_ns,
                    detection,
                    part,
                }));
            }
            let payload = Payload::Detections(DetectionFrame {
                space: DetectionSpace::Metres,
                detections: seen.into_iter().map(|seen| seen.detection).collect(),
            });
            frames.push(record(
                DETECTIONS_TOPIC,
                "base_link",
                stamp_ns,
                clock,
                payload,
            ));
        }
        frames
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

fn pose(orientation: Quaternion) -> Payload {
    Payload::Pose(FramePose {
        position_m: [0.0; 3],
        orientation,
    })
}

/// A turn to the left about the up axis.
fn about_up(yaw_rad: f64) -> Quaternion {
    let (sin, cos) = (yaw_rad / 2.0).sin_cos();
    [0.0, 0.0, sin, cos]
}
