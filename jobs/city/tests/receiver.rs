//! The receiver of `good_gnss` against a recorded one (comma2k19), where the real data is.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::path::{Path, PathBuf};

use tilefold_city::{NoiseProfile, Random, Receiver};

/// Fixes between which errors are compared: 0.1 s to 20 s at the record's rate.
const GAPS: [usize; 8] = [1, 2, 5, 10, 20, 50, 100, 200];
const DRIVES: u32 = 200;

/// Seconds, and errors to the side and along the road in metres, of one drive; with its speeds.
struct Record {
    seconds: Vec<f64>,
    lateral_m: Vec<f64>,
    longitudinal_m: Vec<f64>,
    speed_m_s: Vec<f64>,
}

fn recorded() -> Option<Record> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA").map_or(beside, PathBuf::from);
    let path = folder.join("logs/gnss_error/comma2k19_ublox.csv");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("SKIPPED: no {}; set TILEFOLD_TEST_DATA", path.display());
        return None;
    };
    let rows = text.lines().skip(1);
    let rows = rows.map(|row| row.split(',').map(|cell| cell.parse().unwrap()).collect());
    let rows: Vec<Vec<f64>> = rows.collect();
    let column = |index: usize| rows.iter().map(|row| row[index]).collect();
    Some(Record {
        seconds: column(0),
        lateral_m: column(3),
        longitudinal_m: column(4),
        speed_m_s: column(5),
    })
}

fn simulated(drive: u32, record: &Record) -> [Vec<f64>; 2] {
    let profile = NoiseProfile::load("good_gnss").unwrap();
    let mut receiver = Receiver::draw(&profile.of(drive).gnss, Random::new(7, "receiver", drive));
    let mut last_s = 0.0;
    let fixes = record.seconds.iter().zip(&record.speed_m_s);
    let errors = fixes.map(|(&now_s, speed_m_s)| {
        let fix = receiver.next_fix(now_s - last_s, 0.0);
        last_s = now_s;
        (fix.error_m[1], fix.error_m[0] - fix.delay_s * speed_m_s)
    });
    let (lateral_m, longitudinal_m) = errors.unzip();
    [lateral_m, longitudinal_m]
}

/// How much an error changes over a number of fixes: the root of the semivariogram.
fn change_m(errors: &[f64], gap: usize) -> f64 {
    let changes = errors[gap..]
        .iter()
        .zip(errors)
        .map(|(b, a)| (b - a).powi(2));
    (0.5 * changes.sum::<f64>() / (errors.len() - gap) as f64).sqrt()
}

#[test]
fn errors_change_as_recorded_ones_do() {
    let Some(record) = recorded() else { return };
    let drives: Vec<[Vec<f64>; 2]> = (0..DRIVES).map(|drive| simulated(drive, &record)).collect();
    let recorded = [&record.lateral_m, &record.longitudinal_m];
    for (axis, name) in ["lateral", "longitudinal"].into_iter().enumerate() {
        for gap in GAPS {
            let mut all: Vec<f64> = drives.iter().map(|d| change_m(&d[axis], gap)).collect();
            all.sort_by(f64::total_cmp);
            let (low, high) = (all[all.len() / 40], all[all.len() - 1 - all.len() / 40]);
            let real = change_m(recorded[axis], gap);
            assert!(
                (low..=high).contains(&real),
                "{name} over {gap}: {real}, not {low} to {high}"
            );
        }
    }
}
