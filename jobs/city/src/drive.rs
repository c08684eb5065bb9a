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

use crate::course::Course;
use crate::curve::Place;
use crate::detector::Detector;
use crate::inertial::Inertial;
use crate::noise::Noise;
use crate::random::Random;
use crate::receiver::Receiver;
use crate::road::Street;
use crate::spec::CitySpec;
use crate::survey::Survey;

const MS: i64 = 1_000_000;
const DAY_NS: i64 = 86_400_000 * MS;
/// Hours of the day at which drives begin, in milliseconds.
const HOURS_MS: (f64, f64) = (6.0 * 3.6e6, 20.0 * 3.6e6);

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
    pub(crate) spec: &'a CitySpec,
    pub(crate) street: &'a Street,
    pub(crate) survey: &'a Survey<'a>,
    pub(crate) noise: &'a Noise,
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

impl Drive<'_> {
    /// Writes the drive's log; drives take turns in ROS 2 and Foxglove messages.
    pub(crate) fn write<W: Write + Seek>(&self, sink: W) -> Result<W, LogWriteError> {
        let dialect = match self.index % 2 {
            0 => Dialect::Ros2,
            _ => Dialect::Foxglove,
        };
        let vehicle = format!("city-{:04}", self.index % self.spec.vehicles);
        let site = format!("simulated city, seed {}", self.spec.seed);
        let mut log = LogWriter::create(sink, dialect, &vehicle, [("site", site.as_str())])?;
        for record in self.records(dialect) {
            log.write(Entry {
                topic: record.topic,
                stamp_ns: record.stamp_ns,
                log_time_ns: record.log_time_ns,
                frame_id: record.frame_id,
                payload: &record.payload,
            })?;
        }
        log.finish()
    }

    fn random(&self, name: &str) -> Random {
        Random::new(self.spec.seed, name, self.index)
    }

    /// Drives follow each other through the campaign, so that no vehicle drives twice at once.
    fn start_ns(&self) -> i64 {
        let day = i64::from(self.index) * i64::from(self.spec.days) / i64::from(self.spec.drives);
        let time_ms = self.random("start").between(HOURS_MS.0, HOURS_MS.1) as i64;
        self.spec.first_day_ns + day * DAY_NS + time_ms * MS
    }

    fn records(&self, dialect: Dialect) -> Vec<Record> {
        let course = Course::draw(self.street, &mut self.random("course"));
        let mut records = self.fixes(&course);
        records.extend(self.headings(&course, dialect));
        records.extend(self.frames(&course));
        records.sort_by_key(|record| (record.log_time_ns, record.topic));
        records
    }

    /// Stamps of a sensor with the seconds since the drive's begin.
    fn ticks(&self, clock: Clock, course: &Course<'_>) -> impl Iterator<Item = (i64, f64)> {
        let start_ns = self.start_ns();
        // Positions go on behind the last frame, as they begin before the first.
        let end_ns = (i64::from(course.seconds()) + 1) * 1_000 * MS - clock.phase_ns;
        (0..)
            .map(move |tick| clock.phase_ns + tick * clock.period_ns)
            .take_while(move |since_ns| *since_ns < end_ns)
            .map(move |since_ns| (start_ns + since_ns, since_ns as f64 * 1e-9))
    }

    fn fixes(&self, course: &Course<'_>) -> Vec<Record> {
        let mut receiver = Receiver::draw(&self.noise.gnss, self.random("position"));
        let period_s = GNSS.period_ns as f64 * 1e-9;
        let mut last = None;
        self.ticks(GNSS, course)
            .map(|(stamp_ns, seconds)| {
                let error = receiver.next_fix(period_s, 0.0);
                let place = course.place(seconds - error.delay_s);
                let [east_m, north_m, up_m] = error.error_m;
                let measured = [place.east_m + east_m, place.north_m + north_m];
                let [longitude_deg, latitude_deg, height_m] = self.survey.on_earth(measured);
                let fix = Payload::Gnss(GnssFix {
                    latitude_deg,
                    longitude_deg,
                    altitude_m: height_m + up_m,
                    covariance_enu_m2: Some(receiver.claimed_covariance_m2()),
                    has_fix: error.has_fix,
                });
                let payload = last.take().filter(|_| error.is_repeated).unwrap_or(fix);
                last = Some(payload.clone());
                record("/gnss/fix", "base_link", stamp_ns, GNSS, payload)
            })
            .collect()
    }

    fn headings(&self, course: &Course<'_>, dialect: Dialect) -> Vec<Record> {
        let mut inertial = Inertial::draw(&self.noise.imu, self.random("heading"));
        let period_s = HEADING.period_ns as f64 * 1e-9;
        let yaw_variance_rad2 = self.noise.imu.claimed_yaw_deg.to_radians().powi(2);
        self.ticks(HEADING, course)
            .map(|(stamp_ns, seconds)| {
                let yaw_rad =
                    self.true_yaw_rad(&course.place(seconds)) + inertial.yaw_error_rad(period_s);
                let rate_rad_s = course.yaw_rate_rad_s(seconds) + inertial.yaw_rate_error_rad_s();
                let orientation = about_up(yaw_rad);
                let (topic, frame_id, payload) = match dialect {
                    Dialect::Ros2 => (
                        "/imu",
                        "base_link",
                        imu(orientation, yaw_variance_rad2, rate_rad_s),
                    ),
                    Dialect::Foxglove => ("/heading", "enu", pose(orientation)),
                };
                record(topic, frame_id, stamp_ns, HEADING, payload)
            })
            .collect()
    }

    fn frames(&self, course: &Course<'_>) -> Vec<Record> {
        let mut detector = Detector::new(self.street, self.random("detector"));
        self.ticks(CAMERA, course)
            .map(|(stamp_ns, seconds)| {
                let place = course.place(seconds);
                let payload = Payload::Detections(DetectionFrame {
                    space: DetectionSpace::Metres,
                    detections: detector.look(&place, course.station_m(seconds)),
                });
                record("/perception/lanes", "base_link", stamp_ns, CAMERA, payload)
            })
            .collect()
    }

    /// A yaw of the city's plane as one against true north where the vehicle is.
    fn true_yaw_rad(&self, place: &Place) -> f64 {
        let here = LocalFrame::new(self.survey.on_earth([place.east_m, place.north_m]));
        self.survey.frame.yaw_in(&here, place.yaw_rad)
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
