//! Why a city could not be made.

use std::io;
use std::path::PathBuf;

use tilefold_formats::log_write::LogWriteError;
use tilefold_formats::map::MapError;
use tilefold_formats::map_write::MapWriteError;

/// Why a city could not be made.
#[derive(Debug, thiserror::Error)]
pub enum CityError {
    /// A field of the specification outside of its limits.
    #[error("{field} = {value} cannot be built: give {least} to {most}")]
    Spec {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// The least that is possible.
        least: f64,
        /// The most that is possible.
        most: f64,
    },
    /// A file that could not be written.
    #[error("cannot write {path}: {source}; check the disk and the folder's rights")]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A map that could not be written.
    #[error("{path}: {source}")]
    Map {
        /// The file.
        path: PathBuf,
        /// Why.
        source: MapWriteError,
    },
    /// Noise parameters that could not be read.
    #[error("cannot read noise parameters {path}: {source}; give a file, or a preset: {presets}")]
    NoiseFile {
        /// The file.
        path: String,
        /// The presets that there are.
        presets: String,
        /// What the system says.
        source: io::Error,
    },
    /// Noise parameters that are no TOML, or lack a key, or have one that is not known.
    #[error("{file}: {why}")]
    NoiseSyntax {
        /// The file or preset.
        file: String,
        /// What is wrong, and where.
        why: String,
    },
    /// A noise parameter outside of its limits.
    #[error("{file}: {key} = {value}: give {least} to {most}")]
    NoiseValue {
        /// The file or preset.
        file: String,
        /// The key with its sections.
        key: String,
        /// Its value.
        value: f64,
        /// The least that is possible.
        least: f64,
        /// The most that is possible.
        most: f64,
    },
    /// A map that could not be read.
    #[error(transparent)]
    MapRead(#[from] MapError),
    /// A map in which nobody can drive.
    #[error(
        "{path} has no lanes: of its {lanelets} lanelets, cars may drive through none that could be read{hint}; give a Lanelet2 map with lanelets of the subtype `road`"
    )]
    NoLanes {
        /// The file.
        path: PathBuf,
        /// Lanelets of any kind.
        lanelets: u64,
        /// The first thing that was set aside, if any was.
        hint: String,
    },
    /// A map beyond what is simulated.
    #[error(
        "the {what} is {value:.0}, the most is {most:.0}: cut the map, or remove what it has twice"
    )]
    MapSize {
        /// What is too large.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The limit.
        most: f64,
    },
    /// A picture that could not be written.
    #[error(transparent)]
    Picture(#[from] crate::render::JpegError),
    /// A log that could not be written.
    #[error("{path}: {source}")]
    Log {
        /// The file.
        path: PathBuf,
        /// Why.
        source: LogWriteError,
    },
}
