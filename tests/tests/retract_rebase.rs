//! `retract` and `rebase`: the store holds what it would hold had things been so from the start.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use tilefold_city::CityFiles;
use tilefold_engine::{EngineError, Forget, drives::drives};
use tilefold_schemas::{ChunkRow, Verdict};
use tilefold_tests::trial::{Trial, small_city};

const SALT: Option<[u8; 32]> = Some([3; 32]);

static CITY: LazyLock<CityFiles> = LazyLock::new(|| {
    let folder = format!("retract_rebase-{}", std::process::id());
    small_city(&Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder))
});

fn after(map: &Path, logs: &[PathBuf]) -> Trial {
    let trial = Trial::with_salt(map, SALT);
    trial.run(logs);
    trial
}

fn name(log: &Path) -> String {
    log.file_name().unwrap().to_str().unwrap().to_owned()
}

#[test]
fn a_drive_that_was_taken_out_was_never_there() {
    let whole = after(&CITY.before_map, &CITY.logs);
    let rows: Vec<ChunkRow> = whole.rows();
    let all = drives(&rows);
    assert_eq!(all.len(), CITY.logs.len(), "a log is a drive here");
    for (number, drive) in all.iter().enumerate().step_by(3) {
        let log = rows.iter().find(|row| {
            drive
                .chunks
                .iter()
                .any(|c| c.window == row.window && c.vehicle.0 == row.vehicle)
        });
        let log = log.unwrap().log.clone();
        let trial = after(&CITY.before_map, &CITY.logs);
        let report = trial.retract(&Forget::Drive(drive.id.clone())).unwrap();
        assert_eq!(report.drives, std::slice::from_ref(&drive.id));
        assert!(report.run_again.is_empty() && report.tiles_reduced > 0);
        let others: Vec<PathBuf> = CITY
            .logs
            .iter()
            .filter(|l| l.display().to_string() != log)
            .cloned()
            .collect();
        assert_eq!(others.len() + 1, CITY.logs.len(), "drive {number}");
        assert_eq!(trial.content(), after(&CITY.before_map, &others).content());
        // It can come back.
        trial.run(&CITY.logs);
        assert_eq!(trial.content(), whole.content());
    }
}

#[test]
fn everything_can_be_taken_out() {
    let trial = after(&CITY.before_map, &CITY.logs);
    let all = Forget::Time {
        from_ns: i64::MIN,
        to_ns: i64::MAX,
    };
    trial.retract(&all).unwrap();
    assert_eq!(
        trial.content(),
        Trial::with_salt(&CITY.before_map, SALT).content()
    );
    let error = trial.retract(&all).unwrap_err();
    assert!(error.to_string().contains("no evidence at all"), "{error}");
}

#[test]
fn by_vehicle_by_log_and_by_time() {
    let (first, others) = CITY.logs.split_first().unwrap();
    let without = after(&CITY.before_map, others).content();
    let by_log = after(&CITY.before_map, &CITY.logs);
    by_log.retract(&Forget::Log(name(first))).unwrap();
    assert_eq!(by_log.content(), without);

    let by_time = after(&CITY.before_map, &CITY.logs);
    let rows: Vec<ChunkRow> = by_time.rows();
    let of_first = || {
        rows.iter()
            .filter(|row| row.log == first.display().to_string())
    };
    let from_ns = of_first().map(|row| row.given_from_ns).min().unwrap();
    let to_ns = of_first().map(|row| row.given_to_ns).max().unwrap() + 1;
    by_time.retract(&Forget::Time { from_ns, to_ns }).unwrap();
    assert_eq!(by_time.content(), without);

    let key = tilefold_schemas::VehicleKey(of_first().next().unwrap().vehicle);
    let by_vehicle = after(&CITY.before_map, &CITY.logs);
    by_vehicle
        .retract(&Forget::Vehicle(key.to_string()))
        .unwrap();
    let left: Vec<ChunkRow> = by_vehicle.rows();
    assert!(left.iter().all(|row| row.vehicle != key.0) && !left.is_empty());
    let logs: std::collections::BTreeSet<PathBuf> =
        left.iter().map(|row| PathBuf::from(&row.log)).collect();
    let logs: Vec<PathBuf> = logs.into_iter().collect();
    assert_eq!(
        by_vehicle.content(),
        after(&CITY.before_map, &logs).content()
    );
}

#[test]
fn part_of_a_drive_takes_its_neighbours_along_and_names_their_log() {
    let trial = after(&CITY.before_map, &CITY.logs[..1]);
    let rows: Vec<ChunkRow> = trial.rows();
    let middle = &rows[rows.len() / 2];
    let second = Forget::Time {
        from_ns: middle.first_ns,
        to_ns: middle.first_ns + 1_000_000_000,
    };
    let report = trial.retract(&second).unwrap();
    assert!(report.chunks > 1);
    assert_eq!(report.run_again, [CITY.logs[0].display().to_string()]);
    let left: Vec<ChunkRow> = trial.rows();
    assert!(
        left.iter()
            .all(|row| !(row.given_from_ns..=row.given_to_ns).contains(&middle.first_ns))
    );
}

#[test]
fn what_is_not_there_is_named_beside_what_is() {
    let trial = after(&CITY.before_map, &CITY.logs[..2]);
    let there = trial.rows::<ChunkRow>();
    let version = trial.run(&CITY.logs[..2]).version;
    for forget in [
        Forget::Drive("nobody-20260101T000000Z".to_owned()),
        Forget::Vehicle("nobody".to_owned()),
        Forget::Log("nothing.mcap".to_owned()),
        Forget::Time {
            from_ns: 0,
            to_ns: 1,
        },
    ] {
        let error = trial.retract(&forget).unwrap_err();
        assert!(matches!(error, EngineError::Nothing(_)));
        let text = error.to_string();
        let is_named = match forget {
            Forget::Log(_) => text.contains(&name(&CITY.logs[0])),
            _ => text.contains(&tilefold_schemas::VehicleKey(there[0].vehicle).to_string()),
        };
        assert!(is_named, "{text}");
    }
    assert_eq!(trial.run(&CITY.logs[..2]).version, version);
}

#[test]
fn the_same_map_again_is_no_new_version() {
    let trial = after(&CITY.before_map, &CITY.logs[..2]);
    let report = trial.rebase(&CITY.before_map);
    assert!(!report.is_new_version);
    assert_eq!((report.new, report.gone, report.outdated), (0, 0, 0));
    assert_eq!(report.unchanged, report.elements);
}

#[test]
fn a_new_map_and_its_logs_again_are_as_good_as_a_new_store() {
    let trial = after(&CITY.before_map, &CITY.logs);
    let claims = trial.rows::<tilefold_schemas::ChangeRecord>();
    let claimed = claims
        .iter()
        .filter(|c| Verdict::from_code(c.verdict).is_some_and(Verdict::is_change))
        .count();
    let report = trial.rebase(&CITY.after_map);
    println!("{claimed} claims; {report:#?}");
    assert!(report.is_new_version && report.unchanged > 0 && report.outdated > 0);
    assert!(!report.accepted.is_empty());
    // What the map now has is claimed no more.
    let again = trial.run(&CITY.logs);
    assert_eq!(again.chunks_mapped, report.outdated);
    assert_eq!(
        trial.content(),
        after(&CITY.after_map, &CITY.logs).content()
    );
    // And back.
    trial.rebase(&CITY.before_map);
    trial.run(&CITY.logs);
    assert_eq!(
        trial.content(),
        after(&CITY.before_map, &CITY.logs).content()
    );
}

#[test]
fn chunks_far_from_all_edits_need_not_be_mapped_again() {
    let trial = after(&CITY.before_map, &CITY.logs);
    let before = trial.content();
    // One element more, far from the city: nothing of what was said depends on it.
    let map = std::fs::read_to_string(&CITY.before_map).unwrap();
    let lonely = r#"<node id="900001" lat="50.2" lon="10.2"/><node id="900002" lat="50.2003" lon="10.2"/>
<way id="900003"><nd ref="900001"/><nd ref="900002"/><tag k="type" v="line_thin"/><tag k="subtype" v="solid"/></way>
</osm>"#;
    let folder = tempfile::tempdir().unwrap();
    let edited = folder.path().join(CITY.before_map.file_name().unwrap());
    std::fs::write(&edited, map.replace("</osm>", lonely)).unwrap();
    let report = trial.rebase(&edited);
    assert_eq!(
        (
            report.new,
            report.gone,
            report.outdated,
            report.rows_dropped
        ),
        (1, 0, 0, 0)
    );
    assert_eq!(trial.content(), after(&edited, &CITY.logs).content());
    trial.rebase(&CITY.before_map);
    assert_eq!(trial.content(), before);
}
