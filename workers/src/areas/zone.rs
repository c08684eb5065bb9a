//! Where a channel sees areas, and of which kinds, learnt from what it saw around the chunk.
//!
//! A channel that never tells of a kind says nothing of its absence.

use tilefold_schemas::ElementKind;

use super::seen::SeenArea;

/// Fewer sightings than this teach nothing.
const MIN_SEEN: usize = 8;
/// Share of the sightings that is cut off at each end: what strays is not the rule.
const TAIL: f64 = 0.03;
/// The border is kept off by this, in metres.
const MARGIN_M: f64 = 0.5;

/// The part of the road before the vehicle in which whole areas are seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AreaZone {
    /// Nearest and farthest range of an outline's vertices, in metres ahead.
    pub range_m: (f64, f64),
    /// How far to either side vertices lie, in metres.
    pub side_m: f64,
    /// How far to the side per metre ahead.
    pub slope: f64,
    /// Kinds that the channel tells of: bit `1 << code`.
    pub kinds: i16,
}

impl AreaZone {
    /// The zone in which these were seen; none if there are too few of them.
    #[must_use]
    pub fn learn<'a>(areas: impl Iterator<Item = &'a SeenArea>) -> Option<Self> {
        let (mut near, mut far, mut side, mut slope) = (vec![], vec![], vec![], vec![]);
        let mut kinds = 0;
        for area in areas {
            kinds |= 1 << area.kind.code();
            let most = |value: fn(&[f64; 2]) -> f64| {
                let values = area.points_m.iter().map(value);
                values.fold(f64::NEG_INFINITY, f64::max)
            };
            near.push(-most(|point| -point[0]));
            far.push(most(|point| point[0]));
            side.push(most(|point| point[1].abs()));
            slope.push(most(|point| point[1].abs() / point[0].max(0.1)));
        }
        (near.len() >= MIN_SEEN).then(|| Self {
            range_m: (quantile(near, TAIL), quantile(far, 1.0 - TAIL)),
            side_m: quantile(side, 1.0 - TAIL),
            slope: quantile(slope, 1.0 - TAIL),
            kinds,
        })
    }

    /// Whether the channel tells of a kind.
    #[must_use]
    pub fn tells_of(&self, kind: ElementKind) -> bool {
        self.kinds & (1 << kind.code()) != 0
    }

    /// Whether an outline with these vertices (vehicle frame, metres), whose place along the way is
    /// known to `sigma_m`, lies wholly inside.
    #[must_use]
    pub fn shows(&self, mut points_m: impl Iterator<Item = [f64; 2]>, sigma_m: f64) -> bool {
        let margin_m = MARGIN_M + sigma_m;
        points_m.all(|[x, y]| {
            let side_m = y.abs();
            self.range_m.0 + margin_m <= x
                && x <= self.range_m.1 - margin_m
                && side_m <= self.side_m
                && side_m <= self.slope * x
        })
    }
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_schemas::SignClass;

    fn sign(ahead_m: f64, left_m: f64) -> SeenArea {
        let corners = [(0.0, -0.5), (4.0, -0.5), (4.0, 0.5), (0.0, 0.5)];
        let points = corners.map(|(x, y)| [ahead_m + x, left_m + y]);
        SeenArea::new(ElementKind::GroundSign, SignClass::Slow, points.to_vec()).unwrap()
    }

    #[test]
    fn is_where_things_were_seen() {
        let seen: Vec<SeenArea> = (0..100)
            .map(|i| sign(4.0 + 0.12 * f64::from(i), 3.0))
            .collect();
        let zone = AreaZone::learn(seen.iter()).unwrap();
        assert!((zone.range_m.0 - 4.36).abs() < 0.2, "{zone:?}");
        assert!((zone.range_m.1 - 19.5).abs() < 0.2, "{zone:?}");
        let shows = |area: &SeenArea| zone.shows(area.points_m.iter().copied(), 0.0);
        assert!(shows(&sign(10.0, 0.0)));
        assert!(shows(&sign(10.0, -3.0)));
        assert!(!shows(&sign(10.0, 6.0)), "too far to the side");
        assert!(!shows(&sign(3.0, 0.0)), "too near");
        assert!(!shows(&sign(17.0, 0.0)), "too far");
        assert!(zone.tells_of(ElementKind::GroundSign));
        assert!(!zone.tells_of(ElementKind::Crosswalk));
    }

    #[test]
    fn who_saw_nothing_has_none() {
        assert_eq!(AreaZone::learn([].into_iter()), None);
        assert_eq!(AreaZone::learn([sign(8.0, 0.0)].iter()), None);
    }
}
