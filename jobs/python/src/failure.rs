//! Errors of the engine as Python exceptions: the whole sentence, its causes included.

use std::error::Error;

use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use tilefold_engine::EngineError;
use tilefold_store::StoreError;

create_exception!(
    tilefold,
    TilefoldError,
    PyException,
    "What failed, where, why, and what mends it. Nothing has changed."
);
create_exception!(
    tilefold,
    ConflictError,
    TilefoldError,
    "Another writer committed meanwhile. The same job may be run again."
);

/// An error as an exception.
pub(crate) fn failed(error: &(dyn Error + 'static)) -> PyErr {
    let text = sentence(error);
    if is_conflict(error) {
        ConflictError::new_err(text)
    } else {
        TilefoldError::new_err(text)
    }
}

fn sentence(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        // A cause that is quoted in its effect is not said twice.
        if !text.contains(&more) {
            text.push_str(": ");
            text.push_str(&more);
        }
        cause = error.source();
    }
    text
}

fn is_conflict(error: &(dyn Error + 'static)) -> bool {
    let store = match error.downcast_ref::<EngineError>() {
        Some(EngineError::Store(error)) => Some(error),
        _ => error.downcast_ref::<StoreError>(),
    };
    matches!(
        store,
        Some(StoreError::Conflict { .. } | StoreError::Busy { .. })
    )
}
