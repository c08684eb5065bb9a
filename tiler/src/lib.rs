//! Where things are and how work is cut: geodesy, tiles, drives, chunks, plan, exchange.
