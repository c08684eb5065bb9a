//! One drive: its motion, what its sensors say of it, and the log they end in.
//!
//! Every sensor has a rate, a phase and a latency of its own: stamps do not fall together, and the
//! log is in the order in which messages were recorded.

use std::io::{Seek, Write};

use tilefold_formats::log_write::{Dialect, Entry, LogWriteError, LogWriter};
use tilefold_schemas::log::{
    DetectionFrame, DetectionSpace, FramePose, GnssFix, Imu, Payload, Quaternion,
};
use tilefold_tiler::geodesy::LocalFrame;

use crate::city::City;
use crate::course::{Course, Motion};
use crate::detector::{Detector, Lots};
use crate::random::Random;
use crate::receiver::{CLAIMED_COVARIANCE_M2, CLAIMED_YAW_VARIANCE_RAD2, Receiver};
use crate::route;
use crate::traffic::Traffic;

const MS: i64 = 1_000_000;
const DAY_NS: i64 = 86_400_000 * MS;

/// When a sensor speaks, in nanoseconds: from its phase on, every period, recorded after its
/// latency.
#[derive(Clone, Copy)]
struct Clock {
    phase_ns: i64,
    period_ns: i64,
    latency_ns: i64,
}

const GNSS: Clock = Clock {
    phase_ns: 35 * MS,
    period_ns: 200 * MS,
    latency_ns: 60 * MS,
};
const HEADING: Clock = Clock {
    phase_ns: 10 * MS,
    period_ns: 100 * MS,
    latency_ns: 3 * MS,
};
const CAMERA: Clock = Clock {
    phase_ns: 500 * MS,
    period_ns: 100 * MS,
    latency_ns: 45 * MS,
};

/// Which drive of a city.
pub(crate) struct Drive<'a> {
    pub(crate) city: &'a City<'a>,
    pub(crate) index: u32,
}

/// A message before it is written.
struct Record {
    topic: &'static str,
    frame_id: &'static str,
    stamp_ns: i64,
    log_time_ns: i64,
    payload: Payload,
}

/// Of which element a detection is.
pub(crate) struct Match {
    pub(crate) stamp_ns: i64,
    /// Which of its frame's detections, counted from 0.
    pub(crate) detection: usize,
    pub(crate) element: Option<i64>,
}

impl Drive<'_> {
    /// Writes the drive's log; drives take turns in ROS 2 and Foxglove messages. Returns the
    /// matching truth with the sink.
    pub(crate) fn write<W: Write + Seek>(&self, sink: W) -> Result<(W, Vec<Match>), LogWriteError> {
        let dialect = match self.index % 2 {
            0 => Dialect::Ros2,
            _ => Dialect::Foxglove,
        };
        let vehicle = format!("city-{:04}", self.vehicle());
        let site = format!("simulated city, seed {}", self.city.spec.seed);
        let mut log = LogWriter::create(sink, dialect, &vehicle, [("site", site.as_str())])?;
        let mut matches = Vec::new();
        for record in self.records(dialect, &mut matches) {
            log.write(Entry {
                topic: record.topic,
                stamp_ns: record.stamp_ns,
                log_time_ns: record.log_time_ns,
                frame_id: record.frame_id,
                payload: &record.payload,
            })?;
        }
        Ok((log.finish()?, matches))
    }

    fn vehicle(&self) -> u32 {
        self.index % self.city.spec.vehicles
    }

    fn random(&self, name: &str) -> Random {
        Random::new(self.city.spec.seed, name, self.index)
    }

    /// A vehicle's drives divide the campaign among them, so that it never drives twice at once.
    fn start_ns(&self, seconds: f64) -> i64 {
        let spec = self.city.spec;
        let rounds = spec.drives.div_ceil(spec.vehicles).max(1);
        let span_ns = i64::from(spec.days) * DAY_NS / i64::from(rounds);
        let first_ns = self.city.begin_ns + i64::from(self.index / spec.vehicles) * span_ns;
        let spare_ns = (span_ns - (seconds * 1e9) as i64).max(0);
        first_ns + (self.random("start").unit() * spare_ns as f64) as i64 / MS * MS
    }

    fn records(&self, dialect: Dialect, matches: &mut Vec<Match>) -> Vec<Record> {
        let length_m = self.city.spec.drive_km * 1_000.0;
        let steps = route::draw(self.city.world, length_m, &mut self.random("route"));
        if steps.len() < 10 {
            return Vec::new();
        }
        let course = Course::draw(steps, &mut self.random("course"));
        let start_ns = self.start_ns(course.seconds());
        let under_way = UnderWay {
            drive: self,
            course: &course,
            start_ns,
        };
        let mut records = under_way.fixes();
        records.extend(under_way.headings(dialect));
        records.extend(under_way.frames(matches));
        records.sort_by_key(|record| (record.log_time_ns, record.topic));
        records
    }
}

/// A drive whose motion is drawn.
struct UnderWay<'a> {
    drive: &'a Drive<'a>,
    course: &'a Course,
    start_ns: i64,
}

impl UnderWay<'_> {
    /// Stamps of a sensor with the seconds since the drive's begin.
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
        let mut receiver = Receiver::draw(self.drive.random("position"));
        let period_s = GNSS.period_ns as f64 * 1e-9;
        self.ticks(GNSS)
            .map(|(stamp_ns, seconds)| {
                let motion = self.course.motion(seconds);
                let [east_m, north_m, up_m] = receiver.position_error_m(period_s);
                let [longitude_deg, latitude_deg, altitude_m] = self.drive.city.world.on_earth([
                    motion.place.east_m + east_m,
                    motion.place.north_m + north_m,
                    motion.up_m + up_m,
                ]);
                let payload = Payload::Gnss(GnssFix {
                    latitude_deg,
                    longitude_deg,
                    altitude_m,
                    covariance_enu_m2: Some(CLAIMED_COVARIANCE_M2),
                    has_fix: true,
                });
                record("/gnss/fix", "base_link", stamp_ns, GNSS, payload)
            })
            .collect()
    }

    fn headings(&self, dialect: Dialect) -> Vec<Record> {
        let mut receiver = Receiver::draw(self.drive.random("heading"));
        self.ticks(HEADING)
            .map(|(stamp_ns, seconds)| {
                let motion = self.course.motion(seconds);
                let yaw_rad = self.true_yaw_rad(&motion) + receiver.yaw_error_rad();
                let rate_rad_s = motion.yaw_rate_rad_s + receiver.yaw_rate_error_rad_s();
                let orientation = about_up(yaw_rad);
                let (topic, frame_id, payload) = match dialect {
                    Dialect::Ros2 => ("/imu", "base_link", imu(orientation, rate_rad_s)),
                    Dialect::Foxglove => ("/heading", "enu", pose(orientation)),
                };
                record(topic, frame_id, stamp_ns, HEADING, payload)
            })
            .collect()
    }

    fn frames(&self, matches: &mut Vec<Match>) -> Vec<Record> {
        let Drive { city, .. } = self.drive;
        let noise = &city.spec.noise;
        let vehicle = self.drive.vehicle();
        let mut detector = Detector::new(
            city.world,
            &city.ground,
            (&noise.detector, &noise.mounting),
            self.course,
            Lots {
                drive: [self.drive.random("detector"), self.drive.random("phantoms")],
                vehicle: Random::new(city.spec.seed, "mounting", vehicle),
            },
        );
        let density = noise.detector.traffic_per_lane_km;
        let traffic = Traffic::draw(density, &mut self.drive.random("traffic"));
        let offset_s = self.drive.random("clock").normal(noise.clock.offset_s);
        let period_s = CAMERA.period_ns as f64 * 1e-9;
        self.ticks(CAMERA)
            .map(|(stamp_ns, seconds)| {
                let motion = self.course.motion(seconds - offset_s);
                let around = traffic.at(self.course, seconds);
                let seen = detector.look(&motion, &around, stamp_ns, period_s);
                let mut detections = Vec::with_capacity(seen.len());
                for (detection, seen) in seen.into_iter().enumerate() {
                    matches.push(Match {
                        stamp_ns,
                        detection,
                        element: seen.element,
                    });
                    detections.push(seen.detection);
                }
                let payload = Payload::Detections(DetectionFrame {
                    space: DetectionSpace::Metres,
                    detections,
                });
                record("/perception/lanes", "base_link", stamp_ns, CAMERA, payload)
            })
            .collect()
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
        payload,
    }
}

fn imu(orientation: Quaternion, yaw_rate_rad_s: f64) -> Payload {
    Payload::Imu(Imu {
        orientation: Some(orientation),
        yaw_variance_rad2: Some(CLAIMED_YAW_VARIANCE_RAD2),
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
