//! `explain`: why a version says what it says of a change or an element.
//!
//! The element, or the candidate, is folded once more by the functions that made the layer; what
//! every pass adds comes from there. Where the result differs from what the layer holds, the
//! explanation says so.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;
use tilefold_reducers::explain::{Explained, Weight};
use tilefold_reducers::flip::{self, Flip};
use tilefold_reducers::moved::{self, Gone};
use tilefold_reducers::{Fold, FusionModel, area_candidates, candidates, elements, stale};
use tilefold_schemas::{
    ChangeRecord, ChunkRow, ElementKind, EvidenceRow, Footprint, LayerHeader, Marking, Sighting,
    SignClass, TileId, Verdict, fixed,
};
use tilefold_store::{Snapshot, TileFilter};
use tilefold_tiler::chunk::window_of;
use tilefold_tiler::map_index::{MapIndex, MappedElement};

use crate::calibrate::{self, sensor_model};
use crate::error::EngineError;
use crate::run::{AS_OF, read_elements};

/// Looks of one vehicle that are farther apart are two passes.
const GAP_NS: i64 = 30_000_000_000;
/// Frames that are named for, and against.
const FRAMES: usize = 3;
/// Ids that are named where one is not known.
const NEAREST: usize = 3;

/// Why a record says what it says. Nats are natural logarithms of odds; stations are metres along
/// the element; times are nanoseconds since the Unix epoch.
#[derive(Debug, Clone, Serialize)]
pub struct Explanation {
    /// Version of the store.
    pub version: i64,
    /// Id of the change, hexadecimal.
    pub change: String,
    /// Map element; null for an addition.
    pub element: Option<i64>,
    /// What it is.
    pub kind: &'static str,
    /// What is said of it.
    pub verdict: &'static str,
    /// Where the stretch begins.
    pub from_m: f64,
    /// Where it ends.
    pub to_m: f64,
    /// Fusion model.
    pub fusion_model: String,
    /// Sensor model, hexadecimal.
    pub sensor_model: String,
    /// Posterior of no change, added, removed, modified.
    pub posterior: [f64; 4],
    /// The likeliest change: what `for_change` speaks for.
    pub likeliest_change: &'static str,
    /// Log-odds of change against no change.
    pub log_odds: f64,
    /// What the passes say together, in nats: the sum of `for_change` over them.
    pub evidence: f64,
    /// The same in 2^-24 nats, as the record has it: the integers add up.
    pub evidence_fx: i64,
    /// What prior, neighbouring stretches and the number of possible places say.
    pub rest: f64,
    /// Whether folding once more gave the record that the layer holds.
    pub agrees: bool,
    /// Last look at the state before the change, where it changed while it was observed.
    pub changed_after_ns: Option<i64>,
    /// First look at the state after it.
    pub changed_before_ns: Option<i64>,
    /// Passes that count, those that say most first.
    pub passes: Vec<PassSays>,
    /// Vehicles that are believed less than their fleet, and why.
    pub believed_less: Vec<BelievedLess>,
    /// What would flip the verdict; null if many passes would not.
    pub flip: Option<WouldFlip>,
    /// The frames to look at.
    pub frames: Vec<Frame>,
}

/// What one pass says.
#[derive(Debug, Clone, Serialize)]
pub struct PassSays {
    /// Keyed hash of the vehicle, hexadecimal.
    pub vehicle: String,
    /// Log of the clearest frame; null if the store does not know it.
    pub log: Option<String>,
    /// Its camera or detection channel.
    pub topic: Option<String>,
    /// First look.
    pub first_ns: i64,
    /// Last look.
    pub last_ns: i64,
    /// Clearest frame.
    pub best_ns: i64,
    /// Looks: frames, over all sections of the stretch.
    pub exposed: i64,
    /// Looks that matched the element.
    pub hit: i64,
    /// Mean lateral residual of the matches, positive to the left, in metres.
    pub residual_m: Option<f64>,
    /// Marking or class that it read.
    pub read: Option<&'static str>,
    /// Whether it sighted what the map lacks; null for mapped elements.
    pub sighted: Option<bool>,
    /// Log-likelihoods of no change, added, removed, modified.
    pub nats: [f64; 4],
    /// What it adds to the evidence for the likeliest change.
    pub for_change: f64,
    /// The same in 2^-24 nats.
    pub for_change_fx: i64,
    /// Why, in words.
    pub why: String,
}

/// A vehicle that is believed less.
#[derive(Debug, Clone, Serialize)]
pub struct BelievedLess {
    /// Keyed hash, hexadecimal.
    pub vehicle: String,
    /// What its sensor model says.
    pub why: String,
}

/// What would flip a verdict.
#[derive(Debug, Clone, Serialize)]
pub struct WouldFlip {
    /// Passes, each of a vehicle that never came before.
    pub passes: i64,
    /// Whether they see the element as mapped, or nothing.
    pub see_it: bool,
    /// What is said then.
    pub verdict: &'static str,
}

/// A frame to look at.
#[derive(Debug, Clone, Serialize)]
pub struct Frame {
    /// Capture time.
    pub stamp_ns: i64,
    /// Log file; null if the store does not know it.
    pub log: Option<String>,
    /// Camera or detection channel.
    pub topic: Option<String>,
    /// Keyed hash of the vehicle, hexadecimal.
    pub vehicle: String,
    /// What its pass adds to the evidence for the change, in nats.
    pub for_change: f64,
}

/// Explains what a version says of a change (16 hexadecimal digits) or of an element (its id in
/// the map): one explanation a record.
///
/// # Errors
/// The store is damaged, or knows nothing of that id.
pub fn explain(snapshot: &Snapshot, id: &str) -> Result<Vec<Explanation>, EngineError> {
    Explainer::read(snapshot)?.explain(id)
}

fn is(record: &ChangeRecord, id: &str) -> bool {
    hex(record.change) == id.to_lowercase()
        || record
            .element
            .is_some_and(|element| element.to_string() == id)
}

fn hex(id: i64) -> String {
    format!("{id:016x}")
}

/// Names the ids that look most like the one that nothing has.
fn unknown(snapshot: &Snapshot, records: &[ChangeRecord], id: &str) -> EngineError {
    let common = |text: &str| {
        text.chars()
            .zip(id.chars())
            .take_while(|(a, b)| a == b)
            .count()
    };
    let of = |record: &ChangeRecord| {
        let element = record.element.map(|element| element.to_string());
        [Some(hex(record.change)), element]
    };
    let known: BTreeSet<String> = records.iter().flat_map(of).flatten().collect();
    let mut known: Vec<String> = known.into_iter().collect();
    known.sort_by_key(|text| {
        let lengths_differ = text.len().abs_diff(id.len());
        (
            std::cmp::Reverse(common(text)),
            lengths_differ,
            text.clone(),
        )
    });
    known.truncate(NEAREST);
    EngineError::UnknownChange {
        id: id.to_owned(),
        version: snapshot.version(),
        nearest: known.join(", "),
    }
}

/// A version, read once to explain many of its records: the map and the records are kept, and so
/// are the candidates once they have been folded.
#[derive(Debug)]
pub struct Explainer {
    snapshot: Snapshot,
    records: Vec<ChangeRecord>,
    headers: BTreeMap<i32, LayerHeader>,
    map: MapIndex,
    tile_level: u32,
    chunks: Vec<ChunkRow>,
    /// By the name of the fusion model.
    additions: Mutex<BTreeMap<&'static str, Arc<Vec<Explained>>>>,
    /// The ledger rows of the tile that was asked for last.
    rows: Mutex<Option<(TileId, Arc<Vec<EvidenceRow>>)>>,
}

impl Explainer {
    /// Reads a version.
    ///
    /// # Errors
    /// The store is damaged.
    pub fn read(snapshot: &Snapshot) -> Result<Self, EngineError> {
        let tile_level = u32::from(snapshot.store().properties().tile_level);
        let headers: Vec<LayerHeader> = snapshot.read(TileFilter::All)?;
        Ok(Self {
            snapshot: snapshot.clone(),
            records: snapshot.read(TileFilter::All)?,
            headers: headers
                .into_iter()
                .map(|header| (header.tile, header))
                .collect(),
            map: MapIndex::new(read_elements(snapshot, tile_level)?),
            tile_level,
            chunks: snapshot.read(TileFilter::All)?,
            additions: Mutex::default(),
            rows: Mutex::default(),
        })
    }

    /// As [`explain()`].
    ///
    /// # Errors
    /// The store is damaged, or knows nothing of that id.
    pub fn explain(&self, id: &str) -> Result<Vec<Explanation>, EngineError> {
        let asked = self.records.iter().filter(|record| is(record, id));
        let explained: Vec<Explanation> = asked
            .map(|stored| self.explain_record(stored))
            .collect::<Result<_, _>>()?;
        match explained.is_empty() {
            true => Err(unknown(&self.snapshot, &self.records, id)),
            false => Ok(explained),
        }
    }

    /// How the layer with a record was folded.
    fn fold(&self, record: &ChangeRecord) -> Result<Fold, EngineError> {
        let is_model = |model: &FusionModel| model.name() == record.fusion_model;
        let model = FusionModel::ALL
            .into_iter()
            .find(is_model)
            .unwrap_or_default();
        let as_of_ns = self.snapshot.info().parameters.get(AS_OF);
        Ok(Fold {
            as_of_ns: as_of_ns.and_then(serde_json::Value::as_i64),
            ..Fold::of_fleet(model, sensor_model(&self.snapshot)?)
        })
    }

    fn explain_record(&self, stored: &ChangeRecord) -> Result<Explanation, EngineError> {
        let fold = self.fold(stored)?;
        let (explained, flip) = match self.element(stored) {
            Some(mapped) => self.explain_element(mapped, stored, &fold)?,
            None => self.explain_addition(stored, &fold)?,
        };
        Ok(self.told(stored, explained, flip, &fold))
    }

    fn element(&self, record: &ChangeRecord) -> Option<&MappedElement> {
        let id = record.element?;
        self.map
            .elements()
            .iter()
            .find(|mapped| mapped.element.id.0 == id)
    }

    /// Ledger rows of an element that count.
    fn rows_of(
        &self,
        mapped: &MappedElement,
        fold: &Fold,
    ) -> Result<Vec<EvidenceRow>, EngineError> {
        let is_its =
            |row: &&EvidenceRow| row.element == mapped.element.id.0 && fold.counts(row.first_ns());
        let rows = self.rows_in(mapped.tile)?;
        Ok(rows.iter().filter(is_its).cloned().collect())
    }

    /// Ledger rows of a tile. Who asks for the changes of one tile after the other reads each once.
    fn rows_in(&self, tile: TileId) -> Result<Arc<Vec<EvidenceRow>>, EngineError> {
        let mut kept = self.rows.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, rows)) = &*kept
            && *of == tile
        {
            return Ok(rows.clone());
        }
        let tiles = BTreeSet::from([tile]);
        let rows = Arc::new(self.snapshot.read(TileFilter::Tiles(&tiles))?);
        *kept = Some((tile, Arc::clone(&rows)));
        Ok(rows)
    }

    fn explain_element(
        &self,
        mapped: &MappedElement,
        stored: &ChangeRecord,
        fold: &Fold,
    ) -> Result<Folded, EngineError> {
        let rows = self.rows_of(mapped, fold)?;
        let rows: Vec<&EvidenceRow> = rows.iter().collect();
        let all = elements::explain(mapped, &rows, fold);
        let same = |explained: &Explained| explained.record.change == stored.change;
        let Some(mut explained) = all.into_iter().find(same) else {
            return Ok((None, None));
        };
        // A line that is gone, with a new one beside it, was moved.
        if explained.record.verdict == Verdict::Removed.code()
            && explained.record.kind == ElementKind::LaneMarking.code()
        {
            self.link(&mut explained, fold)?;
        }
        let flip = flip::flip(mapped, &rows, fold, &explained.record);
        Ok((Some(explained), flip.map(WouldFlip::from)))
    }

    fn link(&self, explained: &mut Explained, fold: &Fold) -> Result<(), EngineError> {
        let additions = self.additions(fold)?;
        let mut left: Vec<ChangeRecord> =
            additions.iter().map(|added| added.record.clone()).collect();
        let mut linked = [explained.record.clone()];
        moved::link(&mut linked, &mut left);
        let is_left = |added: &Explained| left.contains(&added.record);
        if let Some(index) = additions.iter().position(|added| !is_left(added)) {
            let [linked] = linked;
            explained.link(linked, additions[index].clone());
        }
        Ok(())
    }

    fn explain_addition(&self, stored: &ChangeRecord, fold: &Fold) -> Result<Folded, EngineError> {
        let is = |added: &Explained| added.record.change == stored.change;
        let Some(explained) = self
            .additions(fold)?
            .iter()
            .find(|added| is(added))
            .cloned()
        else {
            return Ok((None, None));
        };
        let passes = match explained.record.kind == ElementKind::LaneMarking.code() {
            true => candidates::misses_to_flip(&explained.record),
            false => area_candidates::misses_to_flip(&explained.record),
        };
        let flip = WouldFlip {
            passes: i64::from(passes),
            see_it: false,
            verdict: Verdict::NoChange.name(),
        };
        Ok((Some(explained), Some(flip)))
    }

    /// All additions, as the reduce stage judges them; folded once.
    fn additions(&self, fold: &Fold) -> Result<Arc<Vec<Explained>>, EngineError> {
        let name = fold.model.name();
        let mut kept = self
            .additions
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some(additions) = kept.get(name) {
            return Ok(additions.clone());
        }
        let additions = Arc::new(self.fold_additions(fold)?);
        kept.insert(name, Arc::clone(&additions));
        Ok(additions)
    }

    fn fold_additions(&self, fold: &Fold) -> Result<Vec<Explained>, EngineError> {
        let mut seen: Vec<Sighting> = self.snapshot.read(TileFilter::All)?;
        seen.retain(|seen| fold.counts(seen.first_ns()));
        let mut looks: Vec<Footprint> = self.snapshot.read(TileFilter::All)?;
        looks.retain(|look| fold.counts(look.at_ns()));
        let gone = self.gone(fold)?;
        let (map, level) = (&self.map, self.tile_level);
        let mut all = candidates::explain(&seen, &looks, map, &gone, level, fold);
        all.extend(area_candidates::explain(&seen, &looks, map, level, fold));
        Ok(all)
    }

    /// Where lines were judged gone, before any was linked with a new line or called stale.
    fn gone(&self, fold: &Fold) -> Result<Gone, EngineError> {
        let may_be_gone = [Verdict::Removed, Verdict::Modified, Verdict::Stale].map(Verdict::code);
        let of_lines = self.records.iter().filter(|record| {
            record.kind == ElementKind::LaneMarking.code() && may_be_gone.contains(&record.verdict)
        });
        let ids: BTreeSet<i64> = of_lines.filter_map(|record| record.element).collect();
        let lines = || {
            let all = self.map.elements().iter();
            all.filter(|mapped| ids.contains(&mapped.element.id.0))
        };
        let tiles: BTreeSet<TileId> = lines().map(|mapped| mapped.tile).collect();
        let rows: Vec<EvidenceRow> = self.snapshot.read(TileFilter::Tiles(&tiles))?;
        let mut by_element: BTreeMap<i64, Vec<&EvidenceRow>> = BTreeMap::new();
        for row in rows.iter().filter(|row| fold.counts(row.first_ns())) {
            by_element.entry(row.element).or_default().push(row);
        }
        let judged: Vec<ChangeRecord> = lines()
            .filter_map(|mapped| {
                let rows = by_element.get(&mapped.element.id.0)?;
                Some(elements::judge(mapped, rows, fold))
            })
            .flatten()
            .collect();
        Ok(Gone::of(&judged))
    }

    /// The explanation in the words of a report.
    fn told(
        &self,
        stored: &ChangeRecord,
        explained: Option<Explained>,
        flip: Option<WouldFlip>,
        fold: &Fold,
    ) -> Explanation {
        let header = self.headers.get(&stored.tile);
        let mut folded = explained.as_ref().map(|explained| explained.record.clone());
        if let (Some(folded), Some(header)) = (&mut folded, header) {
            stale::mark(std::slice::from_mut(folded), header.as_of_ns);
        }
        let passes = explained.map_or_else(Vec::new, |explained| self.passes(&explained));
        let vehicles: BTreeSet<&String> = passes.iter().map(|pass| &pass.vehicle).collect();
        let noted = fold.sensor.vehicles.iter().filter_map(|(&key, model)| {
            let why = calibrate::believed_less(model)?;
            let vehicle = hex(key);
            vehicles
                .contains(&vehicle)
                .then_some(BelievedLess { vehicle, why })
        });
        let evidence = fixed::to_f64(stored.evidence_fx);
        let changes = [
            (stored.p_added, Verdict::Added),
            (stored.p_removed, Verdict::Removed),
            (stored.p_modified, Verdict::Modified),
        ];
        let likeliest = changes.into_iter().rev().max_by(|a, b| a.0.total_cmp(&b.0));
        Explanation {
            version: self.snapshot.version(),
            change: hex(stored.change),
            element: stored.element,
            kind: ElementKind::from_code(stored.kind).map_or("unknown", ElementKind::name),
            verdict: Verdict::from_code(stored.verdict).map_or("unknown", Verdict::name),
            from_m: stored.from_m,
            to_m: stored.to_m,
            fusion_model: stored.fusion_model.clone(),
            sensor_model: hex(header.map_or(0, |header| header.sensor_model)),
            posterior: [
                stored.p_no_change,
                stored.p_added,
                stored.p_removed,
                stored.p_modified,
            ],
            likeliest_change: likeliest.map_or("unknown", |(_, verdict)| verdict.name()),
            log_odds: stored.log_odds,
            evidence,
            evidence_fx: stored.evidence_fx,
            rest: stored.log_odds - evidence,
            agrees: folded.as_ref() == Some(stored),
            changed_after_ns: stored.changed_after_ns,
            changed_before_ns: stored.changed_before_ns,
            believed_less: noted.collect(),
            frames: Self::frames(&passes),
            passes,
            flip,
        }
    }

    /// Weights as passes: looks of one vehicle that lie near each other in time.
    fn passes(&self, explained: &Explained) -> Vec<PassSays> {
        let mut weights: Vec<&Weight> = explained.weights.iter().collect();
        weights.sort_by_key(|weight| (weight.vehicle, weight.first_ns));
        let mut passes: Vec<Vec<&Weight>> = Vec::new();
        for weight in weights {
            let is_same = |last: &Vec<&Weight>| {
                let until_ns = last
                    .iter()
                    .map(|known| known.last_ns)
                    .max()
                    .unwrap_or(i64::MIN);
                last[0].vehicle == weight.vehicle
                    && weight.first_ns <= until_ns.saturating_add(GAP_NS)
            };
            match passes.last_mut() {
                Some(last) if is_same(last) => last.push(weight),
                _ => passes.push(vec![weight]),
            }
        }
        let mut passes: Vec<PassSays> = passes
            .iter()
            .map(|weights| self.pass(weights, explained))
            .collect();
        passes.sort_by_key(|pass| {
            let most = std::cmp::Reverse(pass.for_change_fx.abs());
            (most, pass.first_ns, pass.vehicle.clone())
        });
        passes
    }

    fn pass(&self, weights: &[&Weight], explained: &Explained) -> PassSays {
        let sum = |of: fn(&Weight) -> i64| -> i64 { weights.iter().map(|weight| of(weight)).sum() };
        let best = weights.iter().max_by(|a, b| {
            let clearer = a.visibility.total_cmp(&b.visibility);
            clearer.then(b.best_ns.cmp(&a.best_ns))
        });
        let best_ns = best.map_or(0, |best| best.best_ns);
        let vehicle = weights[0].vehicle;
        let chunk = self.chunk(vehicle, best_ns);
        let for_change_fx = weights
            .iter()
            .map(|weight| explained.evidence_fx(weight))
            .sum();
        let nats_fx = |of: usize| weights.iter().map(|weight| weight.nats_fx[of]).sum();
        // A vote is made of all readings of a pass, and says more than those of one section.
        let votes = weights.iter().filter(|weight| weight.exposed == 0);
        let read = votes.chain(weights).find_map(|weight| weight.read);
        let kind = ElementKind::from_code(explained.record.kind);
        let mut pass = PassSays {
            vehicle: hex(vehicle),
            log: chunk.map(|chunk| chunk.log.clone()),
            topic: chunk.map(|chunk| chunk.topic.clone()),
            first_ns: weights
                .iter()
                .map(|weight| weight.first_ns)
                .min()
                .unwrap_or(0),
            last_ns: weights
                .iter()
                .map(|weight| weight.last_ns)
                .max()
                .unwrap_or(0),
            best_ns,
            exposed: sum(|weight| weight.exposed),
            hit: sum(|weight| weight.hit),
            residual_m: residual_m(weights),
            read: read.and_then(|code| class_name(kind, code)),
            sighted: weights.iter().filter_map(|weight| weight.sighted).max(),
            nats: std::array::from_fn(|of| fixed::to_f64(nats_fx(of))),
            for_change: fixed::to_f64(for_change_fx),
            for_change_fx,
            why: String::new(),
        };
        pass.why = why(&pass);
        pass
    }

    /// The chunk of a vehicle that has a frame of that time.
    fn chunk(&self, vehicle: i64, stamp_ns: i64) -> Option<&ChunkRow> {
        let of_vehicle = self.chunks.iter().filter(|chunk| chunk.vehicle == vehicle);
        of_vehicle
            .filter(|chunk| chunk.window == window_of(stamp_ns))
            .min_by_key(|chunk| (chunk.channel, chunk.window))
    }

    /// The clearest frames of the passes that say most, for and against.
    fn frames(passes: &[PassSays]) -> Vec<Frame> {
        let with = |sign: i64| {
            let of_sign = passes
                .iter()
                .filter(move |pass| pass.for_change_fx * sign > 0);
            of_sign.take(FRAMES)
        };
        let frame = |pass: &PassSays| Frame {
            stamp_ns: pass.best_ns,
            log: pass.log.clone(),
            topic: pass.topic.clone(),
            vehicle: pass.vehicle.clone(),
            for_change: pass.for_change,
        };
        with(1).chain(with(-1)).map(frame).collect()
    }
}

/// What folding once more gave, if anything.
type Folded = (Option<Explained>, Option<WouldFlip>);

impl From<Flip> for WouldFlip {
    fn from(flip: Flip) -> Self {
        Self {
            passes: flip.passes,
            see_it: flip.see_it,
            verdict: flip.verdict.name(),
        }
    }
}

/// Mean residual over matched frames, in metres.
fn residual_m(weights: &[&Weight]) -> Option<f64> {
    let (mut sum, mut hits) = (0.0, 0.0);
    for weight in weights {
        if let Some(residual_m) = weight.residual_m {
            sum += weight.hit as f64 * residual_m;
            hits += weight.hit as f64;
        }
    }
    (hits > 0.0).then(|| sum / hits)
}

fn class_name(kind: Option<ElementKind>, code: i16) -> Option<&'static str> {
    match kind? {
        ElementKind::LaneMarking => Marking::from_code(code).map(Marking::name),
        ElementKind::GroundSign => SignClass::from_code(code).map(SignClass::name),
        ElementKind::StopLine | ElementKind::Crosswalk => None,
    }
}

/// What a pass saw, in words.
fn why(pass: &PassSays) -> String {
    let seen = match (pass.sighted, pass.exposed, pass.hit) {
        (Some(true), ..) => "sighted what the map lacks".to_owned(),
        (Some(false), looks, _) => format!("sighted nothing in {looks} looks"),
        (None, looks, 0) => format!("missed in all of {looks} looks"),
        (None, looks, hit) => format!("matched in {hit} of {looks} looks"),
    };
    let place = pass.residual_m.map(|residual_m| {
        let side = if residual_m < 0.0 { "right" } else { "left" };
        format!(", {:.2} m to the {side}", residual_m.abs())
    });
    let read = pass.read.map(|read| format!(", read as {read}"));
    seen + &place.unwrap_or_default() + &read.unwrap_or_default()
}
