//! The algebra of evidence: what chunks testified, as a set of rows.
//!
//! A chunk is the atom. Ledgers are merged (a union: what comes twice counts once) and chunks are
//! subtracted again; rows have one canonical order, and a digest in it. Whatever way the same
//! chunks came in, split, shuffled, repeated, or in company that was taken out again, the ledger is
//! the same, to the bit.
//!
//! A chunk that is known better than before replaces what it said: [`Ledger::subtract`] it first.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use crate::digest::TableDigest;
use crate::id::{ChunkId, TileId, VehicleKey};
use crate::table::Table;
use crate::{ChunkRow, EvidenceRow, Footprint, Sighting};

/// A row that a chunk testified.
pub trait Testified: Table + Clone + Ord {
    /// The chunk.
    fn chunk(&self) -> ChunkId;
    /// The tile whose evidence it is.
    fn tile(&self) -> TileId;
    /// The order of rows in a ledger, which is also that of the store's files: total, so that equal
    /// sets have one order.
    fn canonical_order(&self, other: &Self) -> Ordering {
        self.cmp(other)
    }
}

impl ChunkRow {
    /// The chunk that the row is about.
    #[must_use]
    pub fn chunk(&self) -> ChunkId {
        ChunkId {
            vehicle: VehicleKey(self.vehicle),
            channel: self.channel,
            window: self.window,
        }
    }
}

macro_rules! testified {
    ($row:ty $(, $canonical_order:item)?) => {
        impl Testified for $row {
            fn chunk(&self) -> ChunkId {
                ChunkId {
                    vehicle: VehicleKey(self.vehicle),
                    channel: self.channel,
                    window: self.window,
                }
            }
            fn tile(&self) -> TileId {
                TileId(self.tile)
            }
            $($canonical_order)?
        }
    };
}
testified!(EvidenceRow);
testified!(Sighting);
testified!(
    Footprint,
    fn canonical_order(&self, other: &Self) -> Ordering {
        let along = |row: &Self| (row.tile, row.chunk(), row.at_ms);
        along(self).cmp(&along(other)).then_with(|| self.cmp(other))
    }
);

/// Rows in canonical order, each once.
#[derive(Debug, Clone, PartialEq)]
pub struct Ledger<R>(Vec<R>);

impl<R> Default for Ledger<R> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<R: Testified> Ledger<R> {
    /// The ledger of rows in any order, some of them perhaps repeated.
    #[must_use]
    pub fn of(mut rows: Vec<R>) -> Self {
        // Runs that are in order already, as they come from the store, cost one comparison a row.
        rows.sort_by(R::canonical_order);
        rows.dedup();
        Self(rows)
    }

    /// What either of two ledgers says.
    #[must_use]
    pub fn merge(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        Self::of(self.0)
    }

    /// What is left without these chunks: as if they had never been there.
    #[must_use]
    pub fn subtract(mut self, chunks: &BTreeSet<ChunkId>) -> Self {
        self.0.retain(|row| !chunks.contains(&row.chunk()));
        self
    }

    /// The rows of these tiles.
    #[must_use]
    pub fn within(mut self, tiles: &BTreeSet<TileId>) -> Self {
        self.0.retain(|row| tiles.contains(&row.tile()));
        self
    }

    /// The rows, in canonical order.
    #[must_use]
    pub fn rows(&self) -> &[R] {
        &self.0
    }

    /// As [`Self::rows`].
    #[must_use]
    pub fn into_rows(self) -> Vec<R> {
        self.0
    }

    /// Digest of the rows, as that of a store's table that holds just these.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut digest = TableDigest::new(&R::schema(), &[]);
        digest
            .update(&R::to_batch(self.0.clone()))
            .expect("rows of a ledger are integers and bytes, which have a canonical form");
        digest.finish()
    }
}
