//! `export`: a version's changes in the form that another program reads.

use std::collections::BTreeSet;
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, IsTerminal, Write};
use std::path::Path;

use tilefold_engine::Criteria;
use tilefold_engine::export::{Amended, Amendment, Choice, View, amend, chosen, write_view};
use tilefold_formats::geojson::write_reviewed;
use tilefold_review::{Decisions, Said};
use tilefold_schemas::{ChangeRecord, Verdict};

use crate::args::{Args, Export, Format};
use crate::at::open;
use crate::report::{Outcome, print_set_aside};
use crate::review;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// What is shown where nothing is asked for.
const SHOWN: Criteria = Criteria {
    threshold: 0.5,
    min_vehicles: 0,
};

/// Writes what is asked for.
///
/// # Errors
/// The store cannot be read, or the file not be written.
pub(crate) fn export(args: &Args, asked: &Export) -> Result<Outcome> {
    let snapshot = open(&asked.store, asked.version)?;
    if args.format == Format::Html {
        return review::write_page(args, &snapshot, asked);
    }
    let decisions = review::decisions(&asked.store, asked.decisions.as_deref())?;
    let amendment = match args.format {
        Format::Lanelet2 => Some(Amendment::Lanelet2),
        Format::Osc => Some(Amendment::Osc),
        _ => None,
    };
    let usual = match amendment {
        Some(_) => Criteria::default(),
        None => SHOWN,
    };
    let criteria = Criteria {
        threshold: asked.threshold.unwrap_or(usual.threshold),
        min_vehicles: asked.min_vehicles.unwrap_or(usual.min_vehicles),
    };
    let choice = match asked.all || asked.accepted {
        true => Choice::All,
        false => Choice::Claims(criteria),
    };
    let mut records = chosen(&snapshot, choice)?;
    if asked.accepted {
        records.retain(|record| is_accepted(record, &decisions));
    }
    match amendment {
        Some(form) => {
            let amended = amend(&snapshot, records, &asked.map, form)?;
            write_maps(&amended, form, asked.out.as_deref())
        }
        _ if view(args.format) == View::GeoJson => show(asked, &records, View::GeoJson, |out| {
            write_reviewed(&records, &|id| review::said(&decisions, id), out)?;
            Ok(0)
        }),
        _ => show(asked, &records, view(args.format), |mut out| {
            Ok(write_view(
                &snapshot,
                &records,
                view(args.format),
                &mut out,
            )?)
        }),
    }
}

/// Whether a reviewer accepted what the record still says.
fn is_accepted(record: &ChangeRecord, decisions: &Decisions) -> bool {
    let verdict = Verdict::from_code(record.verdict);
    decisions.of(record.change).is_some_and(|decision| {
        decision.decision == Said::Accept
            && verdict
                .is_some_and(|verdict| verdict.is_change() && verdict.name() == decision.verdict)
    })
}

/// One map goes to the standard output or a file, several go into a folder.
fn write_maps(amended: &Amended, form: Amendment, out: Option<&Path>) -> Result<Outcome> {
    match (&amended.maps[..], out) {
        ([one], None) => std::io::stdout().lock().write_all(&one.bytes)?,
        ([one], Some(file)) => to_file(file, |out| Ok(out.write_all(&one.bytes)?))?,
        (_, None) => return Err("these are several maps: name a folder with --out".into()),
        (_, Some(folder)) => write_into(folder, amended, form)?,
    }
    tell!("{} changes are in it", amended.applied);
    if amended.elsewhere > 0 {
        tell!("{} are about other maps of the store", amended.elsewhere);
    }
    print_set_aside(&amended.set_aside);
    Ok(match amended.set_aside.is_empty() {
        true => Outcome::Done,
        false => Outcome::SetAside,
    })
}

/// Each map keeps its name; its changes have the ending `.osc` behind it.
fn write_into(folder: &Path, amended: &Amended, form: Amendment) -> Result<()> {
    let names: BTreeSet<&str> = amended.maps.iter().map(|map| map.name.as_str()).collect();
    if names.len() < amended.maps.len() {
        return Err("two of these maps have the same name: export them one by one".into());
    }
    let cannot = |error| format!("cannot make the folder {}: {error}", folder.display());
    std::fs::create_dir_all(folder).map_err(cannot)?;
    for map in &amended.maps {
        let ending = if form == Amendment::Osc { ".osc" } else { "" };
        let file = folder.join(format!("{}{ending}", map.name));
        to_file(&file, |out| Ok(out.write_all(&map.bytes)?))?;
    }
    Ok(())
}

fn view(format: Format) -> View {
    match format {
        Format::Geoparquet => View::GeoParquet,
        Format::Flatgeobuf => View::FlatGeobuf,
        Format::Pmtiles => View::PmTiles,
        Format::Mcap => View::Scene,
        _ => View::GeoJson,
    }
}

fn show(
    asked: &Export,
    records: &[ChangeRecord],
    view: View,
    write: impl Fn(&mut (dyn Write + Send)) -> Result<usize>,
) -> Result<Outcome> {
    let without = match asked.out.as_deref() {
        Some(path) => to_file(path, |out| write(out))?,
        None => {
            let mut out = std::io::stdout();
            if view != View::GeoJson && out.is_terminal() {
                return Err("this form is no text: name a file with --out".into());
            }
            write(&mut out)?
        }
    };
    if let Some(path) = &asked.out {
        let written = records.len() - without;
        tell!("wrote {written} features to {}", path.display());
    }
    if without > 0 {
        tell!("{without} records without a geometry have no place in this form");
    }
    Ok(Outcome::Done)
}

fn to_file<T>(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<T>) -> Result<T> {
    let file =
        File::create(path).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    let mut writer = BufWriter::new(file);
    let written = write(&mut writer)?;
    writer.flush()?;
    Ok(written)
}
