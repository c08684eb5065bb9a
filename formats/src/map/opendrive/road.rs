//! A road: its reference line in space, and the lanes beside it.

use tilefold_schemas::limits::{MAX_ELEMENT_LENGTH_M, MAX_LANES_PER_SIDE};

use super::curve::{Curve, Pose};
use super::profile::Profile;
use super::tree::Node;
use crate::map::xml::shown;

/// A road without its lanes.
pub(super) struct Road {
    pub(super) length_m: f64,
    curve: Curve,
    elevation_m: Profile,
    /// How the road is banked: positive where its left side is higher.
    superelevation_rad: Profile,
    lane_offset_m: Profile,
}

/// Lanes that do not change between two stations.
pub(super) struct Section<'a> {
    pub(super) start: f64,
    pub(super) end: f64,
    /// The line between both sides.
    pub(super) center: Option<&'a Node>,
    /// From the inside out, as on the right.
    pub(super) left: Side<'a>,
    pub(super) right: Side<'a>,
}

/// The lanes of one side, from the inside out.
pub(super) struct Side<'a> {
    /// 1 on the left, -1 on the right.
    sign: f64,
    pub(super) lanes: Vec<Lane<'a>>,
    /// Lanes that cannot be placed, and why.
    pub(super) lost: Vec<(&'a Node, String)>,
}

pub(super) struct Lane<'a> {
    pub(super) node: &'a Node,
    outer: Outer,
    /// Whether it is not banked with the road.
    is_level: bool,
}

/// How a lane says where it ends; stations count from the section's start.
enum Outer {
    Width(Profile),
    Border(Profile),
}

/// The place of a point across the road, in metres to the left of the reference line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Across {
    pub(super) t: f64,
    /// Up to where the road is banked.
    pub(super) banked: f64,
}

impl Across {
    /// A point on the road's own surface.
    pub(super) fn banked(t: f64) -> Self {
        Self { t, banked: t }
    }
}

impl Road {
    pub(super) fn read(node: &Node) -> Result<Self, String> {
        let length_m = node.number("length")?;
        if !(0.0..=MAX_ELEMENT_LENGTH_M).contains(&length_m) {
            return Err(format!(
                "it is {length_m} m long, the limit is {MAX_ELEMENT_LENGTH_M} m (MAX_ELEMENT_LENGTH_M)"
            ));
        }
        let lateral = node.all_in("lateralProfile", "superelevation");
        Ok(Self {
            length_m,
            curve: Curve::read(node.all_in("planView", "geometry"))?,
            elevation_m: Profile::read(node.all_in("elevationProfile", "elevation"), "s")?,
            superelevation_rad: Profile::read(lateral, "s")?,
            lane_offset_m: Profile::read(node.all_in("lanes", "laneOffset"), "s")?,
        })
    }

    /// The reference line's pose at a station.
    pub(super) fn pose(&self, s: f64) -> Pose {
        self.curve.at(s)
    }

    /// The middle of the lanes: where lane 0 is.
    pub(super) fn lane_offset(&self, s: f64) -> f64 {
        self.lane_offset_m.at(s)
    }

    /// A point on the road, in the frame of the file.
    pub(super) fn point(&self, s: f64, across: Across) -> [f64; 3] {
        let pose = self.curve.at(s);
        let (sin, cos) = pose.heading_rad.sin_cos();
        let (bank_sin, bank_cos) = self.superelevation_rad.at(s).sin_cos();
        let flat = across.banked * bank_cos + across.t - across.banked;
        [
            pose.x - flat * sin,
            pose.y + flat * cos,
            self.elevation_m.at(s) + across.banked * bank_sin,
        ]
    }

    /// The stations between `from` and `to` at which the line of the road changes its formula.
    pub(super) fn breaks(&self, from: f64, to: f64) -> Vec<f64> {
        let mut breaks: Vec<f64> = self.curve.breaks(from, to).collect();
        for profile in [
            &self.elevation_m,
            &self.superelevation_rad,
            &self.lane_offset_m,
        ] {
            breaks.extend(profile.breaks(0.0, from, to));
        }
        breaks
    }

    /// The sections of the road, in the direction of its line.
    pub(super) fn sections<'a>(&self, node: &'a Node) -> Result<Vec<Section<'a>>, String> {
        let mut starts = Vec::new();
        for section in node.all_in("lanes", "laneSection") {
            starts.push((section.number("s")?, section));
        }
        starts.sort_by(|one, other| one.0.total_cmp(&other.0));
        let ends = starts
            .iter()
            .skip(1)
            .map(|next| next.0)
            .chain([self.length_m]);
        let spans = starts.iter().zip(ends);
        Ok(spans
            .map(|(&(start, node), end)| Section::read(node, start, end))
            .collect())
    }
}

impl<'a> Section<'a> {
    fn read(node: &'a Node, start: f64, end: f64) -> Self {
        Self {
            start,
            end,
            center: node.all_in("center", "lane").next(),
            left: Side::read(node.all_in("left", "lane").collect(), 1),
            right: Side::read(node.all_in("right", "lane").collect(), -1),
        }
    }
}

impl<'a> Side<'a> {
    fn read(nodes: Vec<&'a Node>, sign: i64) -> Self {
        let mut side = Self {
            sign: sign as f64,
            lanes: Vec::new(),
            lost: Vec::new(),
        };
        let mut numbered = Vec::with_capacity(nodes.len());
        for node in nodes {
            match node.attribute("id").parse::<i64>() {
                Ok(id) if id.signum() == sign => numbered.push((id, node)),
                _ => side.lost.push((node, wrong_id(node, sign))),
            }
        }
        // Stable: of one id, the one that comes first in the file stays first.
        numbered.sort_by_key(|(id, _)| id.unsigned_abs());
        for (id, node) in numbered {
            if let Err(why) = side.take(id.saturating_mul(sign), node) {
                side.lost.push((node, why));
            }
        }
        side
    }

    /// Takes the lane that is `number` lanes from the inside.
    fn take(&mut self, number: i64, node: &'a Node) -> Result<(), String> {
        let next = self.lanes.len() as i64 + 1;
        if number < next {
            return Err("another lane of its section has the same id".to_owned());
        }
        if number > next {
            let inner = next * self.sign as i64;
            return Err(format!(
                "lane {inner}, which it lies beyond, is not in its section"
            ));
        }
        if self.lanes.len() >= MAX_LANES_PER_SIDE {
            return Err(format!(
                "there are over {MAX_LANES_PER_SIDE} lanes on its side (MAX_LANES_PER_SIDE)"
            ));
        }
        let inner_is_level = self.lanes.last().is_some_and(|lane| lane.is_level);
        self.lanes.push(Lane {
            node,
            outer: Outer::read(node)?,
            is_level: inner_is_level || matches!(node.attribute("level"), "true" | "1"),
        });
        Ok(())
    }

    /// Where the outer border of the lane at `index` is, at a station of `section`.
    pub(super) fn outer_border(&self, index: usize, ds: f64, lane_offset: f64) -> Across {
        let mut out = 0.0;
        let mut banked = None;
        for lane in self.lanes.iter().take(index + 1) {
            if lane.is_level && banked.is_none() {
                banked = Some(out);
            }
            out = match &lane.outer {
                Outer::Width(width) => out + width.at(ds).max(0.0),
                Outer::Border(border) => border.at(ds) * self.sign,
            };
        }
        let t = |out: f64| lane_offset + self.sign * out;
        Across {
            t: t(out),
            banked: t(banked.unwrap_or(out)),
        }
    }

    /// The stations at which the outer border of the lane at `index` changes its formula.
    pub(super) fn breaks(&self, index: usize, start: f64, from: f64, to: f64) -> Vec<f64> {
        let inner = self.lanes.iter().take(index + 1);
        let profiles = inner.map(|lane| match &lane.outer {
            Outer::Width(profile) | Outer::Border(profile) => profile,
        });
        profiles
            .flat_map(|profile| profile.breaks(start, from, to))
            .collect()
    }
}

impl Outer {
    /// A width outweighs a border.
    fn read(lane: &Node) -> Result<Self, String> {
        let width = Profile::read(lane.all("width"), "sOffset")?;
        let border = Profile::read(lane.all("border"), "sOffset")?;
        match width.is_empty() && !border.is_empty() {
            true => Ok(Self::Border(border)),
            false => Ok(Self::Width(width)),
        }
    }
}

fn wrong_id(node: &Node, sign: i64) -> String {
    let side = if sign > 0 { "left" } else { "right" };
    format!(
        "{:?} is no id of a lane on the {side}",
        shown(node.attribute("id"))
    )
}
