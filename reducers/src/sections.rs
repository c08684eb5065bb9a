//! A dense index of sections: every section of every element has its place in one array.
//!
//! Evidence is grouped by writing to that place: no row is hashed twice, compared or moved, and
//! integer sums need nothing else. Rows of one element follow each other in the store's files, so
//! the element is looked up once a run of them.

/// Multiplier of Fibonacci hashing: 2^64 over the golden ratio.
const SCATTER: u64 = 0x9E37_79B9_7F4A_7C15;

/// Where the sections of elements lie in an array of all sections.
#[derive(Debug, Clone)]
pub struct SectionIndex {
    /// Element and the place of its first section, by scattered id.
    entries: Vec<(i64, u32)>,
    /// First entry of each bucket, and the end of the last one.
    buckets: Vec<u32>,
    shift: u32,
    len: u32,
}

impl SectionIndex {
    /// The index of elements with their numbers of sections, which must not exceed 2^32 in all;
    /// sections lie in the order in which the elements are given.
    #[must_use]
    pub fn new(elements: impl IntoIterator<Item = (i64, u32)>) -> Self {
        let mut entries = Vec::new();
        let mut len = 0;
        for (element, sections) in elements {
            entries.push((element, len));
            len += sections;
        }
        let bits = entries.len().max(1).ilog2() + 1;
        let shift = 64 - bits;
        entries.sort_unstable_by_key(|&(element, _)| (scattered(element), element));
        let mut buckets = vec![0_u32; (1 << bits) + 1];
        for &(element, _) in &entries {
            buckets[bucket(element, shift) + 1] += 1;
        }
        for at in 1..buckets.len() {
            buckets[at] += buckets[at - 1];
        }
        Self {
            entries,
            buckets,
            shift,
            len,
        }
    }

    /// Sections in all.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len as usize
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Place of the first section of an element; none if it is not in the index.
    #[must_use]
    pub fn first(&self, element: i64) -> Option<u32> {
        let at = bucket(element, self.shift);
        let (from, to) = (self.buckets[at] as usize, self.buckets[at + 1] as usize);
        let found = self.entries[from..to].iter().find(|(id, _)| *id == element);
        found.map(|&(_, first)| first)
    }

    /// Places of the sections that rows speak of, in the order of the rows; `u32::MAX` for elements
    /// that are not in the index.
    pub fn places(&self, elements: &[i64], sections: &[i32], places: &mut Vec<u32>) {
        places.clear();
        let mut last = (i64::MIN, self.first(i64::MIN));
        places.extend(elements.iter().zip(sections).map(|(&element, &section)| {
            if element != last.0 {
                last = (element, self.first(element));
            }
            last.1
                .map_or(u32::MAX, |first| first + section.cast_unsigned())
        }));
    }
}

fn scattered(element: i64) -> u64 {
    element.cast_unsigned().wrapping_mul(SCATTER)
}

fn bucket(element: i64, shift: u32) -> usize {
    (scattered(element) >> shift) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_section_has_a_place_of_its_own() {
        let elements: Vec<(i64, u32)> = (0..1_000_i64)
            .map(|number| {
                (
                    number.wrapping_mul(0x5851_F42D_4C95_7F2D),
                    1 + number as u32 % 5,
                )
            })
            .collect();
        let index = SectionIndex::new(elements.iter().copied());
        let mut next = 0;
        for &(element, sections) in &elements {
            assert_eq!(index.first(element), Some(next));
            next += sections;
        }
        assert_eq!(index.len(), next as usize);
        assert_eq!(index.first(1), None);
        let mut places = Vec::new();
        index.places(&[elements[7].0, elements[7].0, 1], &[0, 1, 0], &mut places);
        let first = index.first(elements[7].0).unwrap_or(0);
        assert_eq!(places, [first, first + 1, u32::MAX]);
    }

    #[test]
    fn nothing_has_no_places() {
        let index = SectionIndex::new([]);
        assert!(index.is_empty() && index.first(7).is_none());
    }
}
