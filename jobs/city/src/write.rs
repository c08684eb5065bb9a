//! A city's files: two maps, the truth, and a log per drive.

use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use tilefold_formats::map_write::write_lanelet2;
use tilefold_schemas::element::Element;
use tilefold_tiler::geodesy::LocalFrame;

use crate::drive::Drive;
use crate::edit;
use crate::error::CityError;
use crate::noise::NoiseProfile;
use crate::road::Street;
use crate::spec::CitySpec;
use crate::survey::Survey;
use crate::truth;

/// Where a city's files are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CityFiles {
    /// The map with known errors: what a store is made from (Lanelet2).
    pub before_map: PathBuf,
    /// What is really on the road (Lanelet2).
    pub after_map: PathBuf,
    /// The differences of the two, as GeoJSON.
    pub truth: PathBuf,
    /// One log per drive (MCAP), in order of time.
    pub logs: Vec<PathBuf>,
}

/// Makes the city of `spec` and writes its files into the folder `out`, which is made if need be;
/// files of the same names are replaced.
///
/// The same specification gives the same bytes (on one platform: sines are the system's).
///
/// # Errors
/// If the specification is outside of its limits, or a file cannot be written.
pub fn write(spec: &CitySpec, out: &Path) -> Result<CityFiles, CityError> {
    spec.check()?;
    let street = Street::draw(spec);
    let survey = Survey {
        street: &street,
        frame: LocalFrame::new(spec.anchor),
    };
    let maps = edit::draw(&survey, spec.seed, spec.changes_per_kind)?;

    let noise = NoiseProfile::load("paper_like")?;
    let logs_folder = out.join("logs");
    fs::create_dir_all(&logs_folder).map_err(at(&logs_folder))?;
    let files = CityFiles {
        before_map: out.join("before.osm"),
        after_map: out.join("after.osm"),
        truth: out.join("truth.geojson"),
        logs: (0..spec.drives)
            .map(|index| logs_folder.join(format!("drive_{index:04}.mcap")))
            .collect(),
    };
    write_map(&files.before_map, &maps.before, "before")?;
    write_map(&files.after_map, &maps.after, "after")?;
    fs::write(&files.truth, truth::geojson(&maps.changes)).map_err(at(&files.truth))?;
    for (index, path) in (0..).zip(&files.logs) {
        let drive = Drive {
            spec,
            street: &street,
            survey: &survey,
            noise: noise.of(index % spec.vehicles),
            index,
        };
        write_log(path, &drive)?;
    }
    Ok(files)
}

fn at(path: &Path) -> impl Fn(io::Error) -> CityError {
    let path = path.to_owned();
    move |source| CityError::File {
        path: path.clone(),
        source,
    }
}

fn write_map(path: &Path, elements: &[Element], version: &str) -> Result<(), CityError> {
    let mut out = BufWriter::new(File::create(path).map_err(at(path))?);
    write_lanelet2(elements, version, &mut out).map_err(|source| CityError::Map {
        path: path.to_owned(),
        source,
    })?;
    finish(path, out)
}

fn write_log(path: &Path, drive: &Drive<'_>) -> Result<(), CityError> {
    let out = BufWriter::new(File::create(path).map_err(at(path))?);
    let out = drive.write(out).map_err(|source| CityError::Log {
        path: path.to_owned(),
        source,
    })?;
    finish(path, out)
}

/// What is still buffered is written, so that a full disk is an error and not a short file.
fn finish(path: &Path, out: BufWriter<File>) -> Result<(), CityError> {
    match out.into_inner() {
        Ok(_) => Ok(()),
        Err(error) => Err(at(path)(error.into_error())),
    }
}
