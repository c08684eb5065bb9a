//! The arrows of the house: which crate of the workspace may depend on which.
//!
//! [`ALLOWED`] is the list of the architecture. What is not in it is refused, for normal, build and
//! dev dependencies alike: a dev dependency ties the crates' tests together as a normal one ties
//! their code. The crates of [`FREE`] may depend on anything, and nothing may depend on them.

use std::collections::BTreeSet;
use std::fmt;

use serde_json::Value;

/// Each crate with the crates that it may depend on.
pub const ALLOWED: &[(&str, &[&str])] = &[
    ("tilefold-schemas", &[]),
    ("tilefold-formats", &["tilefold-schemas"]),
    ("tilefold-store", &["tilefold-schemas"]),
    ("tilefold-tiler", &["tilefold-schemas"]),
    ("tilefold-workers", &["tilefold-schemas", "tilefold-tiler"]),
    ("tilefold-onnx", &["tilefold-schemas", "tilefold-workers"]),
    ("tilefold-reducers", &["tilefold-schemas", "tilefold-tiler"]),
    (
        "tilefold-city",
        &["tilefold-schemas", "tilefold-formats", "tilefold-tiler"],
    ),
    (
        "tilefold-engine",
        &[
            "tilefold-schemas",
            "tilefold-formats",
            "tilefold-store",
            "tilefold-tiler",
            "tilefold-workers",
            "tilefold-onnx",
            "tilefold-reducers",
        ],
    ),
    (
        "tilefold-python",
        &[
            "tilefold-schemas",
            "tilefold-formats",
            "tilefold-store",
            "tilefold-tiler",
            "tilefold-workers",
            "tilefold-onnx",
            "tilefold-reducers",
            "tilefold-engine",
        ],
    ),
    (
        "tilefold-review",
        &[
            "tilefold-schemas",
            "tilefold-formats",
            "tilefold-store",
            "tilefold-engine",
        ],
    ),
    (
        "tilefold",
        &[
            "tilefold-schemas",
            "tilefold-formats",
            "tilefold-store",
            "tilefold-tiler",
            "tilefold-workers",
            "tilefold-onnx",
            "tilefold-reducers",
            "tilefold-engine",
            "tilefold-review",
            "tilefold-city",
        ],
    ),
];

/// Crates that may depend on anything and on which nothing may depend.
pub const FREE: &[&str] = &[
    "tilefold-benchmarks",
    "tilefold-fuzz",
    "tilefold-tests",
    "xtask",
];

/// A dependency between two crates of the workspace.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Arrow {
    /// The crate that depends.
    pub from: String,
    /// The crate that it depends on, under its own name.
    pub to: String,
    /// `normal`, `build` or `dev`.
    pub kind: String,
    /// The manifest that says so.
    pub manifest: String,
}

impl Arrow {
    /// Whether the architecture has this arrow.
    #[must_use]
    pub fn is_allowed(&self) -> bool {
        let to_is_free = FREE.contains(&self.to.as_str());
        if FREE.contains(&self.from.as_str()) {
            return !to_is_free;
        }
        allowed_from(&self.from).is_some_and(|allowed| allowed.contains(&self.to.as_str()))
    }
}

impl fmt::Display for Arrow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            from,
            to,
            kind,
            manifest,
        } = self;
        write!(f, "{from} -> {to} ({kind} dependency in {manifest})")?;
        match allowed_from(from) {
            None => write!(f, "; {from} is not in the list of the architecture"),
            Some([]) => write!(f, "; {from} may depend on no crate of the workspace"),
            Some(allowed) => write!(f, "; {from} may depend on {}", allowed.join(", ")),
        }
    }
}

/// Output of `cargo metadata` that is not what this program knows.
#[derive(Debug, thiserror::Error)]
pub enum MetadataError {
    /// Not JSON.
    #[error("the output of `cargo metadata` is no JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A field that is lacking.
    #[error("`cargo metadata --format-version 1` gave no {0}: has its format changed?")]
    Missing(&'static str),
}

fn allowed_from(from: &str) -> Option<&'static [&'static str]> {
    ALLOWED
        .iter()
        .find(|(name, _)| *name == from)
        .map(|(_, allowed)| *allowed)
}

/// Every arrow between crates of the workspace, from the output of
/// `cargo metadata --format-version 1 --no-deps`; sorted.
///
/// # Errors
/// If it is not JSON of that format.
pub fn arrows(metadata: &str) -> Result<Vec<Arrow>, MetadataError> {
    let metadata: Value = serde_json::from_str(metadata)?;
    let packages = list(&metadata, "packages")?;
    let names: BTreeSet<&str> = packages
        .iter()
        .map(|package| text(package, "name"))
        .collect::<Result<_, _>>()?;
    let mut arrows = Vec::new();
    for package in packages {
        for dependency in list(package, "dependencies")? {
            let to = text(dependency, "name")?;
            if !names.contains(to) && allowed_from(to).is_none() {
                continue;
            }
            arrows.push(Arrow {
                from: text(package, "name")?.to_owned(),
                to: to.to_owned(),
                kind: text(dependency, "kind").unwrap_or("normal").to_owned(),
                manifest: text(package, "manifest_path")?.to_owned(),
            });
        }
    }
    arrows.sort();
    Ok(arrows)
}

/// The arrows that the architecture does not have.
///
/// # Errors
/// If `metadata` is not the output of `cargo metadata --format-version 1 --no-deps`.
pub fn wrong_arrows(metadata: &str) -> Result<Vec<Arrow>, MetadataError> {
    let mut arrows = arrows(metadata)?;
    arrows.retain(|arrow| !arrow.is_allowed());
    Ok(arrows)
}

fn list<'a>(value: &'a Value, key: &'static str) -> Result<&'a [Value], MetadataError> {
    value[key]
        .as_array()
        .map(Vec::as_slice)
        .ok_or(MetadataError::Missing(key))
}

fn text<'a>(value: &'a Value, key: &'static str) -> Result<&'a str, MetadataError> {
    value[key].as_str().ok_or(MetadataError::Missing(key))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn package(name: &str, dependencies: Value) -> Value {
        json!({"name": name, "manifest_path": format!("{name}/Cargo.toml"), "dependencies": dependencies})
    }

    fn wrong(packages: &[Value]) -> Vec<String> {
        let metadata = json!({ "packages": packages }).to_string();
        let wrong = wrong_arrows(&metadata).unwrap();
        wrong.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_wrong_arrow_is_refused_with_its_path() {
        let dependencies = json!([
            {"name": "tilefold-schemas", "kind": null},
            {"name": "tilefold-reducers", "kind": null},
            {"name": "serde", "kind": null},
        ]);
        let wrong = wrong(&[
            package("tilefold-workers", dependencies),
            package("tilefold-reducers", json!([])),
        ]);
        assert_eq!(
            wrong,
            [
                "tilefold-workers -> tilefold-reducers (normal dependency in tilefold-workers/Cargo.toml); \
              tilefold-workers may depend on tilefold-schemas, tilefold-tiler"
            ]
        );
    }

    #[test]
    fn dev_and_build_dependencies_count_and_renaming_does_not_hide_them() {
        for kind in ["dev", "build"] {
            let dependencies = json!([{"name": "tilefold", "kind": kind, "rename": "serde"}]);
            let wrong = wrong(&[package("tilefold-city", dependencies)]);
            assert_eq!(wrong.len(), 1, "{kind}: {wrong:?}");
            assert!(wrong[0].contains(kind), "{wrong:?}");
        }
    }

    #[test]
    fn free_crates_take_anything_but_are_taken_by_nobody() {
        let takes =
            json!([{"name": "tilefold", "kind": null}, {"name": "tilefold-city", "kind": "dev"}]);
        assert!(wrong(&[package("tilefold-tests", takes)]).is_empty());
        let taken = json!([{"name": "tilefold-tests", "kind": "dev"}]);
        let packages = [
            package("tilefold-engine", taken.clone()),
            package("xtask", taken),
            package("tilefold-tests", json!([])),
        ];
        assert_eq!(wrong(&packages).len(), 2);
    }

    #[test]
    fn a_crate_that_the_architecture_does_not_name_is_refused() {
        let dependencies = json!([{"name": "tilefold-schemas", "kind": null}]);
        let wrong = wrong(&[package("tilefold-utils", dependencies)]);
        assert!(wrong[0].ends_with("tilefold-utils is not in the list of the architecture"));
    }

    #[test]
    fn no_allowed_arrow_closes_a_circle() {
        for (position, (from, allowed)) in ALLOWED.iter().enumerate() {
            for to in *allowed {
                let below = ALLOWED.iter().position(|(name, _)| name == to);
                assert!(
                    below.is_some_and(|below| below < position),
                    "{from} -> {to}"
                );
            }
        }
    }
}
