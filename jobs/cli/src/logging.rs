//! What the program says of itself while it works, on standard error: as lines for people, or as one
//! JSON object a line. Results never come this way, and are the same whatever is logged.

use std::fmt::{Debug, Write};
use std::io::IsTerminal;

use serde_json::{Map, Value};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::{Context, SubscriberExt};
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{Layer, fmt};

use crate::args::{LogForm, LogLevel};

/// Crates of ours begin so.
const OURS: &str = "tilefold";

/// From now on, what is at this level or above it is said in this form.
pub(crate) fn start(level: LogLevel, form: LogForm) {
    let heard = Targets::new()
        .with_target(OURS, filter(level))
        .with_default(of_others(level));
    let registry = tracing_subscriber::registry().with(heard);
    match form {
        LogForm::Text => registry
            .with(
                fmt::layer()
                    .with_writer(std::io::stderr)
                    .with_ansi(std::io::stderr().is_terminal()),
            )
            .init(),
        LogForm::Json => registry.with(Lines).init(),
    }
}

fn filter(level: LogLevel) -> LevelFilter {
    match level {
        LogLevel::Off => LevelFilter::OFF,
        LogLevel::Error => LevelFilter::ERROR,
        LogLevel::Warn => LevelFilter::WARN,
        LogLevel::Info => LevelFilter::INFO,
        LogLevel::Debug => LevelFilter::DEBUG,
        LogLevel::Trace => LevelFilter::TRACE,
    }
}

/// Storage and tables have much to say that concerns only who works on them.
fn of_others(level: LogLevel) -> LevelFilter {
    match level {
        LogLevel::Off | LogLevel::Error => LevelFilter::OFF,
        LogLevel::Warn | LogLevel::Info => LevelFilter::ERROR,
        LogLevel::Debug => LevelFilter::INFO,
        LogLevel::Trace => LevelFilter::TRACE,
    }
}

/// One JSON object an event: `time`, `level`, `target`, `message`, its fields, and under `in` the jobs
/// it belongs to, the outermost first.
///
/// An own layer of forty lines: the form that the crate has would have all that stands on it built
/// anew with one more feature, the tables included.
struct Lines;

/// Fields of a span, kept until an event asks for them.
struct Fields(Map<String, Value>);

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Lines {
    fn on_new_span(&self, attributes: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        let Some(span) = context.span(id) else { return };
        let mut fields = Map::from_iter([("name".to_owned(), span.name().into())]);
        attributes.record(&mut Taker(&mut fields));
        span.extensions_mut().insert(Fields(fields));
    }

    fn on_event(&self, event: &Event<'_>, context: Context<'_, S>) {
        let mut line = head(event.metadata().level(), event.metadata().target());
        event.record(&mut Taker(&mut line));
        let spans = context.event_scope(event).into_iter();
        let jobs: Vec<Value> = spans
            .flat_map(|scope| scope.from_root())
            .filter_map(|span| {
                let extensions = span.extensions();
                extensions
                    .get::<Fields>()
                    .map(|fields| Value::Object(fields.0.clone()))
            })
            .collect();
        line.insert("in".to_owned(), jobs.into());
        crate::report::complain(&Value::Object(line).to_string());
    }
}

fn head(level: &Level, target: &str) -> Map<String, Value> {
    let now = chrono::DateTime::<chrono::Utc>::from(std::time::SystemTime::now());
    let time = now.to_rfc3339_opts(chrono::SecondsFormat::Millis, true);
    Map::from_iter([
        ("time".to_owned(), time.into()),
        ("level".to_owned(), level.to_string().to_lowercase().into()),
        ("target".to_owned(), target.into()),
    ])
}

/// Takes fields as they are; what has no JSON form as text.
struct Taker<'a>(&'a mut Map<String, Value>);

impl Taker<'_> {
    fn take(&mut self, field: &Field, value: impl Into<Value>) {
        self.0.insert(field.name().to_owned(), value.into());
    }
}

impl Visit for Taker<'_> {
    fn record_f64(&mut self, field: &Field, value: f64) {
        self.take(field, value);
    }

    fn record_i64(&mut self, field: &Field, value: i64) {
        self.take(field, value);
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        self.take(field, value);
    }

    fn record_bool(&mut self, field: &Field, value: bool) {
        self.take(field, value);
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        self.take(field, value);
    }

    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let mut text = String::new();
        // Writing to a string does not fail.
        let _ = write!(text, "{value:?}");
        self.take(field, text);
    }
}
