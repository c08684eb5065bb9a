//! Why an export could not be written.

use crate::geojson::GeoJsonError;
use crate::log_write::LogWriteError;

/// Why an export could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A record that cannot be told, or an output that takes no bytes.
    #[error(transparent)]
    Changes(#[from] GeoJsonError),
    /// An element of the map whose geometry is none.
    #[error("element {element}: its geometry is {source}; run `verify` on the store")]
    Element {
        /// The element.
        element: i64,
        /// What is wrong with it.
        source: tilefold_schemas::wkb::WkbError,
    },
    /// The output did not take the bytes.
    #[error("cannot write the export: {0}; check the disk, then write it again")]
    Write(#[from] std::io::Error),
    /// A library that encodes the format refused.
    #[error("cannot encode {format}: {why}; check the disk, then write it again")]
    Encode {
        /// The format.
        format: &'static str,
        /// What the library says.
        why: String,
    },
    /// A message of the scene.
    #[error(transparent)]
    Scene(#[from] LogWriteError),
}

impl ExportError {
    pub(super) fn encode(format: &'static str) -> impl Fn(&dyn std::fmt::Display) -> Self {
        move |why| Self::Encode {
            format,
            why: why.to_string(),
        }
    }
}
