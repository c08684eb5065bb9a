//! A change record with its codes and its geometry read.

use tilefold_schemas::wkb::{self, Geometry};
use tilefold_schemas::{ChangeRecord, ElementKind, Verdict};

use crate::geojson::GeoJsonError;

/// A record and what its columns stand for.
#[derive(Debug)]
pub(crate) struct Change<'a> {
    pub(crate) record: &'a ChangeRecord,
    pub(crate) verdict: Verdict,
    pub(crate) kind: ElementKind,
    /// Where the thing is on the road (`added`, `modified`) or was in the map (all others),
    /// whichever is known.
    pub(crate) geometry: Option<Geometry>,
}

impl<'a> Change<'a> {
    pub(crate) fn of(record: &'a ChangeRecord) -> Result<Self, GeoJsonError> {
        let unknown = |field, code| GeoJsonError::Code {
            change: record.change,
            field,
            code,
        };
        let verdict =
            Verdict::from_code(record.verdict).ok_or_else(|| unknown("verdict", record.verdict))?;
        let kind =
            ElementKind::from_code(record.kind).ok_or_else(|| unknown("kind", record.kind))?;
        Ok(Self {
            record,
            verdict,
            kind,
            geometry: geometry(record, verdict)?,
        })
    }

    /// Posterior of what is said of it.
    pub(crate) fn posterior(&self) -> f64 {
        match self.verdict {
            Verdict::Added => self.record.p_added,
            Verdict::Removed => self.record.p_removed,
            Verdict::Modified => self.record.p_modified,
            Verdict::NoChange | Verdict::Unknown | Verdict::Stale => self.record.p_no_change,
        }
    }
}

fn geometry(record: &ChangeRecord, verdict: Verdict) -> Result<Option<Geometry>, GeoJsonError> {
    let [old, new] = [
        record.geometry_old.as_deref(),
        record.geometry_new.as_deref(),
    ];
    let is_on_the_road = matches!(verdict, Verdict::Added | Verdict::Modified);
    let bytes = match is_on_the_road {
        true => new.or(old),
        false => old.or(new),
    };
    let read = bytes.map(wkb::read).transpose();
    read.map_err(|source| GeoJsonError::Geometry {
        change: record.change,
        source,
    })
}
