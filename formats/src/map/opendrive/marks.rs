//! The road marks of lanes: which are paint, what paint, and from where to where they run.
//!
//! | `type` | becomes |
//! | --- | --- |
//! | `solid`, `broken`, `solid solid`, `solid broken`, `broken solid`, `broken broken` | lane marking; two names go from the inside out, on lane 0 from left to right |
//! | `botts dots`, `custom` | lane marking, painted some other way |
//! | `none`, `curb`, `grass`, `edge`, anything else | no paint |

use tilefold_schemas::{Color, Marking};

use super::tree::Node;

/// A mark and where it lies in its section.
pub(super) struct Mark<'a> {
    pub(super) node: &'a Node,
    /// From and to, in metres along the road.
    pub(super) span: [f64; 2],
    pub(super) marking: Marking,
    /// How far its lines are beside the border, to the left, in metres.
    pub(super) shift_m: f64,
}

/// A `roadMark` of a lane.
pub(super) struct Found<'a> {
    /// Which of the lane's marks it is, from 0.
    pub(super) index: usize,
    pub(super) node: &'a Node,
    /// What it is, or why it cannot be used; none if it is no paint.
    pub(super) mark: Result<Option<Mark<'a>>, String>,
}

/// A border between lanes that marks lie on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    Left,
    Center,
    Right,
}

/// The marks of a lane in a section, in the order of the file.
pub(super) fn of_lane<'a>(lane: &'a Node, [start, end]: [f64; 2], of: Of) -> Vec<Found<'a>> {
    let mut begins: Vec<f64> = lane
        .all("roadMark")
        .filter_map(|node| node.number_or("sOffset", 0.0).ok())
        .collect();
    begins.sort_by(f64::total_cmp);
    let end_after = |offset: f64| {
        let next = begins.get(begins.partition_point(|other| *other <= offset));
        next.map_or(end, |next| (start + next).min(end))
    };
    let found = |(index, node)| Found {
        index,
        node,
        mark: read(node, start, of, end_after),
    };
    lane.all("roadMark").enumerate().map(found).collect()
}

/// The mark of a node in a section that begins at `start`.
fn read(
    node: &Node,
    start: f64,
    of: Of,
    end_after: impl Fn(f64) -> f64,
) -> Result<Option<Mark<'_>>, String> {
    let Some(marking) = marking(node.attribute("type"), of) else {
        return Ok(None);
    };
    let offset = node.number_or("sOffset", 0.0)?;
    Ok(Some(Mark {
        node,
        span: [start + offset.max(0.0), end_after(offset)],
        marking,
        shift_m: shift_m(node)?,
    }))
}

/// The colour that a mark says; what says nothing else is `standard`, which is white.
pub(super) fn color(node: &Node) -> Color {
    match node.attribute("color").to_ascii_lowercase().as_str() {
        "" => Color::Unknown,
        "standard" | "white" => Color::White,
        "yellow" => Color::Yellow,
        _ => Color::Other,
    }
}

fn marking(kind: &str, of: Of) -> Option<Marking> {
    let is_mirrored = of == Of::Left;
    Some(match kind {
        "solid" => Marking::Solid,
        "broken" => Marking::Dashed,
        "solid solid" => Marking::SolidSolid,
        "broken broken" => Marking::DashedDashed,
        "solid broken" if is_mirrored => Marking::DashedSolid,
        "broken solid" if is_mirrored => Marking::SolidDashed,
        "solid broken" => Marking::SolidDashed,
        "broken solid" => Marking::DashedSolid,
        "botts dots" | "custom" => Marking::Other,
        _ => return None,
    })
}

/// The middle of the lines that a mark lists.
fn shift_m(node: &Node) -> Result<f64, String> {
    let mut offsets = Vec::new();
    for line in node.all_in("type", "line") {
        offsets.push(line.number_or("tOffset", 0.0)?);
    }
    let count = offsets.len().max(1) as f64;
    Ok(offsets.iter().sum::<f64>() / count)
}
