//! The map stage: one chunk in, keyed evidence out.
