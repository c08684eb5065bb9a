//! What was not used, and why. Nothing is lost in silence (promise P6): whoever cannot use a
//! frame, a pose, a chunk or a file hands a [`SetAside`] up instead of dropping it.

use std::fmt;

/// The name under which a loss is counted.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum SetAsideKind {
    /// A file that could not be opened or is not what it should be.
    File,
    /// A stretch of a log: a chunk with a wrong checksum, a cut end, a record over its limit.
    LogSection,
    /// A message that could not be decoded.
    Message,
    /// A position or orientation that cannot be true.
    Pose,
    /// A detection frame that has no pose, or cannot be projected.
    Frame,
    /// A sound frame captured where there is no position: before the first fix, after the last,
    /// or in a gap. Every drive has some, so it is counted and listed, but is no damage.
    Uncovered,
    /// A drive that lacks what the map stage needs.
    Drive,
    /// A map element that could not be read.
    Element,
}

impl SetAsideKind {
    /// The name as it is printed and counted.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::File => "file",
            Self::LogSection => "log_section",
            Self::Message => "message",
            Self::Pose => "pose",
            Self::Frame => "frame",
            Self::Uncovered => "uncovered",
            Self::Drive => "drive",
            Self::Element => "element",
        }
    }
}

impl SetAsideKind {
    /// Whether something was lost that should have been usable: what exit code 3 reports.
    #[must_use]
    pub fn is_damage(self) -> bool {
        self != Self::Uncovered
    }
}

/// One thing (or `count` alike things) that was set aside.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub struct SetAside {
    /// What kind of thing.
    pub kind: SetAsideKind,
    /// The file it was in.
    pub file: String,
    /// Byte offset in the file (or line, for text), where known.
    pub offset: Option<u64>,
    /// Topic, where there is one.
    pub topic: Option<String>,
    /// Capture time in nanoseconds since the Unix epoch, where there is one.
    pub stamp_ns: Option<i64>,
    /// Why, with the limit and the value.
    pub reason: String,
    /// How many alike things this stands for.
    pub count: u64,
}

impl SetAside {
    /// One thing of `kind` in `file`, for `reason`.
    #[must_use]
    pub fn new(kind: SetAsideKind, file: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            kind,
            file: file.into(),
            offset: None,
            topic: None,
            stamp_ns: None,
            reason: reason.into(),
            count: 1,
        }
    }

    /// The same, at a byte offset (or line).
    #[must_use]
    pub fn at(mut self, offset: u64) -> Self {
        self.offset = Some(offset);
        self
    }

    /// The same, on a topic.
    #[must_use]
    pub fn on(mut self, topic: impl Into<String>) -> Self {
        self.topic = Some(topic.into());
        self
    }

    /// The same, at a capture time.
    #[must_use]
    pub fn when(mut self, stamp_ns: i64) -> Self {
        self.stamp_ns = Some(stamp_ns);
        self
    }

    /// The same, standing for `count` alike things.
    #[must_use]
    pub fn times(mut self, count: u64) -> Self {
        self.count = count;
        self
    }
}

impl fmt::Display for SetAside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.kind.name(), self.file)?;
        if let Some(offset) = self.offset {
            write!(f, " @{offset}")?;
        }
        if let Some(topic) = &self.topic {
            write!(f, " {topic}")?;
        }
        if let Some(stamp_ns) = self.stamp_ns {
            write!(f, " t={stamp_ns}")?;
        }
        if self.count > 1 {
            write!(f, " ({} times)", self.count)?;
        }
        write!(f, ": {}", self.reason)
    }
}
