//! The corner of a 100 km square of MGRS, by its letters (NGA.STND.0037, appendix B): `54SVE`.
//!
//! The tiler reads and writes whole references; this is the part of it that a map file needs.

const LETTERS: &[u8; 24] = b"ABCDEFGHJKLMNPQRSTUVWXYZ";
const BANDS: &[u8; 20] = b"CDEFGHJKLMNPQRSTUVWX";
const SQUARE_M: f64 = 100_000.0;
/// Row letters repeat after so many squares.
const ROWS: u32 = 20;
/// Columns of a zone; the letters go on over three zones.
const COLUMNS: usize = 8;
/// The first band of the northern hemisphere.
const EQUATOR: usize = 10;

/// A 100 km square of UTM.
#[derive(Debug, PartialEq)]
pub(super) struct Square {
    pub(super) zone: u32,
    pub(super) is_south: bool,
    /// Easting and northing of its south-west corner, in metres.
    pub(super) corner_m: [f64; 2],
}

/// Reads `54SVE`.
pub(super) fn read(code: &str) -> Result<Square, String> {
    parts(code.trim()).ok_or_else(|| {
        let shown: String = code.chars().take(20).collect();
        format!("{shown:?} is no 100 km square of MGRS, such as 54SVE")
    })
}

fn parts(code: &str) -> Option<Square> {
    let (digits, letters) = code.split_at_checked(code.len().checked_sub(3)?)?;
    let zone: u32 = digits.parse().ok().filter(|zone| (1..=60).contains(zone))?;
    let [band, column, row] = <[u8; 3]>::try_from(letters.as_bytes()).ok()?;
    let band = BANDS.iter().position(|&letter| letter == band)?;
    let index = |letter| LETTERS.iter().position(|&known| known == letter);
    let first_column = (zone as usize - 1) % 3 * COLUMNS;
    let column = index(column)?.checked_sub(first_column)?;
    let row = u32::try_from(index(row)?).ok().filter(|row| *row < ROWS)?;
    if column >= COLUMNS {
        return None;
    }
    // Even zones begin five letters later.
    let row = (row + ROWS - (zone + 1) % 2 * 5) % ROWS;
    Some(Square {
        zone,
        is_south: band < EQUATOR,
        corner_m: [(column + 1) as f64 * SQUARE_M, northing_m(band, row)],
    })
}

/// The row of that letter that lies in the band: the lowest one that is not wholly below its southern
/// edge.
fn northing_m(band: usize, row: u32) -> f64 {
    let south_edge_deg = (band as f64 - EQUATOR as f64) * 8.0;
    let false_northing_m = if band < EQUATOR { 10_000_000.0 } else { 0.0 };
    let lowest = (false_northing_m + south_edge_deg * metres_per_degree(band)) / SQUARE_M - 1.5;
    let mut square = f64::from(row);
    while square < lowest {
        square += f64::from(ROWS);
    }
    square * SQUARE_M
}

/// Of the way from the equator to the band: near enough, as 200,000 random points of four zones lie in
/// the rows that pyproj says.
fn metres_per_degree(band: usize) -> f64 {
    let latitude_deg = (band as f64 - EQUATOR as f64).abs() * 8.0;
    110_530.0 + 7.4 * latitude_deg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_that_are_known() {
        // Kashiwa, Karlsruhe, Quito, Singapore, Sydney, Ushuaia, Hammerfest; metres from pyproj.
        for (code, zone, is_south, corner_m) in [
            ("54SVE", 54, false, [400_000.0, 3_900_000.0]),
            ("32UMV", 32, false, [400_000.0, 5_400_000.0]),
            ("17MQV", 17, true, [700_000.0, 9_900_000.0]),
            ("48NUG", 48, false, [300_000.0, 100_000.0]),
            ("56HLH", 56, true, [300_000.0, 6_200_000.0]),
            ("19FEV", 19, true, [500_000.0, 3_900_000.0]),
            ("34WED", 34, false, [500_000.0, 7_800_000.0]),
        ] {
            let square = Square {
                zone,
                is_south,
                corner_m,
            };
            assert_eq!(read(code).unwrap(), square, "{code}");
        }
    }

    #[test]
    fn what_is_no_square_is_refused() {
        for code in [
            "", "SVE", "54SV", "61SVE", "54IVE", "54SAE", "54SVW", "54své", "0SVE", "5é4SVE",
        ] {
            assert!(read(code).unwrap_err().contains("54SVE"), "{code}");
        }
    }
}
