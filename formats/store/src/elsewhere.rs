//! Data files that other processes wrote for a transaction of ours.
//!
//! A cluster's workers each hold a transaction with the same base, replace the rows of tiles that
//! are theirs alone, and hand over the names of what they wrote. Nothing of it is visible before the
//! one commit; files of a worker that died are stray files, as after any kill.

use serde::{Deserialize, Serialize};

use crate::data_file::DataFile;
use crate::error::StoreError;
use crate::layout::{Layout, StoredTable};
use crate::transaction::Transaction;

/// What a transaction elsewhere does to the files of one table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rewritten {
    /// The table.
    table: String,
    /// The version that it is based on.
    base: i64,
    /// Names of files that go.
    gone: Vec<String>,
    /// Files that come: name, size in bytes, statistics.
    come: Vec<(String, i64, String)>,
}

impl Transaction {
    /// What this transaction does to the files of a table, for another one with the same base.
    ///
    /// # Errors
    /// The table's log is damaged.
    pub fn rewritten<R: StoredTable>(&mut self) -> Result<Rewritten, StoreError> {
        let base = self.base().version();
        let before = self.base().table(R::NAME)?;
        let staged = self.stage(&Layout::of::<R>())?;
        let before = before.as_ref().map(|table| &table.files);
        let had = |name: &String| before.is_some_and(|files| files.contains_key(name));
        let come = staged.files.values().filter(|file| !had(&file.name));
        let come = come.map(|file| (file.name.clone(), file.size, file.statistics.clone()));
        let gone = before.into_iter().flat_map(|files| files.keys());
        let gone = gone.filter(|name| !staged.files.contains_key(*name));
        Ok(Rewritten {
            table: R::NAME.to_owned(),
            base,
            gone: gone.cloned().collect(),
            come: come.collect(),
        })
    }

    /// Takes over what another transaction with the same base did to a table's files.
    ///
    /// # Errors
    /// It has another base, or rewrote a file that is rewritten already.
    pub fn take_over<R: StoredTable>(&mut self, rewritten: &Rewritten) -> Result<(), StoreError> {
        let location = self.base().store().location();
        let refuse = |reason: String| StoreError::Elsewhere {
            location: location.clone(),
            table: R::NAME.to_owned(),
            reason,
        };
        let base = self.base().version();
        if rewritten.table != R::NAME || rewritten.base != base {
            return Err(refuse(format!(
                "they are of table `{}` at version {}, and wanted are those of version {base}",
                rewritten.table, rewritten.base
            )));
        }
        let files = &mut self.stage(&Layout::of::<R>())?.files;
        for name in &rewritten.gone {
            if files.remove(name).is_none() {
                return Err(refuse(format!("{name} was rewritten twice")));
            }
        }
        for (name, size, statistics) in &rewritten.come {
            let file = DataFile::from_log(name.clone(), *size, statistics.clone())
                .ok_or_else(|| refuse(format!("the statistics of {name} cannot be read")))?;
            if files.insert(name.clone(), file).is_some() {
                return Err(refuse(format!("{name} was written twice")));
            }
        }
        Ok(())
    }
}
