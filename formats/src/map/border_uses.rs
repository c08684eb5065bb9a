//! How many borders each way is a part of. Without a bound, a short file could make one long way the
//! border of any number of lanelets.

use std::collections::HashMap;

use tilefold_schemas::limits::MAX_LANELETS_PER_WAY;

use super::osm::Way;

#[derive(Default)]
pub(super) struct BorderUses {
    counts: HashMap<i64, usize>,
}

impl BorderUses {
    /// Counts the ways of one border.
    pub(super) fn count(&mut self, ways: &[&Way]) -> Result<(), String> {
        for way in ways {
            let id = way.thing.id;
            let count = self.counts.entry(id).or_default();
            *count += 1;
            if *count > MAX_LANELETS_PER_WAY {
                return Err(format!(
                    "over {MAX_LANELETS_PER_WAY} lanelets have way {id} as a border (MAX_LANELETS_PER_WAY)"
                ));
            }
        }
        Ok(())
    }
}
