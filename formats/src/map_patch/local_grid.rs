//! Autoware's `local_x` and `local_y` of a node that is new or moved, from its neighbours': the file
//! does not say which grid they count in.

use std::collections::BTreeMap;

use super::line::{distance_m, offset_m};
use super::text::OsmText;

/// Metres between two nodes from whose difference the grid's direction is taken.
const BASE_M: f64 = 20.0;

/// A node with both kinds of coordinates.
#[derive(Debug, Clone, Copy)]
struct Known {
    point: [f64; 3],
    local: [f64; 2],
}

/// What the map's nodes say of the grid.
#[derive(Debug)]
pub(super) struct LocalGrid {
    known: Vec<Known>,
    mgrs_code: Option<String>,
}

impl LocalGrid {
    pub(super) fn of(text: &OsmText) -> Self {
        let known = text.nodes.iter().filter_map(|(id, node)| {
            let local = [
                node.tag("local_x").parse().ok()?,
                node.tag("local_y").parse().ok()?,
            ];
            let point = text.position(*id)?;
            Some(Known { point, local })
        });
        let code = |tags: &super::text::Thing| Some(tags.tags.get("mgrs_code")?.value.clone());
        Self {
            known: known.collect(),
            mgrs_code: text.nodes.values().find_map(code),
        }
    }

    /// The tags of a node here: none where the map's nodes have none.
    pub(super) fn tags(&self, point: [f64; 3]) -> BTreeMap<String, String> {
        let Some([x, y]) = self.local(point) else {
            return BTreeMap::new();
        };
        BTreeMap::from([
            ("local_x".to_owned(), format!("{x:.4}")),
            ("local_y".to_owned(), format!("{y:.4}")),
        ])
    }

    /// The 100 km square that new nodes name, where the map's nodes name one.
    pub(super) fn mgrs_code(&self) -> Option<&str> {
        self.mgrs_code.as_deref()
    }

    /// By the nearest node, and the next one far enough from it to give the grid's direction.
    fn local(&self, point: [f64; 3]) -> Option<[f64; 2]> {
        let nearest = self.nearest(point, |_| true)?;
        let second = self.nearest(nearest.point, |known| {
            distance_m(known.point, nearest.point) >= BASE_M
        });
        let [east_m, north_m] = offset_m(nearest.point, point);
        let [cos, sin] = second.map_or([1.0, 0.0], |second| {
            let true_m = offset_m(nearest.point, second.point);
            let grid_m = [0, 1].map(|axis| second.local[axis] - nearest.local[axis]);
            let norm = true_m[0].powi(2) + true_m[1].powi(2);
            [
                (true_m[0] * grid_m[0] + true_m[1] * grid_m[1]) / norm,
                (true_m[0] * grid_m[1] - true_m[1] * grid_m[0]) / norm,
            ]
        });
        Some([
            nearest.local[0] + cos * east_m - sin * north_m,
            nearest.local[1] + sin * east_m + cos * north_m,
        ])
    }

    fn nearest(&self, point: [f64; 3], admits: impl Fn(&Known) -> bool) -> Option<Known> {
        let away = |known: &&Known| distance_m(known.point, point);
        let admitted = self.known.iter().filter(|known| admits(known));
        admitted.min_by(|a, b| away(a).total_cmp(&away(b))).copied()
    }
}
