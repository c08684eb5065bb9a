//! The page of the book about accuracy, made from raw results. The same results give the same
//! page, so that whether it is up to date can be tested.

mod beside;
mod page;

pub(crate) use page::table;

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::suite::{SUITES, Suite};

/// A raw result with its suite.
pub(crate) struct Raw {
    pub(crate) suite: &'static Suite,
    pub(crate) value: Value,
    /// Pictures of it.
    pictures: PathBuf,
}

/// Pictures of each suite.
const PICTURES: [&str; 2] = ["sweep", "reliability"];

/// Makes the page in the folder `docs` from the raw results in `runs`; or, to `check`, only
/// compares.
///
/// # Errors
/// A file cannot be read or written, a raw result is of a suite that has been changed since, or
/// what is there is not what would be made.
pub(crate) fn make(runs: &Path, docs: &Path, check: bool) -> Result<(), Box<dyn Error>> {
    for (path, made) in files(runs, docs)? {
        let found = fs::read(&path).unwrap_or_default();
        if found == made {
            continue;
        }
        if check {
            return Err(format!(
                "{} is not what the raw results in {} give; make it with `cargo run -p tilefold-benchmarks -- accuracy --report`",
                path.display(),
                runs.display()
            )
            .into());
        }
        fs::write(&path, made)?;
        eprintln!("wrote {}", path.display());
    }
    Ok(())
}

/// A path and what should be there.
type Made = (PathBuf, Vec<u8>);

/// The page and its pictures.
fn files(runs: &Path, docs: &Path) -> Result<Vec<Made>, Box<dyn Error>> {
    let results = read(runs)?;
    let mut files = vec![(docs.join("accuracy.md"), page::page(&results).into_bytes())];
    for raw in &results {
        for picture in PICTURES {
            let from = raw.pictures.join(format!("{picture}.svg"));
            let to = docs.join(format!("accuracy-{}-{picture}.svg", raw.suite.name));
            let bytes = fs::read(&from).map_err(|error| cannot_read(&from, &error))?;
            files.push((to, bytes));
        }
    }
    Ok(files)
}

fn cannot_read(path: &Path, error: &dyn Error) -> String {
    format!(
        "cannot read {}: {error}; run `cargo run --release -p tilefold-benchmarks -- accuracy` in the root of the checkout",
        path.display()
    )
}

/// All raw results, in the order of the suites.
fn read(runs: &Path) -> Result<Vec<Raw>, Box<dyn Error>> {
    let mut results = Vec::new();
    for suite in &SUITES {
        let path = runs.join(format!("{}.json", suite.name));
        if !path.exists() {
            continue;
        }
        let text = fs::read_to_string(&path).map_err(|error| cannot_read(&path, &error))?;
        let value: Value =
            serde_json::from_str(&text).map_err(|error| cannot_read(&path, &error))?;
        if value["suite"] != serde_json::to_value(suite)? {
            return Err(format!(
                "{} is of a suite {} that has been changed since; run it again with `accuracy --suite {}`",
                path.display(),
                suite.name,
                suite.name
            )
            .into());
        }
        results.push(Raw {
            suite,
            value,
            pictures: runs.join(suite.name),
        });
    }
    if results.is_empty() {
        return Err(cannot_read(runs, &std::io::Error::other("no raw results")).into());
    }
    Ok(results)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
    }

    #[test]
    fn the_page_is_what_the_raw_results_give() {
        let runs = root().join("benchmarks/runs/accuracy");
        make(&runs, &root().join("docs/results"), true).unwrap();
    }

    #[test]
    fn a_stale_page_and_a_changed_suite_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let (runs, docs) = (folder.path().join("runs"), folder.path().join("docs"));
        let suite = &SUITES[0];
        fs::create_dir_all(runs.join(suite.name)).unwrap();
        fs::create_dir_all(&docs).unwrap();
        let error = |check| make(&runs, &docs, check).unwrap_err().to_string();
        assert!(error(false).contains("no raw results"));

        let raw = root().join(format!("benchmarks/runs/accuracy/{}.json", suite.name));
        let text = fs::read_to_string(raw).unwrap();
        let result = runs.join(format!("{}.json", suite.name));
        fs::write(&result, &text).unwrap();
        for picture in PICTURES {
            fs::write(
                runs.join(suite.name).join(format!("{picture}.svg")),
                "<svg/>",
            )
            .unwrap();
        }
        assert!(error(true).contains("accuracy.md is not what"));
        make(&runs, &docs, false).unwrap();
        make(&runs, &docs, true).unwrap();

        let page = docs.join("accuracy.md");
        let mended = fs::read_to_string(&page).unwrap().replacen("0.", "1.", 1);
        fs::write(&page, mended).unwrap();
        assert!(error(true).contains("accuracy.md is not what"));

        let changed = text.replacen("\"vehicles\": ", "\"vehicles\": 9", 1);
        assert_ne!(changed, text);
        fs::write(&result, changed).unwrap();
        assert!(error(true).contains("has been changed since"));
    }
}
