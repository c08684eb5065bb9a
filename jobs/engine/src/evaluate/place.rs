//! Places: square cells on the ground. Changes near each other share a road, its drives and its
//! weather, so what is resampled is places and not changes.

use tilefold_formats::geojson::TruthChange;

use super::claim::Claim;

/// Metres of a degree of latitude, roughly: cells need not be exact, only always the same.
const METRES_PER_DEGREE: f64 = 111_320.0;

/// A cell of one road network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    /// Which of several networks that are evaluated together.
    network: usize,
    row: i64,
    column: i64,
}

/// How cells are cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub(super) network: usize,
    /// Side of a cell, metres.
    pub(super) side_m: f64,
}

impl Grid {
    /// The cell of a longitude and latitude in degrees.
    fn place(&self, [longitude_deg, latitude_deg]: [f64; 2]) -> Place {
        let cells = |degrees: f64| (degrees * METRES_PER_DEGREE / self.side_m).floor();
        let row = cells(latitude_deg);
        // All cells of a row are cut alike, by the latitude of its lower edge.
        let row_deg = row * self.side_m / METRES_PER_DEGREE;
        Place {
            network: self.network,
            row: row as i64,
            column: cells(longitude_deg * row_deg.to_radians().cos()) as i64,
        }
    }

    pub(super) fn of_points(&self, points: &[[f64; 3]]) -> Place {
        let middle = points.get(points.len() / 2);
        // What has no geometry is nowhere: all of it together.
        middle.map_or(
            Place {
                network: self.network,
                row: i64::MAX,
                column: 0,
            },
            |&[longitude_deg, latitude_deg, _]| self.place([longitude_deg, latitude_deg]),
        )
    }

    /// The place of a true change: that of its middle vertex.
    pub(super) fn of_change(&self, change: &TruthChange) -> Place {
        self.of_points(&change.points)
    }

    /// The place of a claim: that of its middle vertex.
    pub(super) fn of_claim(&self, claim: &Claim<'_>) -> Place {
        let geometry = claim.geometry();
        self.of_points(&geometry.map(|geometry| geometry.points).unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_as_long_as_they_are_wide() {
        let grid = Grid {
            network: 0,
            side_m: 500.0,
        };
        // 0.045 degrees of latitude are 5 km; at 60 degrees north so are 0.09 of longitude.
        let here = grid.place([10.0, 60.0]);
        let north = grid.place([10.0, 60.045]);
        let east = grid.place([10.09, 60.0]);
        assert_eq!(north.row - here.row, 10);
        assert_eq!((east.row, east.column - here.column), (here.row, 10));
        assert!(grid.place([-0.001, -0.001]).column < 0);
    }
}
