//! A city's files: two maps, the truth, and a log per drive.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use rayon::iter::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};
use tilefold_formats::map_write::write_lanelet2;
use tilefold_schemas::element::Element;

use crate::city::City;
use crate::drive::{DETECTIONS_TOPIC, Drive, Match, Written};
use crate::edit::{self, History};
use crate::error::CityError;
use crate::ground::Ground;
use crate::network;
use crate::noise::NoiseProfile;
use crate::reach::Reach;
use crate::render::Renderer;
use crate::spec::{CitySpec, LogProfile, Site};
use crate::truth;
use crate::world::{Paint, World};

/// Drives per thread whose tables wait to be written.
const DRIVES_AT_ONCE: usize = 8;
/// The matching truth's columns.
const MATCHING_HEADER: &str = "vehicle,topic,stamp_ns,detection,element_id,from_share,to_share\n";

/// Where a city's files are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CityFiles {
    /// The map as it was when it was made: what a store is made from (Lanelet2).
    pub before_map: PathBuf,
    /// What is on the road when the last vehicle has driven (Lanelet2).
    pub after_map: PathBuf,
    /// The differences of the two, as GeoJSON.
    pub truth: PathBuf,
    /// All that happened, with dates: also what was undone again, and what is no change.
    pub history: PathBuf,
    /// One log per drive (MCAP).
    pub logs: Vec<PathBuf>,
    /// Which element every detection is of (CSV), if that was asked for.
    pub matching: Option<PathBuf>,
}

/// Makes the city of `spec` and writes its files into the folder `out`, which is made if need be;
/// files of the same names are replaced.
///
/// The same specification gives the same bytes with any number of threads (on one platform: sines
/// are the system's). Drives are made one by one by each thread, and written as they are made:
/// memory holds the world, and of each thread's drive its way.
///
/// # Errors
/// If the specification is outside of its limits, or a file cannot be read or written.
pub fn write(spec: &CitySpec, out: &Path) -> Result<CityFiles, CityError> {
    spec.check()?;
    let noise = NoiseProfile::load(&spec.noise)?;
    let mut world = world(spec)?;
    let campaign = spec.campaign();
    let history = edit::draw(&mut world, spec.seed, spec.change_share, campaign);

    let logs_folder = out.join("logs");
    fs::create_dir_all(&logs_folder).map_err(at(&logs_folder))?;
    let files = CityFiles {
        before_map: out.join("before.osm"),
        after_map: out.join("after.osm"),
        truth: out.join("truth.geojson"),
        history: out.join("history.geojson"),
        matching: spec.matching_truth.then(|| out.join("matching.csv")),
        logs: (0..spec.drives)
            .map(|index| logs_folder.join(format!("drive_{index:05}.mcap")))
            .collect(),
    };
    write_maps(&files, &world, history, campaign.end_ns())?;
    let city = City {
        spec,
        world: &world,
        ground: Ground::new(&world),
        reach: Reach::new(&world),
        noise,
        renderer: (spec.profile == LogProfile::Camera).then(|| Renderer::new(&world)),
        begin_ns: campaign.begin_ns,
    };
    let write_drive = |(index, path): (usize, &PathBuf)| {
        let drive = Drive {
            city: &city,
            index: index as u32,
        };
        write_log(path, &drive)
    };
    let Some(path) = &files.matching else {
        let drives = files.logs.par_iter().enumerate();
        drives.try_for_each(|drive| write_drive(drive).map(drop))?;
        return Ok(files);
    };
    let mut table = BufWriter::new(File::create(path).map_err(at(path))?);
    table
        .write_all(MATCHING_HEADER.as_bytes())
        .map_err(at(path))?;
    let indexed: Vec<(usize, &PathBuf)> = files.logs.iter().enumerate().collect();
    // Tables are written in the order of the drives; those of a few drives wait for their turn.
    for some in indexed.chunks(DRIVES_AT_ONCE * rayon::current_num_threads()) {
        let tables = some.par_iter().map(|drive| write_drive(*drive));
        for rows in tables.collect::<Result<Vec<String>, _>>()? {
            table.write_all(rows.as_bytes()).map_err(at(path))?;
        }
    }
    finish(path, table)?;
    Ok(files)
}

fn world(spec: &CitySpec) -> Result<World, CityError> {
    match &spec.site {
        Site::Drawn { km } => Ok(network::draw(spec.seed, *km, spec.anchor)),
        Site::Mapped { map } => World::from_lanelet2(map),
    }
}

/// One map after the other: a city's elements are larger than the city.
fn write_maps(
    files: &CityFiles,
    world: &World,
    history: History,
    end_ns: i64,
) -> Result<(), CityError> {
    let mapped = history.map.iter().map(|paint| world.element(paint));
    write_map(&files.before_map, &mapped.collect::<Vec<_>>(), "before")?;
    let after: Vec<&Paint> = world
        .paint
        .iter()
        .filter(|paint| paint.is_there(end_ns))
        .collect();
    write_map(&files.after_map, &numbered(world, &after), "after")?;
    let lasting = history
        .changes
        .iter()
        .filter(|change| truth::is_so(change, end_ns));
    let text = truth::geojson(world, lasting);
    fs::write(&files.truth, text).map_err(at(&files.truth))?;
    let text = truth::geojson(world, history.changes.iter());
    fs::write(&files.history, text).map_err(at(&files.history))
}

/// Elements with ids of their own: the two ends of a partly removed line have the same.
fn numbered(world: &World, paint: &[&Paint]) -> Vec<Element> {
    let mut next = paint.iter().map(|paint| paint.id).max().unwrap_or(0) + 1_000_000;
    let mut elements: Vec<Element> = Vec::with_capacity(paint.len());
    for paint in paint {
        let mut element = world.element(paint);
        if elements.last().is_some_and(|last| last.id == element.id) {
            element.id.0 = next;
            next += 1;
        }
        elements.push(element);
    }
    elements
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

/// Writes a drive's log and returns its part of the matching truth: empty if none is wanted.
fn write_log(path: &Path, drive: &Drive<'_>) -> Result<String, CityError> {
    let log = |source| CityError::Log {
        path: path.to_owned(),
        source,
    };
    let out = BufWriter::new(File::create(path).map_err(at(path))?);
    let Written {
        sink: out,
        matches,
        frames,
    } = drive.write(out, log)?;
    if drive.city.renderer.is_some() {
        let path = path.with_extension("frames.jsonl");
        fs::write(&path, frames).map_err(at(&path))?;
    }
    finish(path, out)?;
    match drive.city.spec.matching_truth {
        true => Ok(table(&drive.vehicle_id(), &matches)),
        false => Ok(String::new()),
    }
}

/// The matching truth of a drive.
fn table(vehicle: &str, matches: &[Match]) -> String {
    let mut text = String::new();
    for Match {
        stamp_ns,
        detection,
        part,
    } in matches
    {
        let [from, to] = part.shares;
        let element = part.element.map_or_else(String::new, |id| id.to_string());
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{vehicle},{DETECTIONS_TOPIC},{stamp_ns},{detection},{element},{from:.3},{to:.3}"
        );
    }
    text
}

/// What is still buffered is written, so that a full disk is an error and not a short file.
fn finish(path: &Path, out: BufWriter<File>) -> Result<(), CityError> {
    match out.into_inner() {
        Ok(_) => Ok(()),
        Err(error) => Err(at(path)(error.into_error())),
    }
}
