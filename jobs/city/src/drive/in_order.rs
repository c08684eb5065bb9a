//! Sensors that speak side by side, merged into one stream in the order in which they were recorded.

use std::iter::Peekable;

use super::leg::Record;

/// Messages of one sensor, in order.
pub(super) type Sensor<'a> = Box<dyn Iterator<Item = Record> + 'a>;

/// Messages of several sensors by log time and topic; of equal ones the sensor given first speaks
/// first. Holds one message of each.
pub(super) struct InOrder<'a> {
    sensors: Vec<Peekable<Sensor<'a>>>,
}

impl<'a> InOrder<'a> {
    pub(super) fn new(sensors: impl IntoIterator<Item = Sensor<'a>>) -> Self {
        let sensors = sensors.into_iter().map(Iterator::peekable);
        Self {
            sensors: sensors.collect(),
        }
    }
}

impl Iterator for InOrder<'_> {
    type Item = Record;

    fn next(&mut self) -> Option<Record> {
        let waiting = self.sensors.iter_mut().filter_map(|sensor| {
            let record = sensor.peek()?;
            Some(((record.log_time_ns, record.topic), sensor))
        });
        let (_, sensor) = waiting.min_by_key(|(turn, _)| *turn)?;
        sensor.next()
    }
}
