//! Well-known binary (OGC 06-103r4) for the shapes that the store keeps: `LineString` and
//! `Polygon` with one ring, each with or without z, coordinates `[longitude_deg, latitude_deg,
//! elevation_m]` on WGS 84.
//!
//! The reader also takes what other writers make of the same shapes: big-endian bytes, and the
//! EWKB flag for z.

/// A geometry read from WKB.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Whether it is an area; its ring is then given without the repeated first vertex.
    pub is_area: bool,
    /// Vertices `[longitude_deg, latitude_deg, elevation_m]`; elevation 0 where there was none.
    pub points: Vec<[f64; 3]>,
}

/// Why bytes are not a geometry that we read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("not a WKB line or polygon: {0}")]
pub struct WkbError(&'static str);

const LINE_STRING: u32 = 2;
const POLYGON: u32 = 3;
const ISO_Z: u32 = 1000;
const EWKB_Z: u32 = 0x8000_0000;

/// A line with z, little-endian.
#[must_use]
pub fn line(points: &[[f64; 3]]) -> Vec<u8> {
    let mut bytes = header(LINE_STRING + ISO_Z);
    push_points(&mut bytes, points.iter());
    bytes
}

/// A polygon with z and one ring, little-endian; the ring is closed here.
#[must_use]
pub fn polygon(ring: &[[f64; 3]]) -> Vec<u8> {
    let mut bytes = header(POLYGON + ISO_Z);
    bytes.extend(1_u32.to_le_bytes());
    push_points(&mut bytes, ring.iter().chain(ring.first()));
    bytes
}

fn header(geometry_type: u32) -> Vec<u8> {
    let mut bytes = vec![1];
    bytes.extend(geometry_type.to_le_bytes());
    bytes
}

fn push_points<'a>(bytes: &mut Vec<u8>, points: impl Iterator<Item = &'a [f64; 3]> + Clone) {
    bytes.extend((points.clone().count() as u32).to_le_bytes());
    for value in points.flatten() {
        bytes.extend(value.to_le_bytes());
    }
}

/// Reads a `LineString` or a `Polygon`.
///
/// # Errors
/// Another shape, a polygon with holes, bytes that end early, or coordinates that are not finite.
pub fn read(bytes: &[u8]) -> Result<Geometry, WkbError> {
    let (&order, rest) = bytes.split_first().ok_or(WkbError("it is empty"))?;
    let mut cursor = Cursor {
        rest,
        little_endian: order == 1,
    };
    let code = cursor.u32()?;
    let has_z = code & EWKB_Z != 0 || code % 10_000 / ISO_Z == 1;
    let dimensions = if has_z { 3 } else { 2 };
    match (code & !EWKB_Z) % ISO_Z {
        LINE_STRING => Ok(Geometry {
            is_area: false,
            points: cursor.points(dimensions)?,
        }),
        POLYGON => cursor.ring(dimensions),
        _ => Err(WkbError("it is neither a LineString nor a Polygon")),
    }
}

struct Cursor<'a> {
    rest: &'a [u8],
    little_endian: bool,
}

impl Cursor<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], WkbError> {
        let (head, rest) = self
            .rest
            .split_first_chunk::<N>()
            .ok_or(WkbError("it ends early"))?;
        self.rest = rest;
        Ok(*head)
    }

    fn u32(&mut self) -> Result<u32, WkbError> {
        let bytes = self.take()?;
        Ok(if self.little_endian {
            u32::from_le_bytes(bytes)
        } else {
            u32::from_be_bytes(bytes)
        })
    }

    fn f64(&mut self) -> Result<f64, WkbError> {
        let bytes = self.take()?;
        let value = if self.little_endian {
            f64::from_le_bytes(bytes)
        } else {
            f64::from_be_bytes(bytes)
        };
        if value.is_finite() {
            Ok(value)
        } else {
            Err(WkbError("a coordinate is not finite"))
        }
    }

    fn points(&mut self, dimensions: usize) -> Result<Vec<[f64; 3]>, WkbError> {
        let count = self.u32()? as usize;
        if self.rest.len() / (8 * dimensions) < count {
            return Err(WkbError("it says more vertices than it has bytes for"));
        }
        let mut points = vec![[0.0; 3]; count];
        for point in &mut points {
            for value in &mut point[..dimensions] {
                *value = self.f64()?;
            }
        }
        Ok(points)
    }

    fn ring(&mut self, dimensions: usize) -> Result<Geometry, WkbError> {
        if self.u32()? != 1 {
            return Err(WkbError("a polygon must have one ring"));
        }
        let mut points = self.points(dimensions)?;
        if points.len() > 1 && points.first() == points.last() {
            points.pop();
        }
        Ok(Geometry {
            is_area: true,
            points,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RING: [[f64; 3]; 3] = [[8.0, 49.0, 1.0], [8.1, 49.0, 2.0], [8.1, 49.1, 3.0]];

    #[test]
    fn reads_what_it_writes() {
        assert_eq!(read(&line(&RING)).unwrap().points, RING);
        let area = read(&polygon(&RING)).unwrap();
        assert!(area.is_area);
        assert_eq!(area.points, RING);
    }

    #[test]
    fn reads_two_dimensions_and_big_endian() {
        let mut bytes = vec![0];
        bytes.extend(LINE_STRING.to_be_bytes());
        bytes.extend(1_u32.to_be_bytes());
        bytes.extend(8.5_f64.to_be_bytes());
        bytes.extend(49.5_f64.to_be_bytes());
        assert_eq!(read(&bytes).unwrap().points, [[8.5, 49.5, 0.0]]);
    }

    #[test]
    fn refuses_every_cut_and_lying_counts() {
        let bytes = polygon(&RING);
        for end in 0..bytes.len() {
            assert!(read(&bytes[..end]).is_err(), "cut at {end}");
        }
        let mut lying = line(&RING);
        lying[5..9].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(read(&lying).is_err());
    }
}
