//! One drive: the legs that it has, and the log they end in.
//!
//! Where the map ends before the drive does, the vehicle parks, and comes in again where it likes:
//! the drive goes on with another leg, some minutes later. A log holds them all.

mod in_order;
mod leg;

use std::io::{Seek, Write};

use tilefold_formats::log_write::{Dialect, Entry, LogWriteError, LogWriter};

use crate::city::City;
use crate::course::Course;
use crate::detector::Part;
use crate::error::CityError;
use crate::random::Random;
use crate::route::{Routes, STEP_M};
use leg::{Content, Leg};

/// Topic of the detections.
pub(crate) const DETECTIONS_TOPIC: &str = "/perception/lanes";
/// Shorter routes are no leg, in steps.
const LEAST_STEPS: usize = 10;
/// Between two legs: how long the vehicle parks, in seconds, and how fast it comes to the next one's
/// begin, in metres per second along the beeline.
const PARKED_S: (f64, f64) = (120.0, 300.0);
const UNSEEN_M_S: f64 = 10.0;
const MS: i64 = 1_000_000;
const DAY_NS: i64 = 86_400_000 * MS;

/// Which drive of a city.
pub(crate) struct Drive<'a> {
    pub(crate) city: &'a City<'a>,
    pub(crate) index: u32,
}

/// A drive that was written.
pub(crate) struct Written<W> {
    pub(crate) sink: W,
    /// The matching truth, if it is wanted.
    pub(crate) matches: Vec<Match>,
    /// What is in the pictures: a JSON value a line.
    pub(crate) frames: String,
}

/// Of which element a stretch of a detection is.
pub(crate) struct Match {
    pub(crate) stamp_ns: i64,
    /// Which of its frame's detections, counted from 0.
    pub(crate) detection: usize,
    pub(crate) part: Part,
}

impl Drive<'_> {
    /// Writes the drive's log; drives take turns in ROS 2 and Foxglove messages. `at` says where a
    /// log failed.
    pub(crate) fn write<W: Write + Seek>(
        &self,
        sink: W,
        at: impl Fn(LogWriteError) -> CityError,
    ) -> Result<Written<W>, CityError> {
        let dialect = match self.index % 2 {
            0 => Dialect::Ros2,
            _ => Dialect::Foxglove,
        };
        let vehicle = self.vehicle_id();
        let site = format!("simulated city, seed {}", self.city.spec.seed);
        let site = [("site", site.as_str())];
        let mut log = LogWriter::create(sink, dialect, &vehicle, site).map_err(&at)?;
        let (mut matches, mut frames) = (Vec::new(), String::new());
        let courses = self.courses();
        let start_ns = self.start_ns(courses.last().map_or(0.0, |(end_s, _)| *end_s));
        for (number, (end_s, course)) in courses.iter().enumerate() {
            let begin_s = end_s - course.seconds();
            let leg_ns = start_ns + (begin_s * 1e3) as i64 * MS;
            let leg = Leg::new(self, number, course, leg_ns);
            let mut pictures = leg.pictures();
            for record in leg.records(dialect, &mut matches) {
                let payload = match (record.content, &mut pictures) {
                    (Content::Said(payload), _) => payload,
                    (Content::Picture { .. }, None) => continue,
                    (Content::Picture { seconds }, Some(pictures)) => {
                        let (payload, truth) = pictures.take(seconds, record.stamp_ns)?;
                        // Numbers and names: nothing that JSON cannot hold.
                        frames += &serde_json::to_string(&truth).unwrap_or_default();
                        frames.push('\n');
                        payload
                    }
                };
                let entry = Entry {
                    topic: record.topic,
                    stamp_ns: record.stamp_ns,
                    log_time_ns: record.log_time_ns,
                    frame_id: record.frame_id,
                    payload: &payload,
                };
                log.write(entry).map_err(&at)?;
            }
        }
        Ok(Written {
            sink: log.finish().map_err(&at)?,
            matches,
            frames,
        })
    }

    /// The vehicle's id in the log's metadata.
    pub(crate) fn vehicle_id(&self) -> String {
        format!("city-{:04}", self.vehicle())
    }

    fn vehicle(&self) -> u32 {
        self.index % self.city.spec.vehicles
    }

    fn random(&self, name: &str) -> Random {
        Random::new(self.city.spec.seed, name, self.index)
    }

    /// A vehicle's drives divide the campaign among them, so that it never drives twice at once:
    /// what each has of it.
    fn span_ns(&self) -> i64 {
        let spec = self.city.spec;
        let rounds = spec.drives.div_ceil(spec.vehicles).max(1);
        i64::from(spec.days) * DAY_NS / i64::from(rounds)
    }

    fn start_ns(&self, seconds: f64) -> i64 {
        let span_ns = self.span_ns();
        let round = i64::from(self.index / self.city.spec.vehicles);
        let spare_ns = (span_ns - (seconds * 1e9) as i64).max(0);
        let wait_ns = (self.random("start").unit() * spare_ns as f64) as i64;
        self.city.begin_ns + round * span_ns + wait_ns / MS * MS
    }

    /// The motion of each leg, with the second of the drive at which it ends; none where there is no
    /// road to drive on.
    fn courses(&self) -> Vec<(f64, Course)> {
        let city = self.city;
        let (mut lots, mut parking) = (self.random("route"), self.random("parking"));
        let mut routes = Routes::new(city.world, &city.reach);
        let mut courses: Vec<(f64, Course)> = Vec::new();
        let mut left_m = city.spec.drive_km * 1_000.0;
        while left_m > LEAST_STEPS as f64 * STEP_M {
            let steps = routes.draw(left_m, &mut lots);
            left_m -= steps.len().max(1) as f64 * STEP_M;
            if steps.len() < LEAST_STEPS {
                continue;
            }
            let course = Course::draw(steps, &mut self.random(&stream("course", courses.len())));
            let parked_s = parking.between(PARKED_S.0, PARKED_S.1);
            let begin_s = courses.last().map_or(0.0, |(end_s, last)| {
                end_s + parked_s + beeline_m(last, &course) / UNSEEN_M_S
            });
            let end_s = begin_s + course.seconds();
            if !courses.is_empty() && end_s * 1e9 > self.span_ns() as f64 {
                break;
            }
            courses.push((end_s, course));
        }
        courses
    }
}

/// A leg's own stream of lots.
fn stream(name: &str, leg: usize) -> String {
    match leg {
        0 => name.to_owned(),
        _ => format!("{name}, leg {leg}"),
    }
}

/// From one leg's end to another's begin.
fn beeline_m(from: &Course, to: &Course) -> f64 {
    let (from, to) = (from.point(from.length_m()), to.point(0.0));
    (to[0] - from[0]).hypot(to[1] - from[1])
}
