//! Points of lines, found row by row, joined into lines from the bottom of the picture to its top.

/// Where something crosses a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Node {
    pub(crate) row: usize,
    /// Along the row, in its own unit.
    pub(crate) x: f64,
}

/// Joins nodes, given by row from the top, into chains from the bottom up.
///
/// `cost` says how badly a node continues a chain (its nodes so far, as row and index), and none
/// where it does not; of all pairs of a row the cheapest are taken first, and each node and chain
/// once. A chain ends where it lacks more than `max_gap` rows.
pub(crate) fn join(
    rows: &[Vec<Node>],
    max_gap: usize,
    cost: impl Fn(&[(usize, usize)], (usize, usize)) -> Option<f64>,
) -> Vec<Vec<(usize, usize)>> {
    let mut done = Vec::new();
    let mut open: Vec<Vec<(usize, usize)>> = Vec::new();
    for (row, nodes) in rows.iter().enumerate().rev() {
        let is_lost = |chain: &Vec<(usize, usize)>| {
            chain
                .last()
                .is_none_or(|(last, _)| last - row > max_gap + 1)
        };
        done.extend(open.extract_if(.., |chain| is_lost(chain)));
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (at, chain) in open.iter().enumerate() {
            let costs = (0..nodes.len()).map(|node| (cost(chain, (row, node)), at, node));
            pairs.extend(costs.filter_map(|(cost, at, node)| Some((cost?, at, node))));
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut is_taken = vec![false; nodes.len()];
        let mut is_continued = vec![false; open.len()];
        for (_, chain, node) in pairs {
            if !is_taken[node] && !is_continued[chain] {
                (is_taken[node], is_continued[chain]) = (true, true);
                open[chain].push((row, node));
            }
        }
        let free = (0..nodes.len()).filter(|node| !is_taken[*node]);
        open.extend(free.map(|node| vec![(row, node)]));
    }
    done.extend(open);
    done.sort();
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(of: &[&[f64]]) -> Vec<Vec<Node>> {
        let row = |(row, xs): (usize, &&[f64])| xs.iter().map(|&x| Node { row, x }).collect();
        of.iter().enumerate().map(row).collect()
    }

    fn near(rows: &[Vec<Node>]) -> impl Fn(&[(usize, usize)], (usize, usize)) -> Option<f64> {
        move |chain, (row, node)| {
            let (last, from) = *chain.last()?;
            let apart = (rows[last][from].x - rows[row][node].x).abs();
            (apart < 1.5).then_some(apart)
        }
    }

    #[test]
    fn two_lines_that_meet_stay_two_and_gaps_are_bridged() {
        let rows = rows(&[&[4.6], &[3.9, 5.2], &[], &[3.0, 6.0], &[2.0, 7.0]]);
        let chains = join(&rows, 1, near(&rows));
        assert_eq!(
            chains,
            [
                vec![(4, 0), (3, 0), (1, 0)],
                vec![(4, 1), (3, 1), (1, 1), (0, 0)]
            ]
        );
        assert_eq!(join(&rows, 0, near(&rows)).len(), 4);
    }
}
