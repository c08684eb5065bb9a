//! `bench`: how fast this machine does a job, stage by stage, on a city of its own or on given logs.

use std::error::Error;

use tilefold_city::{CitySpec, Site};
use tilefold_engine::{FusionModel, InitOptions, init, run, throughput};

use crate::args::{Args, Bench};
use crate::report::{Outcome, print};
use crate::{progress, table};

/// Makes a new store in a temporary folder, runs the job on it, and prints the stages.
///
/// # Errors
/// The temporary folder cannot be written, or the job failed.
pub(crate) fn bench(args: &Args, wanted: &Bench) -> Result<Outcome, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let (maps, logs) = match wanted.map.is_empty() {
        false => (wanted.map.clone(), wanted.logs.clone()),
        true => {
            let drives = wanted.drives;
            tell!("making a city, and {drives} drives of 2 km through it");
            let city = tilefold_city::write(&city(drives), &folder.path().join("city"))?;
            (vec![city.before_map], city.logs)
        }
    };
    let store = folder.path().join("store");
    let options = InitOptions {
        tile_level: 15,
        salt: None,
    };
    init(&store, &maps, &options)?;
    let progress = progress::listener(args.progress);
    let report = run(&store, &logs, FusionModel::default(), progress.as_ref())?;
    print(args, &report.stages, |stages| {
        let threads = rayon::current_num_threads();
        let busy_s: f64 = stages.iter().map(|stage| stage.busy_s).sum();
        let frames = stages.iter().find(|stage| stage.stage == "map");
        format!(
            "{}\n\n{:.0} frames a second: {:.1} s on {threads} threads, which were in a stage {:.0} % of the time",
            table::stages(stages),
            frames.map_or(0.0, |stage| stage.items as f64) / report.wall_s,
            report.wall_s,
            100.0 * busy_s / (threads as f64 * report.wall_s),
        )
    })?;
    if let Some(folder) = &wanted.plots {
        for file in throughput::write(folder, &report.stages)? {
            tell!("wrote {}", file.display());
        }
    }
    Ok(Outcome::Done)
}

fn city(drives: u32) -> CitySpec {
    CitySpec {
        site: Site::Drawn { km: 4.0 },
        vehicles: drives,
        drives,
        drive_km: 2.0,
        ..CitySpec::default()
    }
}
