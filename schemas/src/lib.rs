//! The nouns that every other crate of Tilefold speaks.
//!
//! No I/O and no decisions live here: only what things are called, in which units and frames they
//! are, how they become Arrow columns, and which limits hold for what comes from outside.

pub mod column;
pub mod digest;
pub mod element;
pub mod evidence;
pub mod fixed;
pub mod id;
pub mod layer;
pub mod ledger;
pub mod limits;
pub mod log;
pub mod observation;
pub mod picture;
pub mod region;
pub mod set_aside;
pub mod table;
pub mod wkb;

pub use element::{Color, Element, ElementKind, Marking, SignClass};
pub use evidence::{ChunkRow, EvidenceRow, Footprint, Sighting};
pub use id::{ChunkId, ContentHash, ElementId, TileId, VehicleKey};
pub use layer::{ChangeRecord, LayerHeader, SensorRow, Verdict};
pub use ledger::{Ledger, Testified};
pub use picture::Picture;
pub use region::Region;
pub use set_aside::{SetAside, SetAsideKind};
