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

/// A border between lanes that marks lie on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    Left,
    Center,
    Right,
}

/// The marks of a lane by their index in it, each with what it is or why it cannot be used; none for
/// what is no paint.
pub(super) fn of_lane<'a>(
    lane: &'a Node,
    [start, end]: [f64; 2],
    of: Of,
) -> Vec<(usize, &'a Node, Result<Option<Mark<'a>>, String>)> {
    let nodes: Vec<_> = lane.all("roadMark").enumerate().collect();
    let mut begins = Vec::new();
    for (_, node) in &nodes {
        begins.extend(node.number_or("sOffset", 0.0).ok());
    }
    begins.sort_by(f64::total_cmp);
    let next = |offset: f64| begins.get(begins.partition_point(|other| *other <= offset));
    let read = |node: &'a Node| {
        let Some(marking) = marking(node.attribute("type"), of) else {
            return Ok(None);
        };
        let offset = node.number_or("sOffset", 0.0)?;
        let to = next(offset).map_or(end, |next| (start + next).min(end));
        let span = [start + offset.max(0.0), to];
        let shift_m = shift_m(node)?;
        Ok(Some(Mark {
            node,
            span,
            marking,
            shift_m,
        }))
    };
    nodes
        .into_iter()
        .map(|(index, node)| (index, node, read(node)))
        .collect()
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
