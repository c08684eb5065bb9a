//! How results, losses and errors are printed: JSON on standard output, or words.

use std::error::Error;
use std::io::{ErrorKind, Write};

use serde::Serialize;
use tilefold_schemas::SetAside;
use tilefold_schemas::limits::MAX_SET_ASIDE_LISTED;

use crate::args::{Args, Format};

/// Lines of what is usual that are listed.
const USUAL_LISTED: usize = 3;

/// Says a line on standard error, as `eprintln!`; but where nobody listens any more, it is not said.
macro_rules! tell {
    ($($part:tt)*) => {
        crate::report::complain(&format!($($part)*))
    };
}

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// Done.
    Done,
    /// Done, but something was set aside.
    SetAside,
    /// A check found something to mend.
    Wrong,
    /// A comparison found a difference.
    Differs,
}

impl Outcome {
    /// Done; with losses if there are any.
    #[must_use]
    pub(crate) fn with(set_aside: &[SetAside]) -> Self {
        if set_aside.iter().any(|loss| loss.kind.is_damage()) {
            Self::SetAside
        } else {
            Self::Done
        }
    }
}

/// Prints `value` as JSON, or what `words` makes of it.
///
/// # Errors
/// Standard output is closed.
pub(crate) fn print<T: Serialize>(
    args: &Args,
    value: &T,
    words: impl FnOnce(&T) -> String,
) -> Result<(), Box<dyn Error>> {
    let text = match args.format {
        Format::Json => serde_json::to_string_pretty(value)?,
        _ => words(value),
    };
    to_stdout(&format!("{}\n", text.trim_end()))
}

/// Prints a text. A reader that has seen enough (`tilefold show STORE | head`) is no failure.
///
/// # Errors
/// Standard output cannot be written for another reason.
pub(crate) fn to_stdout(text: &str) -> Result<(), Box<dyn Error>> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(format!("cannot write to standard output: {error}").into())
        }
        _ => Ok(()),
    }
}

/// Says a line on standard error, if anybody listens.
pub(crate) fn complain(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Whether an error is that the reader of standard output has gone.
pub(crate) fn is_reader_gone(error: &(dyn Error + 'static)) -> bool {
    let mut cause = Some(error);
    while let Some(error) = cause {
        let io = error.downcast_ref::<std::io::Error>();
        if io.is_some_and(|io| io.kind() == ErrorKind::BrokenPipe) {
            return true;
        }
        cause = error.source();
    }
    false
}

/// Lists what was set aside, on standard error.
pub(crate) fn print_set_aside(set_aside: &[SetAside]) {
    if set_aside.is_empty() {
        return;
    }
    let count: u64 = set_aside.iter().map(|loss| loss.count).sum();
    tell!("set aside: {count}");
    let (damage, usual): (Vec<_>, Vec<_>) =
        set_aside.iter().partition(|loss| loss.kind.is_damage());
    list(&damage, MAX_SET_ASIDE_LISTED);
    list(&usual, USUAL_LISTED);
    if !usual.is_empty() {
        tell!("  (every drive has frames that are `uncovered`: they are no damage)");
    }
}

fn list(set_aside: &[&SetAside], most: usize) {
    for loss in set_aside.iter().take(most) {
        // Names from files may hold anything; control characters do not reach the terminal.
        let line: String = line(loss)
            .chars()
            .map(|c| if c.is_control() { '\u{fffd}' } else { c })
            .collect();
        tell!("  {line}");
    }
    let more = set_aside.iter().skip(most);
    let count: u64 = more.clone().map(|loss| loss.count).sum();
    if count > 0 {
        let lines = more.len();
        tell!("  and {lines} more such lines, {count} things (all of them by --format json)");
    }
}

/// A loss as a person reads it: with its time as a time.
fn line(loss: &SetAside) -> String {
    let text = loss.to_string();
    let Some(stamp_ns) = loss.stamp_ns else {
        return text;
    };
    let time = chrono::DateTime::from_timestamp_nanos(stamp_ns);
    let time = time.to_rfc3339_opts(chrono::SecondsFormat::Millis, true);
    text.replacen(&format!(" t={stamp_ns}"), &format!(" {time}"), 1)
}

/// Prints an error with its causes.
pub(crate) fn print_error(args: &Args, error: &dyn Error) {
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
    if args.format == Format::Json {
        // Whoever cannot be told by JSON is told by the line below.
        let _ = to_stdout(&format!("{}\n", serde_json::json!({ "error": text })));
    }
    tell!("error: {text}");
}
