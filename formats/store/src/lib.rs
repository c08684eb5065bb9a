//! The versioned tile store: Delta tables, commits, time travel.
