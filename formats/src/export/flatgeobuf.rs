//! FlatGeobuf: changes with a spatial index (a packed Hilbert R-tree), for QGIS and whatever else
//! reads through GDAL. Without heights: readers refuse the combination of "any type" and "with z".

use std::io::Write;

use flatgeobuf::geozero::{self, ColumnValue, GeomProcessor, GeozeroGeometry, PropertyProcessor};
use flatgeobuf::{ColumnType, FgbCrs, FgbWriter, FgbWriterOptions, GeometryType};
use tilefold_schemas::ChangeRecord;
use tilefold_schemas::wkb::Geometry;

use super::attributes::{ATTRIBUTES, Type, Value, values};
use super::change::Change;
use super::error::ExportError;
use crate::geojson::{closed_ring, utc};

const FORMAT: &str = "FlatGeobuf";

/// Writes `records` as features on WGS 84, in the order of the index. Records without a geometry
/// are left out: their number is given back.
///
/// # Errors
/// If a record has an unknown code or a geometry that is none, or the output or the folder for
/// temporary files does not take the bytes.
pub fn write_flatgeobuf(
    records: &[ChangeRecord],
    out: &mut impl Write,
) -> Result<usize, ExportError> {
    let refuse = |error| ExportError::encode(FORMAT)(&error);
    let options = FgbWriterOptions {
        crs: FgbCrs {
            org: Some("EPSG"),
            code: 4326,
            name: Some("WGS 84"),
            ..FgbCrs::default()
        },
        detect_type: false,
        promote_to_multi: false,
        ..FgbWriterOptions::default()
    };
    let mut file = FgbWriter::create_with_options("changes", GeometryType::Unknown, options)
        .map_err(|error| ExportError::encode(FORMAT)(&error))?;
    for (name, kind) in ATTRIBUTES {
        file.add_column(name, column(kind), |_, _| {});
    }
    let mut without = 0;
    for record in records {
        let change = Change::of(record)?;
        let Some(geometry) = &change.geometry else {
            without += 1;
            continue;
        };
        let mut said = Ok(());
        file.add_feature_geom(Shape(geometry), |feature| said = tell(&change, feature))
            .and(said)
            .map_err(refuse)?;
    }
    file.write(out)
        .map_err(|error| ExportError::encode(FORMAT)(&error))?;
    Ok(without)
}

fn column(kind: Type) -> ColumnType {
    match kind {
        Type::Text => ColumnType::String,
        Type::Integer => ColumnType::Long,
        Type::Real => ColumnType::Double,
        Type::Time => ColumnType::DateTime,
    }
}

fn tell(change: &Change<'_>, feature: &mut impl PropertyProcessor) -> geozero::error::Result<()> {
    for (index, ((name, _), value)) in ATTRIBUTES.iter().zip(values(change)).enumerate() {
        match value {
            Value::None => continue,
            Value::Text(text) => feature.property(index, name, &ColumnValue::String(&text))?,
            Value::Integer(number) => feature.property(index, name, &ColumnValue::Long(number))?,
            Value::Real(number) => feature.property(index, name, &ColumnValue::Double(number))?,
            Value::Time(stamp_ns) => {
                let text = utc(stamp_ns);
                feature.property(index, name, &ColumnValue::DateTime(&text))?
            }
        };
    }
    Ok(())
}

/// A geometry as the library walks it.
struct Shape<'a>(&'a Geometry);

impl GeozeroGeometry for Shape<'_> {
    fn process_geom<P: GeomProcessor>(&self, to: &mut P) -> geozero::error::Result<()> {
        let Self(geometry) = self;
        if !geometry.is_area {
            to.linestring_begin(true, geometry.points.len(), 0)?;
            vertices(&geometry.points, to)?;
            return to.linestring_end(true, 0);
        }
        let ring = closed_ring(geometry.points.clone());
        to.polygon_begin(true, 1, 0)?;
        to.linestring_begin(false, ring.len(), 0)?;
        vertices(&ring, to)?;
        to.linestring_end(false, 0)?;
        to.polygon_end(true, 0)
    }
}

fn vertices(points: &[[f64; 3]], to: &mut impl GeomProcessor) -> geozero::error::Result<()> {
    for (index, &[longitude_deg, latitude_deg, _]) in points.iter().enumerate() {
        to.xy(longitude_deg, latitude_deg, index)?;
    }
    Ok(())
}
