//! What was measured, as Markdown tables. A figure is the median of its turns.

use std::fmt::Write as _;

use super::Measured;
use super::counted::Cost;
use super::job::Job;
use crate::report::table;

/// Tables that hold what a kilometre that was driven leaves in the store.
const LEDGER: [&str; 4] = ["evidence", "sightings", "footprints", "chunks"];

/// The page.
pub(super) fn page(measured: &Measured) -> String {
    let machine = &measured.machine;
    let mut page = format!(
        "{} cores ({}), load {:.1} before and {:.1} after.\n",
        machine.cores, machine.processor, machine.load[0], machine.load[1]
    );
    let mut section = |title: &str, body: String| {
        // Writing into a `String` cannot fail.
        let _ = write!(page, "\n## {title}\n\n{body}");
    };
    for turns in &measured.scaling {
        let threads = turns.first().map_or(0, |job| job.threads);
        section(&format!("Stages, threads: {threads}"), stages(turns));
    }
    section("Threads", threads(&measured.scaling));
    if !measured.growth.is_empty() {
        section("Growth", growth(&measured.growth));
    }
    if !measured.growth_limited.is_empty() {
        section("Growth within a limit", growth(&measured.growth_limited));
    }
    if let Some([base, branch]) = &measured.against {
        section("Base and branch", against(base, branch));
    }
    section("Legs and allocations", costs(measured));
    if let (Some(km), Some(turns)) = (measured.km, measured.scaling.first()) {
        section("Ledger", ledger(turns, km));
    }
    page
}

/// The middle one of a figure's turns; of an even number the lower of two.
fn median(turns: &[Job], figure: impl Fn(&Job) -> f64) -> f64 {
    let mut all: Vec<f64> = turns.iter().map(figure).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len().saturating_sub(1) / 2)
        .copied()
        .unwrap_or(0.0)
}

fn stages(turns: &[Job]) -> String {
    let Some(first) = turns.first() else {
        return String::new();
    };
    let whole_s = median(turns, |job| job.threads as f64 * job.wall_s);
    let row = |stage: String| {
        let of = |name: &str| median(turns, |job| job.figure(&stage, name));
        let unit = first.report["stages"].as_array().and_then(|stages| {
            let found = stages.iter().find(|one| one["stage"] == stage.as_str());
            found.and_then(|one| one["unit"].as_str())
        });
        vec![
            stage.clone(),
            format!("{:.0} {}", of("items"), unit.unwrap_or("")),
            format!("{:.1}", of("bytes") * 1e-6),
            format!("{:.2}", of("busy_s")),
            format!("{:.1} %", 100.0 * of("busy_s") / whole_s),
            format!("{:.0}", of("items_per_busy_s")),
            format!("{:.0}", of("mb_per_busy_s")),
        ]
    };
    let head = [
        "stage",
        "items",
        "MB",
        "busy, s",
        "share of the threads' time",
        "items a busy second",
        "MB a busy second",
    ];
    let mut text = table(&head, first.stages().into_iter().map(row));
    let frames = median(turns, |job| job.figure("map", "items"));
    let wall_s = median(turns, |job| job.wall_s);
    let processor_s = median(turns, Job::processor_s);
    let _ = writeln!(
        text,
        "\nThe whole job: {wall_s:.2} s, {processor_s:.2} s of processor time, {:.0} frames a second, {:.0} a processor second; threads in a stage {:.3} of their time; {:.0} MB at most.",
        frames / wall_s,
        frames / processor_s,
        median(turns, Job::busy_share),
        median(turns, |job| job.peak_bytes as f64) * 1e-6,
    );
    text
}

fn threads(scaling: &[Vec<Job>]) -> String {
    let Some(one) = scaling.first() else {
        return String::new();
    };
    let (wall_s, processor_s) = (
        median(one, |job| job.wall_s * job.threads as f64),
        median(one, Job::processor_s),
    );
    let row = |turns: &Vec<Job>| {
        let threads = turns.first().map_or(0, |job| job.threads);
        let taken_s = median(turns, |job| job.wall_s * job.threads as f64);
        let used_s = median(turns, Job::processor_s);
        let share = median(turns, Job::busy_share);
        vec![
            threads.to_string(),
            format!("{:.2}", taken_s / threads as f64),
            format!("{used_s:.2}"),
            format!("{:.2}", wall_s / taken_s),
            format!("{:.2}", processor_s / used_s),
            format!("{share:.3}"),
            format!("{:.0}", median(turns, |job| job.peak_bytes as f64) * 1e-6),
        ]
    };
    let head = [
        "threads",
        "wall, s",
        "processor, s",
        "efficiency by wall time",
        "by processor time",
        "threads in a stage",
        "peak memory, MB",
    ];
    table(&head, scaling.iter().map(row))
}

fn growth(sizes: &[Vec<Job>]) -> String {
    let row = |turns: &Vec<Job>| {
        let logs = turns.first().map_or(0, |job| job.logs);
        let frames = median(turns, |job| job.figure("map", "items"));
        let processor_s = median(turns, Job::processor_s);
        vec![
            logs.to_string(),
            format!("{frames:.0}"),
            format!("{:.2}", median(turns, |job| job.wall_s)),
            format!("{processor_s:.2}"),
            format!("{:.0}", 1e6 * processor_s / frames),
            format!("{:.0}", median(turns, |job| job.peak_bytes as f64) * 1e-6),
        ]
    };
    let head = [
        "logs",
        "frames",
        "wall, s",
        "processor, s",
        "processor microseconds a frame",
        "peak memory, MB",
    ];
    table(&head, sizes.iter().map(row))
}

fn against(base: &[Job], branch: &[Job]) -> String {
    let row = |name: &str, figure: &dyn Fn(&Job) -> f64| {
        let (before, after) = (median(base, figure), median(branch, figure));
        vec![
            name.to_owned(),
            format!("{before:.2}"),
            format!("{after:.2}"),
            format!("{:.3}", before / after),
        ]
    };
    let mut rows = vec![
        row("wall, s", &|job| job.wall_s),
        row("processor, s", &Job::processor_s),
        row("peak memory, MB", &|job| job.peak_bytes as f64 * 1e-6),
    ];
    let stages = branch.first().map(Job::stages).unwrap_or_default();
    for stage in stages {
        let busy_s = |job: &Job| job.busy_s(&stage);
        rows.push(row(&format!("{stage}, busy s"), &busy_s));
    }
    table(&["", "base", "branch", "base / branch"], rows)
}

fn costs(measured: &Measured) -> String {
    let costs = &measured.costs;
    let whole_s = costs.legs.last().map_or(0.0, |cost| cost.seconds);
    let row = |cost: &Cost| {
        let a_frame = |amount: f64| amount / (cost.frames.max(1)) as f64;
        let is_leg = cost.name != costs.job.name;
        vec![
            cost.name.clone(),
            cost.frames.to_string(),
            format!("{:.2}", cost.seconds),
            match is_leg {
                true => format!("{:.1} %", 100.0 * cost.seconds / whole_s),
                false => "-".to_owned(),
            },
            format!("{:.1}", a_frame(cost.seconds * 1e6)),
            format!("{:.1}", a_frame(cost.allocations as f64)),
            format!("{:.2}", a_frame(cost.bytes as f64 * 1e-3)),
        ]
    };
    let head = [
        "leg",
        "frames, with context",
        "processor, s",
        "of map_chunk",
        "microseconds a frame",
        "allocations a frame",
        "kB asked for a frame",
    ];
    let all = costs.legs.iter().chain([&costs.job]);
    let mut text = table(&head, all.map(row));
    let _ = writeln!(
        text,
        "\n{} chunks spread over the logs, one thread. `job` is the whole job; its frames are those that count.",
        costs.chunks
    );
    text
}

fn ledger(turns: &[Job], km: f64) -> String {
    let Some(job) = turns.first() else {
        return String::new();
    };
    let of = |name: &str| {
        let found = job.table_bytes.iter().find(|(table, _)| table == name);
        found.map_or(0.0, |(_, bytes)| *bytes as f64)
    };
    let row = |name: &str, bytes: f64| {
        vec![
            name.to_owned(),
            format!("{:.2}", bytes * 1e-6),
            format!("{:.2}", bytes * 1e-3 / km),
        ]
    };
    let mut rows: Vec<Vec<String>> = LEDGER.iter().map(|&name| row(name, of(name))).collect();
    let all: f64 = LEDGER.iter().map(|&name| of(name)).sum();
    rows.push(row("all", all));
    let mut text = format!("{km:.1} km were driven.\n\n");
    text += &table(&["table", "MB", "kB a km and pass"], rows);
    text
}
