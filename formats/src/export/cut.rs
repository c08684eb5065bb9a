//! Shapes on the plane of web tiles, cut to the tiles that they lie in, from one zoom to the next.

use tilefold_schemas::wkb::Geometry;

use super::vector_tile::EXTENT;

/// How far beyond a tile's side a shape is kept, in sides: what is drawn thick must not end there.
const BUFFER: f64 = 64.0 / 4096.0;
/// Latitude at which the plane of web tiles ends.
const MAX_LATITUDE_DEG: f64 = 85.051_128;

/// A tile: zoom, column from the west, row from the north.
pub type Address = (u8, u32, u32);

/// A shape in sides of the whole world (x to the east, y to the south, both 0 to 1).
#[derive(Debug, Clone)]
pub(super) struct Shape {
    pub(super) is_area: bool,
    /// Lines, or one ring without its repeated first vertex.
    parts: Vec<Vec<[f64; 2]>>,
}

impl Shape {
    /// A geometry under the Mercator projection on a sphere (EPSG:3857).
    pub(super) fn of(geometry: &Geometry) -> Self {
        let points = geometry.points.iter().map(project).collect();
        Self {
            is_area: geometry.is_area,
            parts: vec![points],
        }
    }

    /// In units of the tile, counted from its north-western corner.
    pub(super) fn in_tile(&self, (zoom, column, row): Address) -> Vec<Vec<[i32; 2]>> {
        let sides = side_count(zoom);
        let unit = |value: f64, index: u32| {
            ((value * sides - f64::from(index)) * f64::from(EXTENT)).round() as i32
        };
        let point = |&[x, y]: &[f64; 2]| [unit(x, column), unit(y, row)];
        self.parts
            .iter()
            .map(|part| part.iter().map(point).collect())
            .collect()
    }

    /// What of it lies in a tile, with the buffer; none if nothing does.
    pub(super) fn within(&self, (zoom, column, row): Address) -> Option<Self> {
        let sides = side_count(zoom);
        let low = |index: u32| (f64::from(index) - BUFFER) / sides;
        let high = |index: u32| (f64::from(index) + 1.0 + BUFFER) / sides;
        let mut parts = self.parts.clone();
        for (axis, index) in [(0, column), (1, row)] {
            for (limit, sign) in [(low(index), 1.0), (high(index), -1.0)] {
                let inside = HalfPlane { axis, limit, sign };
                parts = parts
                    .iter()
                    .flat_map(|part| match self.is_area {
                        true => inside.of_ring(part),
                        false => inside.of_line(part),
                    })
                    .collect();
            }
        }
        (!parts.is_empty()).then_some(Self {
            is_area: self.is_area,
            parts,
        })
    }
}

/// Hands the shape's piece in each of its tiles, from `zooms.0` to `zooms.1`, to `take`.
pub(super) fn cut(shape: &Shape, zooms: (u8, u8), take: &mut impl FnMut(Address, &Shape)) {
    let (first, last) = zooms;
    let points = || shape.parts.iter().flatten();
    let span = |axis: usize| {
        let index = |value: f64| {
            let sides = side_count(first);
            (value * sides).floor().clamp(0.0, sides - 1.0) as u32
        };
        let low = points().map(|point| point[axis]).fold(1.0, f64::min);
        let high = points().map(|point| point[axis]).fold(0.0, f64::max);
        let margin = BUFFER / side_count(first);
        index(low - margin)..=index(high + margin)
    };
    for column in span(0) {
        for row in span(1) {
            descend(shape, (first, column, row), last, take);
        }
    }
}

fn descend(shape: &Shape, address: Address, last: u8, take: &mut impl FnMut(Address, &Shape)) {
    let Some(piece) = shape.within(address) else {
        return;
    };
    take(address, &piece);
    let (zoom, column, row) = address;
    if zoom >= last {
        return;
    }
    for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let child = (zoom + 1, 2 * column + right, 2 * row + down);
        descend(&piece, child, last, take);
    }
}

fn side_count(zoom: u8) -> f64 {
    f64::from(1_u32 << zoom)
}

fn project(&[longitude_deg, latitude_deg, _]: &[f64; 3]) -> [f64; 2] {
    let latitude = latitude_deg
        .clamp(-MAX_LATITUDE_DEG, MAX_LATITUDE_DEG)
        .to_radians();
    let y = libm::asinh(libm::tan(latitude)) / std::f64::consts::PI;
    [longitude_deg / 360.0 + 0.5, 0.5 - 0.5 * y]
}

/// Where `sign * (point[axis] - limit)` is not negative.
struct HalfPlane {
    axis: usize,
    limit: f64,
    sign: f64,
}

impl HalfPlane {
    fn depth(&self, point: &[f64; 2]) -> f64 {
        self.sign * (point[self.axis] - self.limit)
    }

    fn crossing(&self, a: &[f64; 2], b: &[f64; 2]) -> [f64; 2] {
        let (da, db) = (self.depth(a), self.depth(b));
        let share = da / (da - db);
        [0, 1].map(|axis| a[axis] + share * (b[axis] - a[axis]))
    }

    /// The pieces of a line.
    fn of_line(&self, line: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
        let mut pieces = Vec::new();
        let mut piece: Vec<[f64; 2]> = Vec::new();
        for (index, point) in line.iter().enumerate() {
            let is_in = self.depth(point) >= 0.0;
            let before = index.checked_sub(1).map(|before| &line[before]);
            if let Some(before) = before
                && is_in != (self.depth(before) >= 0.0)
            {
                piece.push(self.crossing(before, point));
            }
            if is_in {
                piece.push(*point);
            } else if !piece.is_empty() {
                pieces.push(std::mem::take(&mut piece));
            }
        }
        pieces.push(piece);
        pieces.retain(|piece| piece.len() > 1);
        pieces
    }

    /// A ring, by Sutherland and Hodgman.
    fn of_ring(&self, ring: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
        let mut kept = Vec::with_capacity(ring.len() + 2);
        let mut before = ring.last();
        for point in ring {
            let is_in = self.depth(point) >= 0.0;
            if let Some(before) = before
                && is_in != (self.depth(before) >= 0.0)
            {
                kept.push(self.crossing(before, point));
            }
            if is_in {
                kept.push(*point);
            }
            before = Some(point);
        }
        match kept.len() {
            0..3 => Vec::new(),
            _ => vec![kept],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(points: &[[f64; 2]]) -> Shape {
        let points = points.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        Shape::of(&Geometry {
            is_area: false,
            points,
        })
    }

    #[test]
    fn the_plane_is_that_of_web_tiles() {
        // floor((1 - asinh(tan(49 degrees)) / pi) / 2 * 2^16), by another program.
        let mut found = Vec::new();
        cut(
            &line(&[[8.4, 49.0], [8.400_1, 49.0]]),
            (16, 16),
            &mut |address, _| found.push(address),
        );
        assert_eq!(found, [(16, 34297, 22506)]);
    }

    #[test]
    fn a_line_through_a_tile_keeps_its_buffer_and_no_more() {
        let shape = line(&[[-90.0, 0.1], [90.0, 0.1]]);
        let mut pieces = Vec::new();
        cut(&shape, (2, 2), &mut |address, piece| {
            pieces.push((address, piece.in_tile(address)));
        });
        let columns: Vec<u32> = pieces.iter().map(|((_, column, _), _)| *column).collect();
        assert!(columns.contains(&1) && columns.contains(&2));
        for ((_, column, row), parts) in pieces {
            if row != 1 {
                continue;
            }
            let [from, to] = [0, 1].map(|end| parts[0][end][0]);
            match column {
                0 => assert_eq!((from, to), (4096, 4160)),
                1 => assert_eq!((from, to), (0, 4160)),
                2 => assert_eq!((from, to), (-64, 4096)),
                _ => assert_eq!((from, to), (-64, 0)),
            }
        }
    }

    #[test]
    fn a_line_that_leaves_and_returns_has_two_pieces() {
        let inside = HalfPlane {
            axis: 0,
            limit: 0.0,
            sign: 1.0,
        };
        let pieces = inside.of_line(&[[1.0, 0.0], [-1.0, 1.0], [1.0, 2.0]]);
        assert_eq!(pieces, [[[1.0, 0.0], [0.0, 0.5]], [[0.0, 1.5], [1.0, 2.0]]]);
    }
}
