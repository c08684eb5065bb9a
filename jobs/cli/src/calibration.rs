//! `calibrate`: what the fit of the sensor model found, as a table or JSON.

use std::error::Error;
use std::path::Path;

use tilefold_engine::calibrate;
use tilefold_engine::calibrate::{Calibration, Fitted, Outstanding};

use crate::args::Args;
use crate::report::{Outcome, print};
use crate::{progress, table};

/// Fits, folds anew, and says what changed.
///
/// # Errors
/// As [`tilefold_engine::calibrate()`].
pub(crate) fn calibrate_store(args: &Args, store: &Path) -> Result<Outcome, Box<dyn Error>> {
    let progress = progress::listener(args.progress);
    let found = calibrate(store, progress.as_ref())?;
    print(args, &found, text)?;
    Ok(Outcome::Done)
}

fn text(found: &Calibration) -> String {
    let parameter = |fitted: &Fitted| {
        let at = match fitted.visibility > 0.0 {
            true => format!("{} at V = {:.2}", fitted.parameter, fitted.visibility),
            false => fitted.parameter.clone(),
        };
        let number = |value: f64| format!("{value:.3}");
        vec![at, number(fitted.built_in), number(fitted.fitted)]
    };
    let parameters = table::rows(
        &["parameter", "built in", "fitted"],
        found.parameters.iter().map(parameter),
    );
    let vehicle = |vehicle: &Outstanding| {
        vec![
            format!("{:016x}", vehicle.vehicle),
            format!("{:.2}", vehicle.detection),
            format!("{:.2}", vehicle.absent),
            format!("{:.2}", vehicle.sigma),
        ]
    };
    let outstanding = match found.outstanding.is_empty() {
        true => "no vehicle stands out from its fleet".to_owned(),
        false => format!(
            "vehicles that are believed less:\n{}",
            table::rows(
                &[
                    "vehicle",
                    "sees, of its fleet",
                    "sees what is gone",
                    "spread, of its fleet"
                ],
                found.outstanding.iter().map(vehicle),
            )
        ),
    };
    format!(
        "{parameters}\n{outstanding}\nversion {}: {} tiles folded with sensor model {:016x}",
        found.version, found.tiles_reduced, found.sensor_model
    )
}
