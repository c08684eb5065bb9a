//! How high the map is at a place: by its nearest vertex. What was only seen has no height of its
//! own (0), and must not lie below the road that it is on.

use rstar::RTree;
use rstar::primitives::GeomWithData;

/// The heights of a map's vertices.
pub(crate) struct Heights {
    tree: RTree<GeomWithData<[f64; 2], f64>>,
    /// Degrees of longitude are this much shorter than those of latitude.
    scale: f64,
}

impl Heights {
    /// Of vertices `[longitude_deg, latitude_deg, elevation_m]`.
    pub(crate) fn new(points: impl Iterator<Item = [f64; 3]>) -> Self {
        let points: Vec<[f64; 3]> = points.collect();
        let scale = points
            .first()
            .map_or(1.0, |point| point[1].to_radians().cos());
        let entry = |[x, y, z]: [f64; 3]| GeomWithData::new([x * scale, y], z);
        Self {
            tree: RTree::bulk_load(points.into_iter().map(entry).collect()),
            scale,
        }
    }

    /// `points`; with the map's heights if they have none at all.
    pub(crate) fn complete(&self, points: &[[f64; 3]]) -> Vec<[f64; 3]> {
        if points.iter().any(|point| point[2] != 0.0) {
            return points.to_vec();
        }
        let raised = |&[x, y, z]: &[f64; 3]| {
            let nearest = self.tree.nearest_neighbor([x * self.scale, y]);
            [x, y, nearest.map_or(z, |vertex| vertex.data)]
        };
        points.iter().map(raised).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_height_gets_that_of_the_map() {
        let heights = Heights::new([[8.0, 49.0, 110.0], [8.1, 49.0, 120.0]].into_iter());
        let seen = [[8.01, 49.0, 0.0], [8.09, 49.0, 0.0]];
        let raised = heights.complete(&seen);
        assert_eq!([raised[0][2], raised[1][2]], [110.0, 120.0]);
        let own = [[8.01, 49.0, 0.0], [8.09, 49.0, 7.0]];
        assert_eq!(heights.complete(&own), own);
        let nowhere = Heights::new(std::iter::empty());
        assert_eq!(nowhere.complete(&seen), seen);
    }
}
