//! Lengths on a sphere, within half a per cent: enough to judge a line by, not to measure it.

pub(super) fn rough_length_m(points: &[[f64; 3]]) -> f64 {
    points
        .windows(2)
        .map(|pair| rough_distance_m(&pair[0], &pair[1]))
        .sum()
}

/// By the haversine formula.
pub(super) fn rough_distance_m(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let [a, b] = [a, b].map(|point| [point[0].to_radians(), point[1].to_radians()]);
    let [half_lon, half_lat] = [(b[0] - a[0]) / 2.0, (b[1] - a[1]) / 2.0];
    let chord2 = half_lat.sin().powi(2) + a[1].cos() * b[1].cos() * half_lon.sin().powi(2);
    2.0 * 6_371_000.0 * chord2.sqrt().min(1.0).asin()
}

/// Whether two lines run the same way rather than against each other, by their ends.
pub(super) fn run_alike(one: &[[f64; 3]], other: &[[f64; 3]]) -> bool {
    let ends = (one.first(), one.last(), other.first(), other.last());
    let (Some(one_0), Some(one_1), Some(other_0), Some(other_1)) = ends else {
        return false;
    };
    let alike = rough_distance_m(one_0, other_0) + rough_distance_m(one_1, other_1);
    let against = rough_distance_m(one_0, other_1) + rough_distance_m(one_1, other_0);
    alike <= against
}
