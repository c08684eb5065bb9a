//! A job's stages as a picture: how long threads were busy in each, and at what rate.

use std::path::{Path, PathBuf};

use crate::error::EngineError;
use crate::meter::StageReport;
use crate::picture::bars::{Bar, bars};

/// Writes `stages` as SVG and PNG into `folder`, which is made if need be.
///
/// # Errors
/// The folder cannot be written.
pub fn write(folder: &Path, stages: &[StageReport]) -> Result<Vec<PathBuf>, EngineError> {
    let drawn: Vec<Bar> = stages.iter().map(bar).collect();
    let picture = bars("busy seconds of all threads", &drawn);
    let written = std::fs::create_dir_all(folder).and_then(|()| picture.write(folder, "stages"));
    let files = written.map_err(|source| EngineError::Picture {
        path: folder.to_owned(),
        source,
    })?;
    Ok(files.to_vec())
}

fn bar(stage: &StageReport) -> Bar {
    Bar {
        name: stage.stage.to_owned(),
        value: stage.busy_s,
        figure: format!(
            "{:.2} s, {:.0} {}/s",
            stage.busy_s, stage.items_per_busy_s, stage.unit
        ),
    }
}
