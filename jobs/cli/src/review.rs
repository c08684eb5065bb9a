//! `serve`, `decide` and `export --format html`: the review page, and what is decided on it.

use std::error::Error;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use tilefold_engine::export::{Choice, chosen};
use tilefold_formats::geojson::Reviewed;
use tilefold_review::decision::FILE;
use tilefold_review::{
    Decision, Decisions, Door, FolderReport, Gallery, Review, ReviewError, Said, Served, serve,
    write_folder,
};
use tilefold_schemas::Verdict;
use tilefold_store::{Snapshot, Store};

use crate::args::{Args, Deciding, Export, Say, Serving};
use crate::at::open;
use crate::command::perception;
use crate::report::{Outcome, print, to_stdout};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Serves the page until the process is stopped.
///
/// # Errors
/// The store cannot be read, or the address not be listened on.
pub(crate) fn serve_page(_args: &Args, asked: &Serving) -> Result<Outcome> {
    let snapshot = open(&asked.store, asked.version)?;
    let version = asked.version.map(|_| snapshot.version());
    let review = Review::open(snapshot.store().clone(), version)?;
    let decisions = file_of_decisions(&asked.store, asked.decisions.as_deref());
    if decisions.is_none() {
        tell!("a store in a bucket keeps no decisions: name a file with --decisions to decide");
    }
    let door = Door {
        address: SocketAddr::new(asked.bind, asked.port),
        names: asked.host.clone(),
        decisions,
        now,
    };
    let perception = perception(asked.detector.as_deref(), &asked.runtime)?;
    let gallery = Gallery::new(asked.frames_from.clone(), perception);
    serve(review, door, gallery, tell)?;
    Ok(Outcome::Done)
}

fn tell(served: &Served) {
    let _ = to_stdout(&format!("{}\n", served.url));
    tell!(
        "the review page is at {} until this is stopped (Ctrl-C)",
        served.url
    );
    if served.is_open {
        tell!("other machines can open it, without a password, and decide on it");
    }
}

/// Writes the page as a folder.
///
/// # Errors
/// The store cannot be read, or the folder not be written.
pub(crate) fn write_page(args: &Args, snapshot: &Snapshot, asked: &Export) -> Result<Outcome> {
    let Some(folder) = &asked.out else {
        return Err("the review page is a folder: name it with --out FOLDER".into());
    };
    let version = asked.version.map(|_| snapshot.version());
    let review = Review::open(snapshot.store().clone(), version)?;
    let decisions = decisions(&asked.store, asked.decisions.as_deref())?;
    let report = write_folder(&review, &decisions, folder)?;
    // The form of the export is `html`: what is printed is for people.
    print(args, &report, |report| {
        format!(
            "wrote {}: {} records in {} versions, {} of them explained, {} tiles of the map",
            report.page.display(),
            report.records,
            report.versions,
            report.explained,
            report.map_tiles
        )
    })?;
    Ok(Outcome::Done)
}

/// Writes the page of a store's latest version as a folder; none where the program was built without
/// the page's map library.
///
/// # Errors
/// As [`write_page`].
pub(crate) fn write_page_of(store: &Path, folder: &Path) -> Result<Option<FolderReport>> {
    let review = Review::open(Store::open(store.to_path_buf())?, None)?;
    match write_folder(&review, &Decisions::read(&store.join(FILE))?, folder) {
        Ok(report) => Ok(Some(report)),
        Err(ReviewError::NoMapLibrary) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Keeps a decision, or those of a file.
///
/// # Errors
/// There is no such change, or the decisions cannot be written.
pub(crate) fn decide(args: &Args, asked: &Deciding) -> Result<Outcome> {
    let path = file_of_decisions(&asked.store, asked.decisions.as_deref())
        .ok_or("a store in a bucket keeps no decisions: name a file with --decisions")?;
    let mut kept = Decisions::read(&path)?;
    let given = match &asked.from {
        Some(file) => Decisions::read(file)?.all().cloned().collect(),
        None => vec![said_now(asked)?],
    };
    let count = given.len();
    for decision in given {
        kept.add(decision)?;
    }
    print(args, &serde_json::json!({ "kept": count }), |_| {
        format!("kept {count} decisions in {}", path.display())
    })?;
    Ok(Outcome::Done)
}

/// What the command line says of a change of the latest version.
fn said_now(asked: &Deciding) -> Result<Decision> {
    let (Some(change), Some(say)) = (&asked.change, asked.say) else {
        return Err("name a change and what is said of it".into());
    };
    let snapshot = open(&asked.store, None)?;
    let records = chosen(&snapshot, Choice::All)?;
    let id = change.to_ascii_lowercase();
    let record = records
        .iter()
        .find(|record| format!("{:016x}", record.change) == id)
        .ok_or_else(|| {
            let version = snapshot.version();
            format!(
                "version {version} has no change {change}; `tilefold export STORE --all` lists them"
            )
        })?;
    Ok(Decision {
        change: id,
        element_id: record.element,
        version: snapshot.version(),
        verdict: Verdict::from_code(record.verdict)
            .map_or("unknown", Verdict::name)
            .to_owned(),
        decision: say.into(),
        note: asked.note.clone(),
        reviewer: asked.reviewer.clone(),
        at: now(),
    })
}

impl From<Say> for Said {
    fn from(say: Say) -> Self {
        match say {
            Say::Accept => Self::Accept,
            Say::Reject => Self::Reject,
            Say::Later => Self::Later,
            Say::Undo => Self::Undo,
        }
    }
}

/// The decisions on a store; none where there is no file of them.
///
/// # Errors
/// The file is damaged.
pub(crate) fn decisions(store: &Path, named: Option<&Path>) -> Result<Decisions> {
    let path = file_of_decisions(store, named).unwrap_or_default();
    Ok(Decisions::read(&path)?)
}

/// Where the decisions on a store are kept; nowhere for a store in a bucket if no file is named.
fn file_of_decisions(store: &Path, named: Option<&Path>) -> Option<PathBuf> {
    let is_bucket = store.to_string_lossy().contains("://");
    match named {
        Some(path) => Some(path.to_owned()),
        None => (!is_bucket).then(|| store.join(FILE)),
    }
}

/// What was decided of a change, as exports say it.
pub(crate) fn said(decisions: &Decisions, change: i64) -> Option<Reviewed<'_>> {
    decisions.of(change).map(|decision| Reviewed {
        decision: decision.decision.name(),
        note: &decision.note,
        reviewer: &decision.reviewer,
        at: &decision.at,
        version: decision.version,
        verdict: &decision.verdict,
    })
}

fn now() -> String {
    chrono::DateTime::<chrono::Utc>::from(std::time::SystemTime::now())
        .to_rfc3339_opts(chrono::SecondsFormat::Secs, true)
}
