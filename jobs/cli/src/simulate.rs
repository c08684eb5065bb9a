//! `simulate`: a city, its changes and its drives, as files.

use std::error::Error;

use serde_json::json;
use tilefold_city::{CityFiles, CitySpec, LogProfile, Site};

use crate::args::{Args, ProfileName, Simulation};
use crate::report::{Outcome, print};

/// Makes a city and says where its files are.
///
/// # Errors
/// What was asked for cannot be built, or a file cannot be read or written.
pub(crate) fn simulate(args: &Args, wanted: &Simulation) -> Result<Outcome, Box<dyn Error>> {
    let spec = spec(wanted)?;
    let files = tilefold_city::write(&spec, &wanted.out)?;
    print(args, &summary(&files), |_| {
        format!(
            "map    {}\ntruth  {}\nlogs   {} in {}",
            files.before_map.display(),
            files.truth.display(),
            files.logs.len(),
            wanted.out.join("logs").display()
        )
    })?;
    Ok(Outcome::Done)
}

fn spec(wanted: &Simulation) -> Result<CitySpec, Box<dyn Error>> {
    let site = match &wanted.map {
        Some(map) => Site::Mapped { map: map.clone() },
        None => Site::Drawn { km: wanted.km },
    };
    let drives = wanted.drives;
    let mut anchor = CitySpec::default().anchor;
    for (axis, &degrees) in anchor.iter_mut().zip(&wanted.at) {
        *axis = degrees;
    }
    Ok(CitySpec {
        seed: wanted.seed,
        anchor,
        site,
        change_share: wanted.changes,
        during_share: wanted.during,
        vehicles: wanted.vehicles,
        drives: drives.unwrap_or_else(|| wanted.vehicles.saturating_add(wanted.vehicles / 2)),
        drive_km: wanted.drive_km,
        days: wanted.days,
        profile: match wanted.profile {
            ProfileName::Detections => LogProfile::Detections,
            ProfileName::Camera => LogProfile::Camera,
        },
        noise: wanted.noise.clone(),
        matching_truth: wanted.matching_truth,
    })
}

fn summary(files: &CityFiles) -> serde_json::Value {
    json!({
        "before_map": files.before_map,
        "after_map": files.after_map,
        "truth": files.truth,
        "history": files.history,
        "logs": files.logs,
    })
}
