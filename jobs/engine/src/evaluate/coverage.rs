//! How many vehicles looked at how many elements: what a fleet could say at all.

use std::collections::BTreeMap;

use tilefold_schemas::ChangeRecord;
use tilefold_tiler::map_index::MapIndex;

use crate::picture::Picture;
use crate::picture::bars::{Bar, bars};

/// The fewest vehicles of each bar, and its name. A claim takes five.
const BARS: [(i32, &str); 6] = [
    (0, "none"),
    (1, "1"),
    (2, "2 to 4"),
    (5, "5 to 9"),
    (10, "10 to 19"),
    (20, "20 and more"),
];

/// Elements by the number of vehicles that looked at them; of an element's parts the best known counts.
pub(super) fn coverage(map: &MapIndex, records: &[ChangeRecord]) -> Picture {
    let mut vehicles: BTreeMap<i64, i32> = BTreeMap::new();
    for record in records {
        if let Some(element) = record.element {
            let most = vehicles.entry(element).or_default();
            *most = record.vehicles.max(*most);
        }
    }
    let mut counts = [0_u32; BARS.len()];
    for mapped in map.elements() {
        let looked = vehicles.get(&mapped.element.id.0).copied().unwrap_or(0);
        let bar = BARS.iter().rposition(|&(fewest, _)| looked >= fewest);
        counts[bar.unwrap_or(0)] += 1;
    }
    let drawn = BARS.iter().zip(counts).map(|(&(_, name), count)| Bar {
        name: name.to_owned(),
        value: f64::from(count),
        figure: count.to_string(),
    });
    bars(
        "elements by the vehicles that looked",
        &drawn.collect::<Vec<_>>(),
    )
}
