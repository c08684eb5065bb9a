//! Whatever the history of a store - portions, order, copies, retractions, other maps, kills - it
//! ends in the bytes of one job over what is left, on the map that is there in the end.
//!
//! 200 histories; `cargo xtask histories 5000` lives as many as are asked for.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use tilefold_city::CityFiles;
use tilefold_engine::{EngineError, Forget, FusionModel, Silent, drives::drives, run};
use tilefold_schemas::ChunkRow;
use tilefold_tests::faulty::{Fault, arm, through_fuse};
use tilefold_tests::trial::{Content, Trial, tiny_city, tiny_city_in_two_files};

/// Histories that are tried if nobody says otherwise.
const HISTORIES: u32 = 200;
/// Tests among which they are shared out.
const SHARES: u32 = 4;
const SALT: Option<[u8; 32]> = Some([3; 32]);
/// Drives of the city.
const DRIVES: usize = 4;

/// One step of a history. Numbers choose among what there is, modulo its count.
#[derive(Debug, Clone)]
enum Step {
    /// Logs in this order, some perhaps twice.
    Run(Vec<usize>),
    /// The same, but the storage meets a fault at an operation; then the job is tried again.
    Killed(Vec<usize>, Fault, usize),
    /// One drive, vehicle, or log leaves.
    Retract(usize, usize),
    /// The other map.
    Rebase(usize),
}

/// The steps, the logs that are there in the end, and the map.
#[derive(Debug, Clone)]
struct History {
    first_map: usize,
    steps: Vec<Step>,
    last_logs: BTreeSet<usize>,
    last_map: usize,
}

fn step() -> impl Strategy<Value = Step> {
    let logs = || prop::collection::vec(0..DRIVES, 1..=DRIVES);
    let fault = prop::sample::select(Fault::ALL.to_vec());
    prop_oneof![
        4 => logs().prop_map(Step::Run),
        2 => (logs(), fault, 0..120_usize).prop_map(|(logs, fault, at)| Step::Killed(logs, fault, at)),
        3 => (0..3_usize, 0..DRIVES).prop_map(|(how, which)| Step::Retract(how, which)),
        2 => (0..2_usize).prop_map(Step::Rebase),
    ]
}

fn history() -> impl Strategy<Value = History> {
    let last_logs = prop::collection::btree_set(0..DRIVES, 1..=DRIVES);
    let steps = prop::collection::vec(step(), 1..6);
    (0..2_usize, steps, last_logs, 0..2_usize).prop_map(
        |(first_map, steps, last_logs, last_map)| History {
            first_map,
            steps,
            last_logs,
            last_map,
        },
    )
}

/// A city, and what stores of it hold after one job.
struct Town {
    maps: [PathBuf; 2],
    logs: Vec<PathBuf>,
    expected: RefCell<BTreeMap<(usize, BTreeSet<usize>), Content>>,
    killed: RefCell<usize>,
    lived: RefCell<usize>,
}

impl Town {
    fn new(city: CityFiles) -> Self {
        let CityFiles {
            before_map,
            after_map,
            logs,
            ..
        } = city;
        Self {
            maps: [before_map, after_map],
            logs,
            expected: RefCell::default(),
            killed: RefCell::default(),
            lived: RefCell::default(),
        }
    }

    fn logs(&self, which: impl IntoIterator<Item = usize>) -> Vec<PathBuf> {
        which
            .into_iter()
            .map(|log| self.logs[log].clone())
            .collect()
    }

    /// What a store of the map holds after one job over these logs.
    fn expected(&self, map: usize, logs: &BTreeSet<usize>) -> Content {
        let known = self.expected.borrow().get(&(map, logs.clone())).cloned();
        known.unwrap_or_else(|| {
            let trial = Trial::with_salt(&self.maps[map], SALT);
            trial.run(&self.logs(logs.iter().copied()));
            let content = trial.content();
            assert!(content.tables["chunks"].count > 0);
            let key = (map, logs.clone());
            self.expected.borrow_mut().insert(key, content.clone());
            content
        })
    }

    fn live(&self, history: &History) -> Trial {
        let trial = Trial::with_salt(&self.maps[history.first_map], SALT);
        for step in &history.steps {
            self.step(&trial, step);
        }
        self.end(&trial, history);
        trial
    }

    fn step(&self, trial: &Trial, step: &Step) {
        match step {
            Step::Run(logs) => {
                trial.run(&self.logs(logs.iter().copied()));
            }
            Step::Killed(logs, fault, at) => self.kill(trial, logs, *fault, *at),
            Step::Retract(how, which) => retract_some(trial, *how, *which),
            Step::Rebase(map) => {
                trial.rebase(&self.maps[*map]);
            }
        }
    }

    fn kill(&self, trial: &Trial, logs: &[usize], fault: Fault, at: usize) {
        let before = trial.content();
        let logs = self.logs(logs.iter().copied());
        let fuse = arm(trial.store(), fault, at);
        let place = through_fuse(trial.store());
        let done = run(&place, &logs, FusionModel::default(), &Silent);
        if done.is_err() {
            assert!(fuse.has_fired(), "{done:?}");
            *self.killed.borrow_mut() += 1;
        }
        let found = trial.content();
        trial.run(&logs);
        let after = trial.content();
        assert!(found == before || found == after, "neither old nor new");
        assert!(done.is_err() || found == after, "done, but not there");
    }

    /// Brings the store to the map and the logs that it is to end with.
    fn end(&self, trial: &Trial, history: &History) {
        trial.rebase(&self.maps[history.last_map]);
        for (number, log) in self.logs.iter().enumerate() {
            if !history.last_logs.contains(&number) {
                let done = trial.retract(&Forget::Log(log.display().to_string()));
                assert!(
                    matches!(done, Ok(_) | Err(EngineError::Nothing(_))),
                    "{done:?}"
                );
            }
        }
        trial.run(&self.logs(history.last_logs.iter().copied()));
    }
}

fn retract_some(trial: &Trial, how: usize, which: usize) {
    let rows: Vec<ChunkRow> = trial.rows();
    let Some(row) = rows.get(which * rows.len() / DRIVES) else {
        return;
    };
    let forget = match how {
        0 => {
            let all = drives(&rows);
            Forget::Drive(all[which % all.len()].id.clone())
        }
        1 => Forget::Vehicle(tilefold_schemas::VehicleKey(row.vehicle).to_string()),
        // Often in the middle of a drive.
        _ => Forget::Time {
            from_ns: row.first_ns,
            to_ns: row.last_ns,
        },
    };
    trial.retract(&forget).unwrap();
}

/// Lives a share of the histories. Shares are tests of their own, so that they run beside each other.
fn live_share(share: u8) {
    let folder = tempfile::tempdir().unwrap();
    // In the last share, what belongs together lies in several files.
    let town = Town::new(match u32::from(share) + 1 {
        SHARES => tiny_city_in_two_files(folder.path()),
        _ => tiny_city(folder.path()),
    });
    let asked = std::env::var("TILEFOLD_HISTORIES").ok();
    let histories = asked.map_or(HISTORIES, |count| count.parse().unwrap());
    let config = Config {
        cases: histories.div_ceil(SHARES),
        failure_persistence: None,
        ..Config::default()
    };
    let cases = config.cases;
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[share; 32]);
    TestRunner::new_with_rng(config, rng)
        .run(&history(), |history| {
            let content = town.live(&history).content();
            let expected = town.expected(history.last_map, &history.last_logs);
            prop_assert_eq!(content, expected);
            let mut lived = town.lived.borrow_mut();
            *lived += 1;
            if lived.is_multiple_of(50) {
                println!("share {share}: {lived} histories so far");
            }
            Ok(())
        })
        .unwrap();
    let killed = *town.killed.borrow();
    println!("{cases} histories, {killed} jobs killed");
    // Of a handful of histories, none may have a kill in it.
    assert!(
        cases < 50 || killed * 10 > cases as usize,
        "too few jobs were killed"
    );
}

#[test]
fn a_quarter_of_the_histories_ends_in_the_bytes_of_one_job() {
    live_share(0);
}

#[test]
fn and_so_does_the_second() {
    live_share(1);
}

#[test]
fn and_the_third() {
    live_share(2);
}

#[test]
fn and_the_fourth() {
    live_share(3);
}
