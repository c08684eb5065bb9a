//! A table: a row struct whose fields are Arrow columns, declared once by [`table!`](crate::table!).

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;

use crate::column::ColumnError;

/// A row type that is stored as a table.
pub trait Table: Sized {
    /// Table name, also its folder in the store.
    const NAME: &'static str;
    /// The Arrow schema of the table.
    fn schema() -> SchemaRef;
    /// Rows as one Arrow batch, in the order given.
    fn to_batch(rows: Vec<Self>) -> RecordBatch;
    /// The rows of a batch; columns are found by name, so their order does not matter.
    ///
    /// # Errors
    /// A column is missing, has another type, or holds a null where none may be.
    fn from_batch(batch: &RecordBatch) -> Result<Vec<Self>, ColumnError>;
}

/// Declares a row struct and its [`Table`] implementation from one list of fields.
#[macro_export]
macro_rules! table {
    (
        $(#[$meta:meta])*
        pub struct $row:ident in $name:literal {
            $( $(#[$field_meta:meta])* pub $field:ident: $type:ty, )+
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq)]
        pub struct $row {
            $( $(#[$field_meta])* pub $field: $type, )+
        }

        impl $crate::table::Table for $row {
            const NAME: &'static str = $name;

            fn schema() -> arrow_schema::SchemaRef {
                let mut fields = Vec::new();
                $( fields.extend(<$type as $crate::column::Column>::fields(stringify!($field))); )+
                std::sync::Arc::new(arrow_schema::Schema::new(fields))
            }

            fn to_batch(rows: Vec<Self>) -> arrow_array::RecordBatch {
                $( let mut $field: Vec<$type> = Vec::with_capacity(rows.len()); )+
                for row in rows {
                    $( $field.push(row.$field); )+
                }
                let mut arrays = Vec::new();
                $( arrays.extend(<$type as $crate::column::Column>::arrays($field)); )+
                arrow_array::RecordBatch::try_new(<Self as $crate::table::Table>::schema(), arrays)
                    .expect("columns were made from the same field list as the schema")
            }

            fn from_batch(
                batch: &arrow_array::RecordBatch,
            ) -> Result<Vec<Self>, $crate::column::ColumnError> {
                $(
                    let mut $field =
                        <$type as $crate::column::Column>::values(stringify!($field), batch)?
                            .into_iter();
                )+
                let mut rows = Vec::with_capacity(batch.num_rows());
                for _ in 0..batch.num_rows() {
                    rows.push(Self {
                        $( $field: $field.next().expect("every column has as many values as the batch has rows"), )+
                    });
                }
                Ok(rows)
            }
        }
    };
}
