//! Stores in buckets of S3, against the server that `cargo xtask s3-test` starts (moto).
//!
//! The server checks signatures, and has the bucket `maps`; its address and the credentials stand in
//! the environment (`AWS_...`) and reach the program from there.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::{Town, on, run, tilefold, tilefold_in};

fn store(town: &Town, name: &str) -> PathBuf {
    let store = PathBuf::from(format!("s3://maps/{name}"));
    init(&store, &town.city.before_map).with_code(0);
    store
}

fn init(store: &Path, map: &Path) -> crate::support::Said {
    tilefold([
        "init".as_ref(),
        store.as_os_str(),
        "--map".as_ref(),
        map.as_os_str(),
    ])
}

fn json(command: &str, store: &Path) -> Value {
    on(command, store, &["--format", "json"])
        .with_code(0)
        .json()
}

/// Digests of the layers; with the counts, what `show` says of them.
fn layers(store: &Path) -> (Value, Value) {
    (
        json("verify", store)["digest"].clone(),
        json("show", store)["tiles"].clone(),
    )
}

#[test]
#[ignore = "needs an S3 server: cargo xtask s3-test"]
fn a_bucket_is_as_good_as_a_folder() {
    let town = Town::new();
    let folder = town.store("folder", &town.city.logs);
    let bucket = store(&town, "as-good-as/ä-folder");
    run(&bucket, &town.city.logs, &[]).with_code(0);
    assert_eq!(layers(&bucket), layers(&folder));
    assert_eq!(json("export", &bucket), json("export", &folder));

    let again = init(&bucket, &town.city.before_map).with_code(1);
    again.names(&["s3://maps/as-good-as/ä-folder", "already"]);
    on("retract", &bucket, &["--log", &name(&town.city.logs[0])]).with_code(0);
    on("compare", &bucket, &[]).with_code(4);
    on(
        "vacuum",
        &bucket,
        &["--retain-days", "0", "--grace-hours", "0"],
    )
    .with_code(0);
    on("show", &bucket, &["--version", "1"])
        .with_code(1)
        .names(&["vacuum", "oldest one"]);
    let rest = town.store("rest", &town.city.logs[1..]);
    assert_eq!(layers(&bucket), layers(&rest));
}

fn name(log: &Path) -> String {
    log.file_name().unwrap().to_string_lossy().into_owned()
}

#[test]
#[ignore = "needs an S3 server: cargo xtask s3-test"]
fn eight_programs_at_once_make_one_history_and_nothing_is_lost() {
    let town = Town::new();
    let logs = &town.city.logs;
    let bucket = store(&town, "eight");
    std::thread::scope(|scope| {
        for writer in 0..8 {
            // Six drives and eight programs: two drives come twice.
            let portion = [logs[writer % logs.len()].clone()];
            let bucket = &bucket;
            scope.spawn(move || run(bucket, &portion, &["--threads", "1"]).with_code(0));
        }
    });
    let history = json("log", &bucket);
    let history = history.as_array().unwrap();
    let versions = history.iter().map(|line| line["version"].as_u64().unwrap());
    assert!(
        versions.eq(0..8),
        "six runs after `create` and `init`: {history:?}"
    );
    let runs = history.iter().filter(|line| line["operation"] == "run");
    assert_eq!(runs.count(), logs.len());
    assert_eq!(layers(&bucket), layers(&town.store("one", logs)));
}

#[test]
#[ignore = "needs an S3 server: cargo xtask s3-test"]
fn what_is_wrong_with_a_bucket_is_said() {
    let town = Town::new();
    let map = &town.city.before_map;
    init(Path::new("s3://nowhere/city"), map)
        .with_code(1)
        .names(&["s3://nowhere/city", "no such bucket", "NoSuchBucket"]);
    on("log", Path::new("s3://maps/nowhere"), &[])
        .with_code(1)
        .names(&["s3://maps/nowhere", "no tilefold.json", "tilefold init"]);
    on("log", Path::new("s3:///city"), &[])
        .with_code(1)
        .names(&["no bucket", "s3://BUCKET"]);
    on("log", Path::new("gs://maps/city"), &[])
        .with_code(1)
        .names(&["`gs`", "s3://BUCKET"]);

    let with = |name: &str, value: &str| {
        tilefold_in([(name, value)], ["log", "s3://maps/city"]).with_code(1)
    };
    with("AWS_SECRET_ACCESS_KEY", "wrong").names(&[
        "credentials are refused",
        "AWS_SECRET_ACCESS_KEY",
        "SignatureDoesNotMatch",
    ]);
    with("AWS_ACCESS_KEY_ID", "AKIAWRONG").names(&["InvalidAccessKeyId"]);
    with("AWS_ENDPOINT_URL", "http://127.0.0.1:9").names(&["does not answer", "AWS_ENDPOINT_URL"]);
}

#[test]
#[ignore = "needs an S3 server: cargo xtask s3-test"]
fn a_map_may_come_from_a_disk_but_a_store_needs_no_folder() {
    let town = Town::new();
    let bucket = store(&town, "no-folder");
    run(&bucket, &town.city.logs[..1], &[]).with_code(0);
    let here: Vec<_> = fs::read_dir(".")
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert!(
        here.iter()
            .all(|name| !name.to_string_lossy().starts_with("s3:")),
        "{here:?}"
    );
}
