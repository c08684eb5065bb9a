//! Lanelet2: which of an OSM file's relations are lanelets for vehicles, and their borders.

use std::collections::{BTreeMap, HashMap};

use tilefold_schemas::{SetAside, SetAsideKind};

use super::border::{align, stitch};
use super::border_uses::BorderUses;
use super::osm::{Node, Osm, Relation, Way};
use super::paint::tag;
use super::roads::{Border, Lanelet, Roads};
use super::traffic;

pub(super) fn read(osm: &Osm, file: &str) -> Roads {
    let mut surveying = Surveying::new(osm);
    let mut roads = Roads::default();
    let mut found = BTreeMap::new();
    for relation in &osm.relations {
        let tags = &relation.thing.tags;
        if tag(tags, "type") != "lanelet" {
            continue;
        }
        if !traffic::is_for_vehicles(tags) {
            let subtype = tag(tags, "subtype").to_owned();
            *roads.not_roads.entry(subtype).or_default() += 1;
            continue;
        }
        let id = relation.thing.id;
        let made = match found.contains_key(&id) {
            true => Err("another lanelet has the same id".to_owned()),
            false => surveying.lanelet(relation),
        };
        match made {
            Ok(lanelet) => drop(found.insert(id, lanelet)),
            Err(why) => roads.set_aside.push(lost(relation, file, &why)),
        }
    }
    roads.lanelets = found.into_values().collect();
    roads.set_aside.sort();
    roads
}

fn lost(relation: &Relation, file: &str, why: &str) -> SetAside {
    let thing = &relation.thing;
    let reason = format!("lanelet {} ({}): {why}", thing.id, thing.place);
    SetAside::new(SetAsideKind::Element, file, reason).at(thing.place.line)
}

struct Surveying<'a> {
    osm: &'a Osm,
    /// The first way of each id.
    ways: HashMap<i64, &'a Way>,
    uses: BorderUses,
}

impl<'a> Surveying<'a> {
    fn new(osm: &'a Osm) -> Self {
        let mut ways = HashMap::with_capacity(osm.ways.len());
        for way in &osm.ways {
            ways.entry(way.thing.id).or_insert(way);
        }
        Self {
            osm,
            ways,
            uses: BorderUses::default(),
        }
    }

    fn lanelet(&mut self, relation: &Relation) -> Result<Lanelet, String> {
        if let Some(wrong) = &relation.thing.wrong {
            return Err(wrong.clone());
        }
        let (left, left_has_elevations) = self.border(relation, "left")?;
        let (right, right_has_elevations) = self.border(relation, "right")?;
        let (left, right) = align(left, right)?;
        let tags = &relation.thing.tags;
        Ok(Lanelet {
            id: relation.thing.id,
            subtype: tag(tags, "subtype").to_owned(),
            left,
            right,
            is_one_way: traffic::is_one_way(tags),
            speed_limit_m_s: traffic::speed_limit_m_s(tags),
            has_elevations: left_has_elevations && right_has_elevations,
            tags: tags.clone(),
        })
    }

    fn border(&mut self, relation: &Relation, role: &str) -> Result<(Border, bool), String> {
        let mut ways = Vec::new();
        for member in relation.members.iter().filter(|member| member.role == role) {
            match self.ways.get(&member.id) {
                Some(way) if member.is_way => ways.push(*way),
                _ => {
                    return Err(format!(
                        "its {role} border, way {}, is not in the file",
                        member.id
                    ));
                }
            }
        }
        if ways.is_empty() {
            return Err(format!("it has no {role} border"));
        }
        if let Some((id, wrong)) = ways.iter().find_map(wrong) {
            return Err(format!("way {id}: {wrong}"));
        }
        self.uses.count(&ways)?;
        let border = stitch(self.osm, &ways).map_err(|why| format!("its {role} border: {why}"))?;
        Ok((border, ways.iter().all(|way| self.has_elevations(way))))
    }

    fn has_elevations(&self, way: &Way) -> bool {
        let stands = |node| matches!(self.osm.nodes.get(node), Some(Node::At(_)));
        way.nodes.iter().all(stands)
    }
}

fn wrong<'a>(way: &&'a Way) -> Option<(i64, &'a str)> {
    let wrong = way.thing.wrong.as_deref()?;
    Some((way.thing.id, wrong))
}
