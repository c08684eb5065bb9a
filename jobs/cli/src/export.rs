//! `export`: a version's changes in the form that another program reads.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, IsTerminal, Write};
use std::path::Path;

use tilefold_engine::Criteria;
use tilefold_engine::export::{Choice, View, chosen, write_view};
use tilefold_schemas::ChangeRecord;
use tilefold_store::{Snapshot, Store};

use crate::args::{Args, Export, Format};
use crate::report::Outcome;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Posterior from which a change is shown.
const SHOWN: f64 = 0.5;

/// Writes what is asked for.
///
/// # Errors
/// The store cannot be read, or the file not be written.
pub(crate) fn export(args: &Args, asked: &Export) -> Result<Outcome> {
    let snapshot = Store::open(asked.store.clone())?.snapshot(asked.version)?;
    let criteria = Criteria {
        threshold: asked.threshold.unwrap_or(SHOWN),
        min_vehicles: asked.min_vehicles.unwrap_or(0),
    };
    let choice = match asked.all {
        true => Choice::All,
        false => Choice::Claims(criteria),
    };
    let records = chosen(&snapshot, choice)?;
    show(&snapshot, &records, view(args.format), asked)
}

fn view(format: Format) -> View {
    match format {
        Format::Geoparquet => View::GeoParquet,
        Format::Flatgeobuf => View::FlatGeobuf,
        Format::Pmtiles => View::PmTiles,
        Format::Mcap => View::Scene,
        Format::Text | Format::Json | Format::Geojson => View::GeoJson,
    }
}

fn show(
    snapshot: &Snapshot,
    records: &[ChangeRecord],
    view: View,
    asked: &Export,
) -> Result<Outcome> {
    let without = match asked.out.as_deref() {
        Some(path) => to_file(path, |out| {
            Ok(write_view(snapshot, records, view, out)?)
        })?,
        None => {
            let mut out = std::io::stdout();
            if view != View::GeoJson && out.is_terminal() {
                return Err("this form is no text: name a file with --out".into());
            }
            write_view(snapshot, records, view, &mut out)?
        }
    };
    if let Some(path) = &asked.out {
        let written = records.len() - without;
        eprintln!("wrote {written} features to {}", path.display());
    }
    if without > 0 {
        eprintln!("{without} records without a geometry have no place in this form");
    }
    Ok(Outcome::Done)
}

fn to_file<T>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<T>,
) -> Result<T> {
    let file =
        File::create(path).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    let mut writer = BufWriter::new(file);
    let written = write(&mut writer)?;
    writer.flush()?;
    Ok(written)
}
