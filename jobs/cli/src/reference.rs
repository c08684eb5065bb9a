//! `reference`: the page of the book about the command line, made from what clap knows.

use std::collections::BTreeSet;
use std::fmt::Write;

use clap::{Command, CommandFactory};

use crate::args::Args;

const INTRODUCTION: &str = "\
# The command line

Made by `tilefold reference`; a test keeps it fresh. The options `--format`, `--progress`, `--threads`, `--log-level` and `--log-form` are common to all commands and are listed
once, under `tilefold`.

## Exit codes

| code | |
| --- | --- |
| 0 | done |
| 1 | failed; nothing has changed, and it is safe to run again |
| 2 | usage: the command was not understood |
| 3 | done, but something was set aside; it is listed by file, topic and reason on standard error |
| 4 | `verify` or `compare` found a difference |
";
const ENVIRONMENT: &str = "
## The environment

There is no configuration file. What many jobs have in common may stand in the environment; a flag wins over its variable.

| variable | flag |
| --- | --- |
";
/// Variables that no flag of this program reads.
const OTHERS: &str = "\
| `TILEFOLD_MODELS` | folders, divided as in `PATH`, where models are looked for that do not lie beside their card |
| `ORT_DYLIB_PATH` | the library of ONNX Runtime, if `--onnxruntime` names none |
| `AWS_...` | how buckets are reached: [stores in a bucket](../guide/buckets.md) |
";
/// Options of all commands, listed once.
const COMMON: [&str; 5] = ["format", "progress", "threads", "log_level", "log_form"];
/// Columns of the help texts.
const WIDTH: usize = 100;

/// The page.
pub(crate) fn page() -> String {
    let mut page = INTRODUCTION.to_owned();
    let root = Args::command().term_width(WIDTH);
    section(&mut page, "tilefold", root.clone());
    let shown = |command: &&Command| !command.is_hide_set() && command.get_name() != "help";
    for command in root.get_subcommands().filter(shown) {
        let name = format!("tilefold {}", command.get_name());
        let bare = command.clone().bin_name(&name).term_width(WIDTH);
        let bare = COMMON
            .iter()
            .fold(bare, |bare, option| without(bare, option));
        section(&mut page, &name, bare);
    }
    page + ENVIRONMENT + &variables(&root) + OTHERS
}

/// A line for each variable that a flag may be given by.
fn variables(root: &Command) -> String {
    let mut lines = BTreeSet::new();
    for command in std::iter::once(root).chain(root.get_subcommands()) {
        for argument in command.get_arguments() {
            let (Some(variable), Some(flag)) = (argument.get_env(), argument.get_long()) else {
                continue;
            };
            let of = match argument.is_global_set() {
                true => String::new(),
                false => format!(" of `{}`", command.get_name()),
            };
            lines.insert(format!(
                "| `{}` | `--{flag}`{of} |\n",
                variable.to_string_lossy()
            ));
        }
    }
    lines.into_iter().collect()
}

/// The options of all commands are not those of one.
fn without(command: Command, option: &str) -> Command {
    let has = command
        .get_arguments()
        .any(|argument| argument.get_id() == option);
    match has {
        true => command.mut_arg(option, |argument| argument.hide(true)),
        false => command,
    }
}

fn section(page: &mut String, name: &str, mut command: Command) {
    let help = command.render_long_help().to_string();
    let lines: Vec<&str> = help.trim_end().lines().map(str::trim_end).collect();
    // Writing to a string does not fail.
    let _ = write!(page, "\n## {name}\n\n```text\n{}\n```\n", lines.join("\n"));
}
