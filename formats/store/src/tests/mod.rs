//! Tests of the store as its callers see it, and of what is done to it.

mod buckets;
mod chaos;
mod damage;
mod elsewhere;
mod faulty;
mod figures;
mod files;
mod oracle;
mod reference;
mod round_trip;
mod rows;
mod time_travel;
mod vacuum;
mod writers;
