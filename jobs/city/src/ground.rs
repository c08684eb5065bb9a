//! Which paint and lanes and how many buildings are near a place: a grid over the city.

use crate::world::{Lane, Paint, Point, World};

/// The side of a cell, in metres.
const CELL_M: f64 = 25.0;

/// So many buildings within about this distance make a street canyon, in metres.
const CANYON_BUILDINGS: f64 = 6.0;
const CANYON_M: f64 = 40.0;
/// How long traces of paint that is gone can be seen, in nanoseconds: 120 days.
const TRACES_NS: i64 = 120 * 86_400 * 1_000_000_000;

/// A world by place.
pub(crate) struct Ground<'a> {
    world: &'a World,
    paint: Grid,
    buildings: Grid,
    lanes: Grid,
}

impl<'a> Ground<'a> {
    pub(crate) fn new(world: &'a World) -> Self {
        Self {
            world,
            paint: Grid::new(world.paint.iter().map(|paint| paint.points.as_slice())),
            buildings: Grid::new(world.buildings.iter().map(|b| std::slice::from_ref(&b.at))),
            lanes: Grid::new(world.lanes.iter().map(|lane| lane.centre.as_slice())),
        }
    }

    /// Paint that is there at a time and has a part within about `reach_m` of a place, by index.
    pub(crate) fn near(&self, at: [f64; 2], reach_m: f64, time_ns: i64) -> Vec<(usize, &'a Paint)> {
        self.paint_where(at, reach_m, |paint| paint.is_there(time_ns))
    }

    /// Paint that is gone, but of which traces can be seen.
    pub(crate) fn gone(&self, at: [f64; 2], reach_m: f64, time_ns: i64) -> Vec<(usize, &'a Paint)> {
        let left_traces =
            |paint: &Paint| paint.until_ns <= time_ns && time_ns - paint.until_ns < TRACES_NS;
        self.paint_where(at, reach_m, left_traces)
    }

    /// Lanes that have a part within about `reach_m` of a place.
    pub(crate) fn lanes_near(&self, at: [f64; 2], reach_m: f64) -> impl Iterator<Item = &'a Lane> {
        let world = self.world;
        let found = self.lanes.near(at, reach_m).into_iter();
        found.map(|index| &world.lanes[index])
    }

    fn paint_where(
        &self,
        at: [f64; 2],
        reach_m: f64,
        is_wanted: impl Fn(&Paint) -> bool,
    ) -> Vec<(usize, &'a Paint)> {
        let world = self.world;
        let found = self.paint.near(at, reach_m).into_iter();
        found
            .map(|index| (index, &world.paint[index]))
            .filter(|(_, paint)| is_wanted(paint))
            .collect()
    }

    /// How much buildings close in on a place, 0 to 1.
    pub(crate) fn closeness(&self, at: [f64; 2]) -> f64 {
        let near = self.buildings.near(at, CANYON_M).len();
        (near as f64 / CANYON_BUILDINGS).min(1.0)
    }
}

/// Cells with the indices of the lines that touch them, ascending, each pair once.
struct Grid {
    cells: Vec<([i32; 2], usize)>,
}

impl Grid {
    fn new<'a>(lines: impl Iterator<Item = &'a [Point]>) -> Self {
        let mut cells = Vec::new();
        for (index, points) in lines.enumerate() {
            let sides = points.windows(2).flat_map(|side| touched(side[0], side[1]));
            let last = points.last().map(|point| cell(*point));
            let mut of_line: Vec<_> = sides.chain(last).map(|cell| (cell, index)).collect();
            of_line.sort_unstable();
            of_line.dedup();
            cells.extend(of_line);
        }
        cells.sort_unstable();
        Self { cells }
    }

    fn near(&self, [east_m, north_m]: [f64; 2], reach_m: f64) -> Vec<usize> {
        let [west, south] = cell([east_m - reach_m, north_m - reach_m, 0.0]);
        let [east, north] = cell([east_m + reach_m, north_m + reach_m, 0.0]);
        let mut found = Vec::new();
        for column in west..=east {
            // Cells of one column lie side by side.
            let from = self
                .cells
                .partition_point(|(cell, _)| *cell < [column, south]);
            let column = self.cells[from..]
                .iter()
                .take_while(|(cell, _)| *cell <= [column, north]);
            found.extend(column.map(|(_, index)| *index));
        }
        found.sort_unstable();
        found.dedup();
        found
    }
}

fn cell([east_m, north_m, _]: Point) -> [i32; 2] {
    [east_m, north_m].map(|metres| (metres / CELL_M).floor() as i32)
}

/// The cells that a straight side may touch.
fn touched(from: Point, to: Point) -> impl Iterator<Item = [i32; 2]> {
    let (a, b) = (cell(from), cell(to));
    let columns = a[0].min(b[0])..=a[0].max(b[0]);
    let rows = a[1].min(b[1])..=a[1].max(b[1]);
    columns.flat_map(move |column| rows.clone().map(move |row| [column, row]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network;

    #[test]
    fn what_is_near_is_found() {
        let world = network::draw(7, 3.0, [10.0, 50.0, 300.0]);
        let ground = Ground::new(&world);
        for lane in world.lanes.iter().step_by(7) {
            let [east_m, north_m, _] = lane.centre[0];
            let found = ground.near([east_m, north_m], 30.0, 0);
            let is_near = |paint: &Paint| {
                let near = |p: &Point| (p[0] - east_m).hypot(p[1] - north_m) < 30.0;
                paint.points.iter().any(near)
            };
            let expected = world
                .paint
                .iter()
                .enumerate()
                .filter(|(_, paint)| is_near(paint));
            for (index, _) in expected {
                assert!(found.iter().any(|(found, _)| *found == index), "{index}");
            }
        }
    }
}
