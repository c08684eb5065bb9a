//! The reduce stage: evidence in, verdicts and layers out.
