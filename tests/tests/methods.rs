//! Evidence that was made in different ways is never added up.

#![allow(clippy::unwrap_used)] // What fails to be made ends its test.

use tilefold_city::{CitySpec, Site, write};
use tilefold_engine::{EngineError, InitOptions, Registering, RunOptions, Silent, init, run};
use tilefold_schemas::EvidenceRow;
use tilefold_schemas::evidence::{METHOD_VERSION, UNREGISTERED_METHOD};
use tilefold_store::{Store, TileFilter};

#[test]
fn a_store_without_registration_takes_none_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let spec = CitySpec {
        seed: 5,
        site: Site::Drawn { km: 1.0 },
        vehicles: 2,
        drives: 2,
        drive_km: 0.8,
        ..CitySpec::default()
    };
    let files = write(&spec, folder.path()).unwrap();
    let store = folder.path().join("store");
    let options = InitOptions {
        tile_level: 15,
        salt: None,
    };
    init(&store, &[files.before_map], &options).unwrap();
    let off = RunOptions {
        registering: Registering::Off,
        ..RunOptions::default()
    };
    run(&store, &files.logs[..1], off, &Silent).unwrap();
    let refused = run(&store, &files.logs, RunOptions::default(), &Silent).unwrap_err();
    assert!(
        matches!(
            refused,
            EngineError::OtherMethod { found, wanted }
                if found == UNREGISTERED_METHOD && wanted == METHOD_VERSION
        ),
        "{refused}"
    );
    run(&store, &files.logs, off, &Silent).unwrap();
    let snapshot = Store::open(store).unwrap().snapshot(None).unwrap();
    let rows: Vec<EvidenceRow> = snapshot.read(TileFilter::All).unwrap();
    assert!(!rows.is_empty());
    assert!(rows.iter().all(|row| row.method == UNREGISTERED_METHOD));
}
