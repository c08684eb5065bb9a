//! The layer of a version as the page reads it: one column a property, so that a hundred thousand
//! changes are one quick JSON value.
//!
//! What has not changed is counted and left out. Codes stay codes; [`Names`] says what they mean.

use std::collections::BTreeMap;

use serde::Serialize;
use tilefold_engine::regions;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{
    ChangeRecord, ElementKind, LayerHeader, Marking, Region, SignClass, Verdict, wkb,
};
use tilefold_store::{Snapshot, TileFilter};

use crate::error::ReviewError;

/// Parts of a degree in which geometry is written: about a millimetre.
const PARTS: f64 = 1e8;
const SECOND_NS: i64 = 1_000_000_000;

/// What the codes stand for, by their position.
#[derive(Debug, Serialize)]
pub(crate) struct Names {
    verdicts: Vec<&'static str>,
    kinds: Vec<&'static str>,
    markings: Vec<&'static str>,
    signs: Vec<&'static str>,
}

impl Names {
    pub(crate) fn all() -> Self {
        Self {
            verdicts: Verdict::ALL.iter().map(|of| of.name()).collect(),
            kinds: ElementKind::ALL.iter().map(|of| of.name()).collect(),
            markings: Marking::ALL.iter().map(|of| of.name()).collect(),
            signs: SignClass::ALL.iter().map(|of| of.name()).collect(),
        }
    }
}

/// `[is_area, longitude, latitude, steps to the next vertices...]` in 1e-8 degrees.
type Steps = Vec<i64>;

/// The records of a version that are not "no change", a column a property.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Layer {
    version: i64,
    fusion_model: String,
    /// Records of each verdict, by its code.
    counts: Vec<usize>,
    change: Vec<String>,
    element: Vec<Option<i64>>,
    tile: Vec<i32>,
    kind: Vec<i16>,
    verdict: Vec<i16>,
    /// Of no change, added, removed, modified, in thousandths.
    posterior: Vec<[i32; 4]>,
    from_m: Vec<f64>,
    to_m: Vec<f64>,
    vehicles: Vec<i32>,
    passes: Vec<i32>,
    exposed: Vec<i64>,
    hit: Vec<i64>,
    first_s: Vec<i64>,
    last_s: Vec<i64>,
    changed_after_s: Vec<Option<i64>>,
    changed_before_s: Vec<Option<i64>>,
    shift_m: Vec<Option<f64>>,
    shift_sigma_m: Vec<Option<f64>>,
    /// Marking of a line, or class of a ground sign: in the map, and as most observed.
    class_mapped: Vec<Option<i16>>,
    class_observed: Vec<Option<i16>>,
    /// Position in `regions`.
    region: Vec<Option<usize>>,
    old: Vec<Option<Steps>>,
    new: Vec<Option<Steps>>,
    regions: Vec<RegionShown>,
}

#[derive(Debug, Serialize)]
struct RegionShown {
    id: String,
    summary: String,
    since_s: Option<i64>,
    changes: usize,
    outline: Vec<[f64; 2]>,
}

/// What a decision is about.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Subject {
    pub(crate) element: Option<i64>,
    pub(crate) verdict: Verdict,
}

impl Layer {
    /// Reads the layer of a version.
    pub(crate) fn read(snapshot: &Snapshot) -> Result<Self, ReviewError> {
        let headers: Vec<LayerHeader> = snapshot.read(TileFilter::All)?;
        let Some(header) = headers.first() else {
            return Err(ReviewError::NoLayers {
                location: snapshot.store().location(),
                version: snapshot.version(),
            });
        };
        let mut layer = Self {
            version: snapshot.version(),
            fusion_model: header.fusion_model.clone(),
            counts: vec![0; Verdict::ALL.len()],
            ..Self::default()
        };
        let mut records: Vec<ChangeRecord> = snapshot.read(TileFilter::All)?;
        for record in &records {
            if let Some(count) = layer
                .counts
                .get_mut(usize::try_from(record.verdict).unwrap_or(0))
            {
                *count += 1;
            }
        }
        records.retain(|record| record.verdict != Verdict::NoChange.code());
        let mapped = classes(snapshot)?;
        let mut regions = regions(&records);
        // A change alone is no more with a line around it.
        regions.retain(|region| region.changes.len() > 1);
        let region_of: BTreeMap<i64, usize> = regions
            .iter()
            .enumerate()
            .flat_map(|(index, region)| region.changes.iter().map(move |&id| (id, index)))
            .collect();
        for record in &records {
            layer.add(record, &mapped, region_of.get(&record.change).copied())?;
        }
        layer.regions = regions.iter().map(shown).collect();
        Ok(layer)
    }

    fn add(
        &mut self,
        record: &ChangeRecord,
        mapped: &BTreeMap<i64, i16>,
        region: Option<usize>,
    ) -> Result<(), ReviewError> {
        self.change.push(hex(record.change));
        self.element.push(record.element);
        self.tile.push(record.tile);
        self.kind.push(record.kind);
        self.verdict.push(record.verdict);
        let posterior = [
            record.p_no_change,
            record.p_added,
            record.p_removed,
            record.p_modified,
        ];
        self.posterior
            .push(posterior.map(|p| (p * 1000.0).round() as i32));
        self.from_m.push(rounded(record.from_m));
        self.to_m.push(rounded(record.to_m));
        self.vehicles.push(record.vehicles);
        self.passes.push(record.passes);
        self.exposed.push(record.exposed);
        self.hit.push(record.hit);
        self.first_s.push(record.first_ns / SECOND_NS);
        self.last_s.push(record.last_ns / SECOND_NS);
        let seconds = |stamp_ns: Option<i64>| stamp_ns.map(|stamp_ns| stamp_ns / SECOND_NS);
        self.changed_after_s.push(seconds(record.changed_after_ns));
        self.changed_before_s
            .push(seconds(record.changed_before_ns));
        self.shift_m.push(record.shift_m.map(rounded));
        self.shift_sigma_m.push(record.shift_sigma_m.map(rounded));
        let class = record.element.and_then(|element| mapped.get(&element));
        self.class_mapped.push(class.copied());
        self.class_observed.push(record.class_observed);
        self.region.push(region);
        self.old
            .push(steps(record, record.geometry_old.as_deref())?);
        self.new
            .push(steps(record, record.geometry_new.as_deref())?);
        Ok(())
    }

    /// What there is to decide on, by id.
    pub(crate) fn subjects(&self) -> BTreeMap<String, Subject> {
        let rows = self.change.iter().zip(&self.element).zip(&self.verdict);
        rows.map(|((change, element), verdict)| {
            let verdict = Verdict::from_code(*verdict).unwrap_or_default();
            let element = *element;
            (change.clone(), Subject { element, verdict })
        })
        .collect()
    }

    /// Ids of the records that claim a change, by tile.
    pub(crate) fn claims(&self) -> BTreeMap<i32, Vec<&str>> {
        let mut by_tile: BTreeMap<i32, Vec<&str>> = BTreeMap::new();
        for (index, verdict) in self.verdict.iter().enumerate() {
            if Verdict::from_code(*verdict).is_some_and(Verdict::is_change) {
                let tile = by_tile.entry(self.tile[index]).or_default();
                tile.push(&self.change[index]);
            }
        }
        by_tile
    }

    /// Records in it.
    pub(crate) fn len(&self) -> usize {
        self.change.len()
    }
}

pub(crate) fn hex(id: i64) -> String {
    format!("{id:016x}")
}

/// To the centimetre; what is not finite is 0.
fn rounded(metres: f64) -> f64 {
    match metres.is_finite() {
        true => (metres * 100.0).round() / 100.0,
        false => 0.0,
    }
}

/// To 1e-7 degrees: a centimetre.
fn shorter(degrees: f64) -> f64 {
    (degrees * 1e7).round() / 1e7
}

/// Marking of each line and class of each ground sign of the map, by element.
fn classes(snapshot: &Snapshot) -> Result<BTreeMap<i64, i16>, ReviewError> {
    let elements: Vec<ElementRow> = snapshot.read(TileFilter::All)?;
    let class = |row: ElementRow| match ElementKind::from_code(row.kind)? {
        ElementKind::LaneMarking => Some((row.element, row.marking)),
        ElementKind::GroundSign => Some((row.element, row.sign)),
        ElementKind::StopLine | ElementKind::Crosswalk => None,
    };
    Ok(elements.into_iter().filter_map(class).collect())
}

fn steps(record: &ChangeRecord, bytes: Option<&[u8]>) -> Result<Option<Steps>, ReviewError> {
    let read = bytes.map(wkb::read).transpose();
    let geometry = read.map_err(|error| ReviewError::Damaged {
        change: record.change,
        reason: error.to_string(),
    })?;
    let Some(geometry) = geometry else {
        return Ok(None);
    };
    let mut steps = vec![i64::from(geometry.is_area)];
    let mut before = [0, 0];
    for point in &geometry.points {
        for (axis, before) in before.iter_mut().enumerate() {
            let value = (point[axis] * PARTS).round() as i64;
            steps.push(value - *before);
            *before = value;
        }
    }
    Ok(Some(steps))
}

fn shown(region: &Region) -> RegionShown {
    RegionShown {
        id: hex(region.id),
        summary: region.summary(),
        since_s: region.since_ns.map(|stamp_ns| stamp_ns / SECOND_NS),
        changes: region.changes.len(),
        outline: region.outline.iter().map(|at| at.map(shorter)).collect(),
    }
}
