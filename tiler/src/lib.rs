//! Where things are and how work is cut: geodesy, tiles, drives, chunks, plan, exchange.

pub mod chunk;
pub mod geodesy;
pub mod map_index;
pub mod mgrs;
pub mod recording;
pub mod side;
pub mod station;
pub mod tile;
