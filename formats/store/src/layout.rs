//! How each row type lies in the store: what it is sorted by, what is drawn, what is digested.

use arrow_schema::DataType;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::table::Table;
use tilefold_schemas::{
    ChangeRecord, ChunkRow, EvidenceRow, Footprint, LayerHeader, SensorRow, Sighting,
};

use crate::bbox;

/// Name of the column that places a row in a tile.
pub(crate) const TILE: &str = "tile";

/// A row type that has a table in the store.
///
/// A table with a column `tile` (32-bit integer) is *tiled*: it has one data file per coarse tile.
/// Any other table has one data file per job.
pub trait StoredTable: Table + Send {
    /// Columns that order the rows. Ties are broken by all other columns.
    const SORT_KEY: &'static [&'static str];
    /// WKB columns, the primary one first.
    const GEOMETRY: &'static [&'static str] = &[];
    /// Columns that say where a row was read from rather than what it is.
    const NOT_DIGESTED: &'static [&'static str] = &[];

    /// Whether the table has a column `tile`.
    #[must_use]
    fn tiled() -> bool {
        Self::schema()
            .field_with_name(TILE)
            .is_ok_and(|field| field.data_type() == &DataType::Int32)
    }
}

impl StoredTable for ElementRow {
    const SORT_KEY: &'static [&'static str] = &["tile", "element"];
    const GEOMETRY: &'static [&'static str] = &["geometry"];
}

impl StoredTable for EvidenceRow {
    const SORT_KEY: &'static [&'static str] = &[
        "tile", "element", "content", "section", "vehicle", "channel", "window", "method", "model",
    ];
}

impl StoredTable for Sighting {
    const SORT_KEY: &'static [&'static str] = &[
        "tile", "vehicle", "channel", "window", "track", "method", "model",
    ];
    const GEOMETRY: &'static [&'static str] = &["geometry"];
}

impl StoredTable for Footprint {
    const SORT_KEY: &'static [&'static str] = &[
        "tile", "vehicle", "channel", "window", "at_ms", "method", "model",
    ];
}

impl StoredTable for ChunkRow {
    const SORT_KEY: &'static [&'static str] = &["vehicle", "channel", "window", "method", "model"];
    const NOT_DIGESTED: &'static [&'static str] = &["log"];
}

impl StoredTable for ChangeRecord {
    const SORT_KEY: &'static [&'static str] = &["tile", "change"];
    const GEOMETRY: &'static [&'static str] = &["geometry_new", "geometry_old"];
}

impl StoredTable for LayerHeader {
    const SORT_KEY: &'static [&'static str] = &["tile"];
}

impl StoredTable for SensorRow {
    const SORT_KEY: &'static [&'static str] = &["vehicle", "parameter", "visibility"];
}

/// What the untyped parts of the crate need to know of a table.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) name: &'static str,
    pub(crate) schema: arrow_schema::SchemaRef,
    pub(crate) sort_key: &'static [&'static str],
    pub(crate) geometry: &'static [&'static str],
    pub(crate) not_digested: &'static [&'static str],
    pub(crate) tiled: bool,
}

impl Layout {
    /// The columns of a data file: those of the rows, and the box of what has geometry.
    pub(crate) fn stored_schema(&self) -> arrow_schema::SchemaRef {
        match self.geometry {
            [] => self.schema.clone(),
            _ => bbox::with_field(&self.schema),
        }
    }

    pub(crate) fn of<R: StoredTable>() -> Self {
        Self {
            name: R::NAME,
            schema: R::schema(),
            sort_key: R::SORT_KEY,
            geometry: R::GEOMETRY,
            not_digested: R::NOT_DIGESTED,
            tiled: R::tiled(),
        }
    }

    /// The tables that every store has from its creation; `layers` comes last.
    pub(crate) fn known() -> Vec<Self> {
        vec![
            Self::of::<ElementRow>(),
            Self::of::<EvidenceRow>(),
            Self::of::<Sighting>(),
            Self::of::<Footprint>(),
            Self::of::<ChunkRow>(),
            Self::of::<SensorRow>(),
            Self::of::<ChangeRecord>(),
            Self::of::<LayerHeader>(),
        ]
    }
}
