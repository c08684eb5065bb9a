//! Identities. All of them come from data, never from file names, so that a renamed or
//! re-chunked copy of a log is recognised as the same (method.md, section 1).

use std::fmt;

macro_rules! id {
    ($(#[$meta:meta])* $name:ident($inner:ty)) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub $inner);
    };
}

id!(
    /// The id an element has in its base map. Formats with textual ids hash them to 63 bits and
    /// keep the text as the tag `source_id`.
    ElementId(i64)
);
id!(
    /// Hash of what an element is (kind, marking, colour, class, geometry to the millimetre):
    /// an edited element has another hash and stops collecting old evidence.
    ContentHash(i64)
);
id!(
    /// Packed tile id of the NDS quadtree (level and Morton code in one integer).
    TileId(i32)
);
id!(
    /// Keyed hash of a vehicle's id: what is stored instead of it.
    VehicleKey(i64)
);

impl TileId {
    /// Level of the tile in the quadtree (0 to 15).
    ///
    /// A packed id is the tile's Morton number (`2 * level + 1` bits) below a marker bit at
    /// position `16 + level` (NDS, packed tile ids); at level 15 that is the sign bit.
    #[must_use]
    pub fn level(self) -> u32 {
        (self.0.cast_unsigned() >> 16).checked_ilog2().unwrap_or(0)
    }

    /// The tile at `level` that contains this one; itself where `level` is not above its own.
    #[must_use]
    pub fn ancestor(self, level: u32) -> Self {
        let own = self.level();
        if level >= own {
            return self;
        }
        let number = self.0.cast_unsigned() & !(1 << (16 + own));
        let number = number >> (2 * (own - level));
        Self((number | 1 << (16 + level)).cast_signed())
    }
}

impl fmt::Display for ElementId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
impl fmt::Display for TileId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
impl fmt::Display for VehicleKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl VehicleKey {
    /// The key of the vehicle called `vehicle` under the store's secret `salt`.
    #[must_use]
    pub fn new(salt: &[u8; 32], vehicle: &str) -> Self {
        Self(first_i64(&blake3::keyed_hash(salt, vehicle.as_bytes())))
    }
}

/// A chunk: the absolute-time window `[window * W, (window + 1) * W)` of one vehicle's channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChunkId {
    /// Whose frames these are.
    pub vehicle: VehicleKey,
    /// Hash of the camera's or detection channel's name.
    pub channel: i64,
    /// Which window of time, counted in chunk lengths since the Unix epoch.
    pub window: i64,
}

/// A stable 64-bit hash of `text`, as stored for channel and model names.
#[must_use]
pub fn hash_text(text: &str) -> i64 {
    first_i64(&blake3::hash(text.as_bytes()))
}

/// The first eight bytes of a hash as a little-endian integer.
#[must_use]
pub fn first_i64(hash: &blake3::Hash) -> i64 {
    let mut bytes = [0; 8];
    bytes.copy_from_slice(&hash.as_bytes()[..8]);
    i64::from_le_bytes(bytes)
}
