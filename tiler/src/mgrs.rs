//! MGRS references: UTM with letters for the 100 km squares (NGA.STND.0037, appendix B).
//!
//! Autoware maps count `local_x` and `local_y` from the corner of such a square. The letters are our
//! own: `geoconvert`'s panic on the equator and overflow on long references. The polar squares (UPS,
//! beyond 84 degrees north and 80 degrees south) are refused: no road map lies there.

use crate::geodesy::{GeodesyError, Utm, utm_from_wgs84, wgs84_from_utm};

/// Most digits per axis: millimetres.
pub const MAX_DIGITS: u8 = 8;
const SQUARE_M: f64 = 100_000.0;
/// Row letters repeat after so many squares.
const ROW_PERIOD: u32 = 20;
const LETTERS: &[u8; 24] = b"ABCDEFGHJKLMNPQRSTUVWXYZ";
const BANDS: &[u8; 20] = b"CDEFGHJKLMNPQRSTUVWX";
/// False northing of the southern hemisphere.
const SOUTH_M: f64 = 10_000_000.0;

/// A text that is no MGRS reference, or a position that has none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MgrsError {
    /// A text that is no reference.
    #[error("{text:?} is no MGRS reference: {why}; write it like 54SUE8155001500")]
    Text {
        /// The text, at most its first 40 characters.
        text: String,
        /// What is wrong with it.
        why: &'static str,
    },
    /// More digits than there are.
    #[error(
        "MGRS with {digits} digits per axis is not written here: give 0 (100 km) to {MAX_DIGITS} (1 mm)"
    )]
    Digits {
        /// The digits asked for.
        digits: u8,
    },
    /// A position near a pole.
    #[error(
        "latitude {latitude_deg} lies in the polar grid: MGRS is read and written between 80 south and 84 north only"
    )]
    Polar {
        /// Latitude, degrees.
        latitude_deg: f64,
    },
    /// A position that is not on the earth.
    #[error(transparent)]
    Geodesy(#[from] GeodesyError),
}

/// The MGRS reference of a point with `digits` digits per axis: 0 names the 100 km square, 5 is to
/// the metre. References are cut, not rounded, so a point lies in the square that it names.
///
/// # Errors
/// If the position is not on the earth or near a pole, or `digits` is above [`MAX_DIGITS`].
pub fn mgrs_from_wgs84(
    longitude_deg: f64,
    latitude_deg: f64,
    digits: u8,
) -> Result<String, MgrsError> {
    if digits > MAX_DIGITS {
        return Err(MgrsError::Digits { digits });
    }
    let utm = utm_from_wgs84(longitude_deg, latitude_deg)?;
    let polar = MgrsError::Polar { latitude_deg };
    if utm.zone == 0 {
        return Err(polar);
    }
    // On the equator, rounding must not move a point into the other hemisphere.
    let northing_m = if utm.north {
        utm.northing_m.max(0.0)
    } else {
        utm.northing_m.min(SOUTH_M.next_down())
    };
    let letters = letters(&utm, northing_m, latitude_deg).ok_or(polar)?;
    let mut text = format!("{:02}{letters}", utm.zone);
    for metres in [utm.easting_m, northing_m] {
        text.push_str(&cut_digits(metres, digits));
    }
    Ok(text)
}

/// Band, column and row.
fn letters(utm: &Utm, northing_m: f64, latitude_deg: f64) -> Option<String> {
    let northernmost = if utm.north { BANDS.len() - 1 } else { 9 };
    let band = (((latitude_deg + 80.0) / 8.0).floor() as usize).min(northernmost);
    let column = square_number(utm.easting_m).checked_sub(1)?;
    let row = (square_number(northing_m) + first_row(utm.zone)) % ROW_PERIOD;
    let column_letter = LETTERS.get((first_column(utm.zone) + column) as usize)?;
    let all = [
        *BANDS.get(band)?,
        *column_letter,
        *LETTERS.get(row as usize)?,
    ];
    Some(all.map(char::from).iter().collect())
}

fn square_number(metres: f64) -> u32 {
    (metres / SQUARE_M).floor() as u32
}

/// The letter set of a zone's columns begins at A, J or S.
fn first_column(zone: u8) -> u32 {
    (u32::from(zone) + 2) % 3 * 8
}

/// Rows of even zones begin five letters later.
fn first_row(zone: u8) -> u32 {
    if zone.is_multiple_of(2) { 5 } else { 0 }
}

fn cut_digits(metres: f64, digits: u8) -> String {
    if digits == 0 {
        return String::new();
    }
    let inside_m = metres - (metres / SQUARE_M).floor() * SQUARE_M;
    let cut = (inside_m * 10_f64.powi(i32::from(digits) - 5)).floor();
    format!("{cut:0width$}", width = usize::from(digits))
}

/// `[longitude_deg, latitude_deg]` of the middle of the square that a reference names.
///
/// # Errors
/// If the text is no reference with at least its 100 km square.
pub fn wgs84_from_mgrs(text: &str) -> Result<[f64; 2], MgrsError> {
    let reference = Reference::parse(text)?;
    let mut utm = reference.corner(text)?;
    utm.easting_m += reference.inside_m[0];
    utm.northing_m += reference.inside_m[1];
    Ok(wgs84_from_utm(&utm)?)
}

/// The south-west corner of the 100 km square of a reference: where Autoware's `local_x` and
/// `local_y` count from.
///
/// # Errors
/// If the text is no reference with at least its 100 km square.
pub fn square_origin(text: &str) -> Result<Utm, MgrsError> {
    Reference::parse(text)?.corner(text)
}

/// A reference taken apart.
struct Reference {
    zone: u8,
    /// Counted from C.
    band: u8,
    /// Square counted from the west of the zone's grid (1 to 8), and from the row that repeats.
    column: u32,
    row: u32,
    /// Middle of the smallest square named, east and north of the corner of the 100 km square.
    inside_m: [f64; 2],
}

impl Reference {
    fn parse(text: &str) -> Result<Self, MgrsError> {
        Self::take_apart(text).map_err(|why| wrong(text, why))
    }

    fn take_apart(text: &str) -> Result<Self, &'static str> {
        let bytes = text.trim().as_bytes();
        let zone_digits = bytes.iter().take_while(|b| b.is_ascii_digit()).count();
        let (zone, rest) = bytes.split_at(zone_digits);
        let zone = number(zone).filter(|zone| zone_digits <= 2 && (1..=60).contains(zone));
        let zone = zone.ok_or("it begins with a zone, 1 to 60")? as u8;
        let ([band, column, row], digits) = rest
            .split_first_chunk::<3>()
            .ok_or("three letters follow the zone")?;
        let band =
            place(BANDS, *band).ok_or("the first letter is a band, C to X without I and O")?;
        let column = place(LETTERS, *column)
            .and_then(|letter| letter.checked_sub(first_column(zone)))
            .filter(|column| *column < 8)
            .ok_or("the zone has no such column letter")?;
        let row = place(LETTERS, *row)
            .filter(|row| *row < ROW_PERIOD)
            .ok_or("the last letter is a row, A to V without I and O")?;
        Ok(Self {
            zone,
            band: band as u8,
            column: column + 1,
            row: (row + ROW_PERIOD - first_row(zone)) % ROW_PERIOD,
            inside_m: middle(digits)?,
        })
    }

    /// The corner of the 100 km square. Rows repeat every 2,000 km, a band is lower than that.
    fn corner(&self, text: &str) -> Result<Utm, MgrsError> {
        let south_deg = f64::from(self.band) * 8.0 - 80.0;
        let meridian_deg = f64::from(self.zone) * 6.0 - 183.0;
        let south_m = match utm_from_wgs84(meridian_deg, south_deg)? {
            // Where Norway and Svalbard bend the zones, another zone has the same northing.
            utm if utm.zone != 0 => utm.northing_m,
            _ => return Err(wrong(text, "its band lies in the polar grid")),
        };
        let period_m = f64::from(ROW_PERIOD) * SQUARE_M;
        let lowest_m = (south_m / SQUARE_M).floor() * SQUARE_M - SQUARE_M;
        let row_m = f64::from(self.row) * SQUARE_M;
        let corner = Utm {
            zone: self.zone,
            north: self.band >= 10,
            easting_m: f64::from(self.column) * SQUARE_M,
            northing_m: row_m + ((lowest_m - row_m) / period_m).ceil() * period_m,
        };
        if self.touches_band(&corner, south_deg) {
            Ok(corner)
        } else {
            Err(wrong(text, "its band has no such row letter"))
        }
    }

    /// Whether the middle of the square is within a square's height of the band.
    fn touches_band(&self, corner: &Utm, south_deg: f64) -> bool {
        let north_deg = south_deg + if self.band == 19 { 12.0 } else { 8.0 };
        let middle = Utm {
            easting_m: corner.easting_m + SQUARE_M / 2.0,
            northing_m: corner.northing_m + SQUARE_M / 2.0,
            ..*corner
        };
        wgs84_from_utm(&middle).is_ok_and(|[_, latitude_deg]| {
            (south_deg - 0.6..north_deg + 0.6).contains(&latitude_deg)
        })
    }
}

/// Middle of the square that the digits name, in metres from the corner of the 100 km square.
fn middle(digits: &[u8]) -> Result<[f64; 2], &'static str> {
    let each = digits.len() / 2;
    if digits.len() % 2 == 1 || each > usize::from(MAX_DIGITS) {
        return Err("easting and northing have the same number of digits, at most 8 each");
    }
    let (easting, northing) = digits.split_at(each);
    let unit_m = SQUARE_M / 10_f64.powi(each as i32);
    let [easting, northing] = [easting, northing].map(|axis| match axis {
        [] => Some(0),
        axis => number(axis),
    });
    let (Some(easting), Some(northing)) = (easting, northing) else {
        return Err("only digits follow the three letters");
    };
    Ok([easting, northing].map(|axis| (f64::from(axis) + 0.5) * unit_m))
}

fn number(digits: &[u8]) -> Option<u32> {
    let text = std::str::from_utf8(digits).ok()?;
    text.bytes()
        .all(|b| b.is_ascii_digit())
        .then(|| text.parse().ok())?
}

fn place(letters: &[u8], letter: u8) -> Option<u32> {
    let letter = letter.to_ascii_uppercase();
    letters
        .iter()
        .position(|own| *own == letter)
        .map(|i| i as u32)
}

fn wrong(text: &str, why: &'static str) -> MgrsError {
    MgrsError::Text {
        text: text.chars().take(40).collect(),
        why,
    }
}
