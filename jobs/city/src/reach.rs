//! How far one can drive from each lane: what routes choose where to begin and to turn by.

use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};

use crate::world::{Lane, World};

/// The lane graph's reach, of all lanes of a world.
pub(crate) struct Reach {
    /// Per lane: metres of different lanes that lie ahead on the best way, its own among them. Where
    /// one can drive round and round, every lane of the round counts once: what is driven twice is
    /// seen twice, and no more of it.
    ahead_m: Vec<f64>,
    /// Lanes outside of junctions: where a route can begin.
    roads: Vec<usize>,
    /// Lanes that none leads into: where the map begins.
    entries: Vec<usize>,
}

impl Reach {
    pub(crate) fn new(world: &World) -> Self {
        let lanes = &world.lanes;
        let mut is_led_into = vec![false; lanes.len()];
        for &next in lanes.iter().flat_map(|lane| &lane.next) {
            is_led_into[next] = true;
        }
        let is_road = |&lane: &usize| !lanes[lane].is_junction;
        let roads: Vec<usize> = (0..lanes.len()).filter(is_road).collect();
        let entries = (0..lanes.len()).filter(|&lane| !is_led_into[lane]);
        Self {
            ahead_m: ahead_m(lanes),
            entries: entries.collect(),
            roads,
        }
    }

    /// Metres that lie ahead from a lane's begin.
    pub(crate) fn ahead_m(&self, lane: usize) -> f64 {
        self.ahead_m[lane]
    }

    /// Lanes on which a route of `length_m` can begin; where no lane reaches so far, those of at
    /// least `least_m` by which the map is entered, and in the end all roads.
    pub(crate) fn starts(&self, length_m: f64, least_m: f64) -> Vec<usize> {
        let reaching = |lanes: &[usize], metres: f64| -> Vec<usize> {
            let reaches = |&lane: &usize| self.ahead_m[lane] >= metres;
            lanes.iter().copied().filter(reaches).collect()
        };
        let far = reaching(&self.roads, length_m);
        let starts = match far.is_empty() {
            true => reaching(&self.entries, least_m),
            false => far,
        };
        match starts.is_empty() {
            true => self.roads.clone(),
            false => starts,
        }
    }
}

fn ahead_m(lanes: &[Lane]) -> Vec<f64> {
    let edges = lanes.iter().enumerate().flat_map(|(index, lane)| {
        let edge = move |&next: &usize| (index as u32, next as u32);
        lane.next.iter().map(edge)
    });
    let mut graph: DiGraph<(), ()> = DiGraph::from_edges(edges);
    while graph.node_count() < lanes.len() {
        graph.add_node(());
    }
    let mut ahead_m = vec![0.0; lanes.len()];
    // Rounds come after those that they lead into.
    for round in kosaraju_scc(&graph) {
        let members = || round.iter().map(|node: &NodeIndex| node.index());
        let own_m: f64 = members().map(|lane| length_m(&lanes[lane])).sum();
        let beyond = members().flat_map(|lane| &lanes[lane].next);
        let beyond_m = beyond.map(|&next| ahead_m[next]).fold(0.0, f64::max);
        for lane in members() {
            ahead_m[lane] = own_m + beyond_m;
        }
    }
    ahead_m
}

fn length_m(lane: &Lane) -> f64 {
    let step = |pair: &[[f64; 3]]| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
    lane.centre.windows(2).map(step).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lane(length_m: f64, next: &[usize]) -> Lane {
        Lane {
            centre: vec![[0.0; 3], [length_m, 0.0, 0.0]],
            width_m: 3.0,
            speed_m_s: 10.0,
            next: next.to_vec(),
            left: None,
            right: None,
            is_junction: false,
        }
    }

    #[test]
    fn a_round_counts_once_and_the_better_way_is_taken() {
        // 0 leads into the round 1, 2, which leaves over 3; 4 leads to 3 and to 5; 6 is alone.
        let lanes = [
            lane(10.0, &[1]),
            lane(20.0, &[2]),
            lane(30.0, &[1, 3]),
            lane(40.0, &[]),
            lane(50.0, &[5, 3]),
            lane(60.0, &[]),
            lane(70.0, &[]),
        ];
        let expected = [100.0, 90.0, 90.0, 40.0, 110.0, 60.0, 70.0];
        assert_eq!(ahead_m(&lanes), expected);
    }
}
