//! Writes how a preset's receiver errs along a straight road, as CSV: one row per fix, drive by
//! drive.
//!
//! `receiver_error PRESET DRIVES < SPEEDS > ERRORS`: SPEEDS is a CSV whose first column is seconds
//! and whose last one is the speed in metres per second, under a header; every drive is driven so.

use std::error::Error;
use std::io::{self, BufWriter, Write};

use tilefold_city::{NoiseProfile, Random, Receiver};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let usage = "usage: receiver_error PRESET DRIVES < SPEEDS";
    let profile = NoiseProfile::load(&arguments.next().ok_or(usage)?)?;
    let drives: u32 = arguments.next().ok_or(usage)?.parse()?;
    let speeds = speeds(&io::read_to_string(io::stdin())?)?;

    let mut out = BufWriter::new(io::stdout().lock());
    writeln!(
        out,
        "drive,t_s,lateral_error_m,longitudinal_error_m,speed_mps"
    )?;
    for drive in 0..drives {
        let random = Random::new(1, "receiver error", drive);
        let mut receiver = Receiver::draw(&profile.of(drive).gnss, random);
        let mut last_s = 0.0;
        for &(now_s, speed_m_s) in &speeds {
            let fix = receiver.next_fix(now_s - last_s, 0.0);
            last_s = now_s;
            // The vehicle drives east: left is north, and an old position lies behind.
            let [east_m, north_m, _] = fix.error_m;
            let longitudinal_m = east_m - fix.delay_s * speed_m_s;
            writeln!(
                out,
                "{drive},{now_s:.4},{north_m:.4},{longitudinal_m:.4},{speed_m_s}"
            )?;
        }
    }
    Ok(out.flush()?)
}

/// Seconds with speeds.
fn speeds(text: &str) -> Result<Vec<(f64, f64)>, Box<dyn Error>> {
    let rows = text.lines().skip(1).map(|row| {
        let mut cells = row.split(',');
        let seconds = cells.next().ok_or("an empty row")?.parse()?;
        let speed = cells.next_back().ok_or("a row of one column")?.parse()?;
        Ok((seconds, speed))
    });
    rows.collect()
}
