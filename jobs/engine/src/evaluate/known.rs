//! A true change as it is compared with claims: 64 places along it, and which of them a claim
//! covers.

use tilefold_formats::geojson::{Shape, TruthChange};
use tilefold_schemas::Verdict;
use tilefold_schemas::wkb::Geometry;
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::station::Polyline;

use super::claim::Claim;

/// A claim lies on a change if it is this near, in metres.
const NEAR_M: f64 = 1.0;
/// Places along a change at which it is asked whether a claim covers it.
pub(super) const PLACES: u32 = 64;
/// Geometry this much longer than the stretch, in metres, is that of the whole element.
const STRETCH_SLACK_M: f64 = 1.0;

/// The places of a change that are covered, a bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Cover(u64);

impl Cover {
    const ALL: Self = Self(u64::MAX);

    fn of(is_covered: impl Fn(u32) -> bool) -> Self {
        let bits = (0..PLACES).filter(|&place| is_covered(place));
        Self(bits.fold(0, |cover, place| cover | 1 << place))
    }

    pub(super) fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub(super) fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    pub(super) fn places(self) -> u32 {
        self.0.count_ones()
    }

    pub(super) fn share(self) -> f64 {
        f64::from(self.places()) / f64::from(PLACES)
    }
}

/// A true change in the plane of its first vertex.
#[derive(Debug)]
pub(super) struct Known<'a> {
    pub(super) change: &'a TruthChange,
    frame: Option<LocalFrame>,
    /// None for a point, and where there is no geometry.
    line: Option<Polyline>,
}

impl<'a> Known<'a> {
    pub(super) fn new(change: &'a TruthChange) -> Self {
        let anchor = change.points.first().copied();
        let frame = anchor.map(|[lon, lat, _]| LocalFrame::new([lon, lat, 0.0]));
        let is_area = change.shape == Shape::Area;
        let whole = frame
            .as_ref()
            .and_then(|frame| plane_line(frame, &change.points, is_area));
        Self {
            change,
            line: whole.map(|line| stretch(line, change.from_m, change.to_m)),
            frame,
        }
    }

    /// Metres of line that changed; 0 without geometry.
    pub(super) fn length_m(&self) -> f64 {
        match (self.change.from_m, self.change.to_m, &self.line) {
            (from_m, Some(to_m), _) => to_m - from_m.unwrap_or(0.0),
            (_, None, line) => line.as_ref().map_or(0.0, Polyline::length_m),
        }
    }

    /// Which places of the change the claim covers: none if its type or kind is another, or it is
    /// about another element.
    pub(super) fn covered_by(&self, claim: &Claim<'_>) -> Cover {
        let (record, change) = (claim.record, self.change);
        if claim.verdict != change.change_type || record.kind != change.kind.code() {
            return Cover::default();
        }
        // An addition has no element: its id in the truth, if it has one, is of another map.
        if claim.verdict != Verdict::Added
            && let (Some(claimed), Some(changed)) = (record.element, change.element_id)
        {
            return if claimed == changed {
                self.covered_stations(record.from_m, record.to_m)
            } else {
                Cover::default()
            };
        }
        claim
            .geometry()
            .map_or(Cover::default(), |geometry| self.covered_places(&geometry))
    }

    fn covered_stations(&self, claim_from_m: f64, claim_to_m: f64) -> Cover {
        let from_m = self.change.from_m.unwrap_or(0.0);
        let length_m = self.length_m();
        // Without an end nothing says where the change stops: what is said of the element is.
        if length_m <= 0.0 {
            return Cover::ALL;
        }
        Cover::of(|place| {
            let station_m = from_m + (f64::from(place) + 0.5) / f64::from(PLACES) * length_m;
            (claim_from_m..=claim_to_m).contains(&station_m)
        })
    }

    fn covered_places(&self, claim: &Geometry) -> Cover {
        let Some(frame) = &self.frame else {
            return Cover::default();
        };
        let Some(claim) = plane_line(frame, &claim.points, claim.is_area) else {
            return Cover::default();
        };
        Cover::of(|place| claim.project(self.place(place)).distance_m <= NEAR_M)
    }

    /// East and north of a place of the change, in its plane.
    fn place(&self, place: u32) -> [f64; 2] {
        let Some(line) = &self.line else {
            return [0.0; 2];
        };
        let share = (f64::from(place) + 0.5) / f64::from(PLACES);
        let [east_m, north_m, _] = line.at(share * line.length_m()).point;
        [east_m, north_m]
    }

    /// How far to the left of the true line a claimed line runs, at places along the latter that
    /// lie beside the former: metres, positive to the left.
    pub(super) fn lateral_offsets_m(&self, claim: &Geometry) -> Vec<f64> {
        let (Some(frame), Some(line)) = (&self.frame, &self.line) else {
            return Vec::new();
        };
        let Some(claim) = plane_line(frame, &claim.points, claim.is_area) else {
            return Vec::new();
        };
        let at = |place: u32| {
            let share = (f64::from(place) + 0.5) / f64::from(PLACES);
            let [east_m, north_m, _] = claim.at(share * claim.length_m()).point;
            line.project([east_m, north_m])
        };
        // Beyond its ends a distance from the true line is not lateral.
        let beside = |station_m: f64| 0.0 < station_m && station_m < line.length_m();
        (0..PLACES)
            .map(at)
            .filter(|foot| beside(foot.station_m))
            .map(|foot| foot.offset_m)
            .collect()
    }

    /// Whether at least half of the change is where `is_shown` (longitude, latitude in degrees).
    pub(super) fn is_half_shown(&self, is_shown: impl Fn([f64; 2]) -> bool) -> bool {
        let Some(frame) = &self.frame else {
            return false;
        };
        let cover = Cover::of(|place| {
            let [east_m, north_m] = self.place(place);
            let [longitude_deg, latitude_deg, _] = frame.to_wgs84([east_m, north_m, 0.0]);
            is_shown([longitude_deg, latitude_deg])
        });
        cover.share() >= 0.5
    }
}

/// A line in the plane of `frame`; an area is its outline. Elevation stays out.
fn plane_line(frame: &LocalFrame, wgs84: &[[f64; 3]], is_area: bool) -> Option<Polyline> {
    let closing = wgs84.first().filter(|_| is_area);
    let points = wgs84.iter().chain(closing);
    Polyline::new(points.map(|&[lon, lat, _]| frame.to_enu([lon, lat, 0.0]))).ok()
}

/// The changed stretch, where the geometry is that of the whole element.
fn stretch(line: Polyline, from_m: Option<f64>, to_m: Option<f64>) -> Polyline {
    let from_m = from_m.unwrap_or(0.0);
    let to_m = to_m.unwrap_or(line.length_m());
    if line.length_m() <= to_m - from_m + STRETCH_SLACK_M {
        return line;
    }
    Polyline::new(line.between(from_m, to_m)).unwrap_or(line)
}
