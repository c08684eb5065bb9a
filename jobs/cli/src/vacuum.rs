//! `vacuum`: what no kept version needs is removed.

use std::error::Error;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use tilefold_store::{Retention, Store, Vacuumed};

use crate::args::Args;
use crate::report::{Outcome, print};

const DAY_MS: i64 = 24 * 60 * 60 * 1_000;
const HOUR_MS: i64 = 60 * 60 * 1_000;

/// Removes data files of versions that were replaced more than `days` ago.
///
/// # Errors
/// The store is damaged, or the storage refuses.
pub(crate) fn vacuum_store(
    args: &Args,
    store: &Path,
    (days, hours): (u32, u32),
    is_dry: bool,
) -> Result<Outcome, Box<dyn Error>> {
    let now_ms = i64::try_from(SystemTime::now().duration_since(UNIX_EPOCH)?.as_millis())?;
    let retention = Retention {
        since_ms: now_ms.saturating_sub(i64::from(days) * DAY_MS),
        written_since_ms: now_ms.saturating_sub(i64::from(hours) * HOUR_MS),
        is_dry,
    };
    let done = Store::open(store.to_path_buf())?.vacuum(&retention)?;
    print(args, &done, |done| words(done, is_dry))?;
    Ok(Outcome::Done)
}

fn words(done: &Vacuumed, is_dry: bool) -> String {
    format!(
        "{} {} data files ({:.1} MB); versions from {} on can be read",
        if is_dry { "would remove" } else { "removed" },
        done.files,
        done.bytes as f64 * 1e-6,
        done.oldest_version
    )
}
