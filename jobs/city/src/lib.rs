//! A seeded simulated city with known changes.
