//! How sensors err: parameter files.
//!
//! A file is TOML. It has every key of [`Noise`], or it names one of the presets that it is `like`
//! and has only what differs. `[[vehicle]]` tables give single vehicles errors of their own: a
//! `number` and the keys that differ. Where a preset's numbers come from is said in the file.

pub(crate) mod section;

mod detector;
mod vehicle;

use std::collections::BTreeMap;
use std::fs;

use serde::Deserialize;
use toml::{Table, Value};

use crate::error::CityError;

pub use detector::{Areas, Clutter, DetectorNoise, Lateral, Miss, Reading, Traffic, View};
pub use section::{Drift, Profile};
pub use vehicle::{CameraNoise, ClockNoise, GnssNoise, ImuNoise, MountingNoise, WheelNoise};

/// The presets: their names and files.
const PRESETS: [(&str, &str); 7] = [
    ("paper_like", include_str!("../noise/paper_like.toml")),
    ("good_gnss", include_str!("../noise/good_gnss.toml")),
    ("worst_gnss", include_str!("../noise/worst_gnss.toml")),
    ("deecamp", include_str!("../noise/deecamp.toml")),
    ("night_rain", include_str!("../noise/night_rain.toml")),
    ("bad_vehicles", include_str!("../noise/bad_vehicles.toml")),
    ("cameras", include_str!("../noise/cameras.toml")),
];

/// How the sensors of one vehicle err.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// The receiver.
    pub gnss: GnssNoise,
    /// The inertial sensor.
    pub imu: ImuNoise,
    /// The wheels' speed.
    pub wheel: WheelNoise,
    /// The camera, where pictures are taken.
    pub camera: CameraNoise,
    /// The camera's mounting.
    pub mounting: MountingNoise,
    /// The camera's clock.
    pub clock: ClockNoise,
    /// The detector.
    pub detector: DetectorNoise,
}

/// How the sensors of a fleet err.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseProfile {
    /// Its preset's name, or its path.
    pub name: String,
    common: Noise,
    /// Vehicles with errors of their own, by number.
    own: BTreeMap<u32, Noise>,
}

impl NoiseProfile {
    /// Reads a preset by its name, or a file by its path.
    ///
    /// # Errors
    /// If there is no such file, it is not TOML, a key is missing or not known, or a value is
    /// outside of its limits.
    pub fn load(name_or_path: &str) -> Result<Self, CityError> {
        match preset(name_or_path) {
            Some(text) => Self::read(name_or_path, text),
            None => {
                let text = fs::read_to_string(name_or_path);
                let text = text.map_err(|source| CityError::NoiseFile {
                    path: name_or_path.to_owned(),
                    presets: presets().collect::<Vec<_>>().join(", "),
                    source,
                })?;
                Self::read(name_or_path, &text)
            }
        }
    }

    /// Reads the text of a parameter file; `name` is what errors call it.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn read(name: &str, text: &str) -> Result<Self, CityError> {
        let mut table = resolve(name, text)?;
        let vehicles = take_vehicles(name, &mut table)?;
        let common = noise(name, table.clone())?;
        let mut own = BTreeMap::new();
        for (number, differs) in vehicles {
            let mut merged = table.clone();
            merge(&mut merged, differs);
            own.insert(number, noise(&format!("{name}, vehicle {number}"), merged)?);
        }
        Ok(Self {
            name: name.to_owned(),
            common,
            own,
        })
    }

    /// How the sensors of a vehicle err.
    #[must_use]
    pub fn of(&self, vehicle: u32) -> &Noise {
        self.own.get(&vehicle).unwrap_or(&self.common)
    }
}

/// The names of the presets.
pub fn presets() -> impl Iterator<Item = &'static str> {
    PRESETS.iter().map(|(name, _)| *name)
}

fn preset(wanted: &str) -> Option<&'static str> {
    let found = PRESETS.iter().find(|(name, _)| *name == wanted);
    found.map(|(_, text)| *text)
}

/// A file's table, laid over that of the preset that it is like. Presets are like earlier ones only,
/// so this ends.
fn resolve(name: &str, text: &str) -> Result<Table, CityError> {
    let mut table: Table = text.parse().map_err(|error| wrong(name, &error))?;
    let Some(like) = table.remove("like") else {
        return Ok(table);
    };
    let like = like.as_str().unwrap_or_default();
    let Some(text) = preset(like).filter(|_| like != name) else {
        let presets: Vec<_> = presets().collect();
        let why = format!(
            "like = {like:?} is no preset: give one of {}",
            presets.join(", ")
        );
        return Err(wrong(name, &why));
    };
    let mut under = resolve(like, text)?;
    merge(&mut under, table);
    Ok(under)
}

/// Lays `over` on `under`, key by key; arrays are replaced.
fn merge(under: &mut Table, over: Table) {
    for (key, value) in over {
        match (under.get_mut(&key), value) {
            (Some(Value::Table(under)), Value::Table(over)) => merge(under, over),
            (_, value) => {
                under.insert(key, value);
            }
        }
    }
}

/// The numbers of vehicles with what differs of them.
fn take_vehicles(name: &str, table: &mut Table) -> Result<Vec<(u32, Table)>, CityError> {
    let Some(vehicles) = table.remove("vehicle") else {
        return Ok(Vec::new());
    };
    let vehicles: Vec<Table> = vehicles.try_into().map_err(|error| wrong(name, &error))?;
    let numbered = vehicles.into_iter().map(|mut differs| {
        let number = differs.remove("number").and_then(|n| n.as_integer());
        let number = number.and_then(|number| u32::try_from(number).ok());
        let why = "[[vehicle]] lacks its number: give `number = N`, counted from 0";
        Ok((number.ok_or_else(|| wrong(name, &why))?, differs))
    });
    numbered.collect()
}

fn noise(name: &str, table: Table) -> Result<Noise, CityError> {
    let noise: Noise = table.try_into().map_err(|error| wrong(name, &error))?;
    let checks = noise
        .gnss
        .check("gnss")
        .and_then(|()| noise.imu.check("imu"))
        .and_then(|()| noise.wheel.check("wheel"))
        .and_then(|()| noise.camera.check("camera"))
        .and_then(|()| noise.mounting.check("mounting"))
        .and_then(|()| noise.clock.check("clock"))
        .and_then(|()| noise.detector.check("detector"));
    checks.map_err(|outside| CityError::NoiseValue {
        file: name.to_owned(),
        key: outside.key,
        value: outside.value,
        least: outside.least,
        most: outside.most,
    })?;
    Ok(noise)
}

fn wrong(name: &str, why: &dyn std::fmt::Display) -> CityError {
    CityError::NoiseSyntax {
        file: name.to_owned(),
        why: why.to_string().trim_end().to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        NoiseProfile::read("mine.toml", text)
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn presets_can_be_read() {
        for name in presets() {
            let profile = NoiseProfile::load(name).unwrap();
            assert_eq!(profile.of(12_345), &profile.common);
        }
    }

    #[test]
    fn a_file_is_like_a_preset_but_for_what_it_says() {
        let text = "like = 'paper_like'\n[gnss]\nbias_m = 2\n";
        let mine = NoiseProfile::read("mine.toml", text).unwrap();
        let preset = NoiseProfile::load("paper_like").unwrap();
        let mut expected = preset.common.clone();
        assert_ne!(expected.gnss.bias_m, 2.0);
        expected.gnss.bias_m = 2.0;
        assert_eq!(mine.common, expected);
    }

    #[test]
    fn a_vehicle_has_errors_of_its_own() {
        let text = "like = 'paper_like'\n[[vehicle]]\nnumber = 3\ndetector.lateral.bias_m = 1.0\n";
        let profile = NoiseProfile::read("mine.toml", text).unwrap();
        assert_eq!(profile.of(3).detector.lateral.bias_m, 1.0);
        assert_eq!(profile.of(3).detector.miss, profile.of(4).detector.miss);
        assert_eq!(profile.of(4).detector.lateral.bias_m, 0.0);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let outside = refused("like = 'paper_like'\n[gnss]\nbias_m = -1\n");
        assert_eq!(outside, "mine.toml: gnss.bias_m = -1: give 0 to 20");
        let drift = "like = 'paper_like'\ngnss.drift = [{ sigma = 1, seconds = 0 }]\n";
        assert!(refused(drift).contains("gnss.drift[0].seconds = 0: give 0.01 to 10000"));
        let own = "like = 'paper_like'\n[[vehicle]]\nnumber = 7\nclock.offset_s = 99\n";
        assert!(refused(own).contains("vehicle 7: clock.offset_s = 99"));
        assert!(refused("like = 'paper_like'\n[gnss]\nbia_m = 1\n").contains("bia_m"));
        assert!(refused("like = 'paper_like'\n[gnss]\nbias_m = 'x'\n").contains("bias_m"));
        assert!(refused("[gnss]\n").contains("rate_hz"));
        assert!(refused("like = 'best'\n").contains("give one of paper_like, "));
        assert!(refused("like = 'paper_like'\n[[vehicle]]\n").contains("number = N"));
        let lost = NoiseProfile::load("no/such.toml").unwrap_err().to_string();
        assert!(
            lost.contains("no/such.toml") && lost.contains("deecamp"),
            "{lost}"
        );
    }
}
