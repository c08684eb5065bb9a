//! Borders of a lanelet: the ways of a role, stitched at the nodes that they share, and both borders
//! turned into one direction, the one in which the left one lies on the left.

use std::collections::HashMap;

use tilefold_schemas::limits::{MAX_ELEMENT_LENGTH_M, MAX_POINTS_PER_ELEMENT};

use super::osm::{Osm, Way};
use super::roads::{Border, BorderWay};
use super::rough::{rough_length_m, run_alike};
use super::traffic;

/// The border along `ways`, given in any order and direction. It runs as its ways happen to: see
/// [`align`].
pub(super) fn stitch(osm: &Osm, ways: &[&Way]) -> Result<Border, String> {
    let mut border = Border {
        ways: Vec::with_capacity(ways.len()),
        points: Vec::new(),
    };
    for (place, is_reversed) in chain(ways)? {
        let way = ways[place];
        let mut points = osm.points(way)?;
        if is_reversed {
            points.reverse();
        }
        // The first vertex of a way is the last one of the way before.
        let shared = usize::from(!border.points.is_empty());
        border.points.extend(points.drain(shared..));
        if border.points.len() > MAX_POINTS_PER_ELEMENT {
            return Err(format!(
                "a border has over {MAX_POINTS_PER_ELEMENT} points (MAX_POINTS_PER_ELEMENT)"
            ));
        }
        border.ways.push(part(way, is_reversed));
    }
    check_length(&border.points)?;
    Ok(border)
}

fn part(way: &Way, is_reversed: bool) -> BorderWay {
    let tags = &way.thing.tags;
    let along = BorderWay {
        id: way.thing.id,
        is_reversed: false,
        kind: traffic::border_kind(tags),
        crossing: traffic::crossing(tags),
    };
    match is_reversed {
        true => along.reversed(),
        false => along,
    }
}

fn check_length(points: &[[f64; 3]]) -> Result<(), String> {
    let length_m = rough_length_m(points);
    if length_m > MAX_ELEMENT_LENGTH_M {
        return Err(format!(
            "a border is {length_m:.0} m long, the limit is {MAX_ELEMENT_LENGTH_M} m (MAX_ELEMENT_LENGTH_M)"
        ));
    }
    if length_m <= 0.0 {
        return Err("a border has no length".to_owned());
    }
    Ok(())
}

/// The ways by place, one behind the other, and whether each is passed against its direction.
fn chain(ways: &[&Way]) -> Result<Vec<(usize, bool)>, String> {
    let mut ends = HashMap::<i64, Vec<usize>>::new();
    for (place, way) in ways.iter().enumerate() {
        for node in ends_of(way)? {
            ends.entry(node).or_default().push(place);
        }
    }
    let is_loose = |node: &i64| ends.get(node).is_some_and(|places| places.len() == 1);
    let mut walk = Vec::with_capacity(ways.len());
    let mut at = first_node(ways, is_loose)?;
    let mut before = None;
    while let Some(place) = onwards(&ends, at, before)? {
        if walk.len() == ways.len() || walk.first().is_some_and(|&(first, _)| first == place) {
            break;
        }
        let [first, last] = ends_of(ways[place])?;
        walk.push((place, first != at));
        at = if first == at { last } else { first };
        before = Some(place);
    }
    if walk.len() < ways.len() {
        let missing = ways.len() - walk.len();
        return Err(format!(
            "{missing} of a border's {} ways do not join the rest",
            ways.len()
        ));
    }
    Ok(walk)
}

/// An end that no other way shares; in a ring, the first node of the first way.
fn first_node(ways: &[&Way], is_loose: impl Fn(&i64) -> bool) -> Result<i64, String> {
    let mut fallback = None;
    for way in ways {
        let ends = ends_of(way)?;
        if let Some(&node) = ends.iter().find(|node| is_loose(node)) {
            return Ok(node);
        }
        fallback = fallback.or(Some(ends[0]));
    }
    fallback.ok_or_else(|| "a border has no ways".to_owned())
}

/// The way that leaves a node, other than the one that led there.
fn onwards(
    ends: &HashMap<i64, Vec<usize>>,
    node: i64,
    before: Option<usize>,
) -> Result<Option<usize>, String> {
    let places = ends.get(&node).map_or(&[][..], Vec::as_slice);
    if places.len() > 2 {
        return Err(format!("over two ways of a border meet in node {node}"));
    }
    Ok(places.iter().find(|&&place| Some(place) != before).copied())
}

fn ends_of(way: &Way) -> Result<[i64; 2], String> {
    match (way.nodes.first(), way.nodes.last()) {
        (Some(&first), Some(&last)) if way.nodes.len() > 1 => Ok([first, last]),
        _ => Err(format!("way {} has fewer than two points", way.thing.id)),
    }
}

/// Turns both borders into the direction in which `left` lies on the left.
pub(super) fn align(left: Border, right: Border) -> Result<(Border, Border), String> {
    let right = match run_alike(&left.points, &right.points) {
        true => right,
        false => right.reversed(),
    };
    let area = twice_area(&left.points, &right.points);
    // Of one line there and back, rounding may leave an area.
    if area == 0.0 || left.ways == right.ways {
        return Err("its borders enclose nothing".to_owned());
    }
    // Along the left border and back along the right one is clockwise.
    match area < 0.0 {
        true => Ok((left, right)),
        false => Ok((left.reversed(), right.reversed())),
    }
}

/// Twice the area of the ring, in square degrees of latitude; positive if counter-clockwise.
fn twice_area(left: &[[f64; 3]], right: &[[f64; 3]]) -> f64 {
    let ring = || left.iter().chain(right.iter().rev());
    let Some(&[lon0, lat0, _]) = left.first() else {
        return 0.0;
    };
    let shrink = lat0.to_radians().cos();
    let flat = |[lon, lat, _]: &[f64; 3]| [(lon - lon0) * shrink, lat - lat0];
    ring()
        .zip(ring().cycle().skip(1))
        .map(|(a, b)| (flat(a), flat(b)))
        .map(|([ax, ay], [bx, by])| ax * by - ay * bx)
        .sum()
}
