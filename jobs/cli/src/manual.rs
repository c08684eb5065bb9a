//! `man` and `completions`: made from what clap knows, so that they say what the program does.

use std::error::Error;
use std::fs;
use std::path::Path;

use clap::CommandFactory;
use clap_complete::Shell;

use crate::args::Args;
use crate::report::to_stdout;

/// Prints completions for a shell.
///
/// # Errors
/// Standard output cannot be written.
pub(crate) fn completions(shell: Shell) -> Result<(), Box<dyn Error>> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Args::command(), "tilefold", &mut script);
    to_stdout(&String::from_utf8(script)?)
}

/// Writes a page for the program and one for each command into a folder; how many there are.
///
/// # Errors
/// The folder cannot be written.
pub(crate) fn man_pages(folder: &Path) -> Result<usize, Box<dyn Error>> {
    let cannot = |error: std::io::Error| {
        let folder = folder.display();
        format!(
            "cannot write man pages to {folder}: {error}; name a folder that you may write with --out"
        )
    };
    fs::create_dir_all(folder).map_err(cannot)?;
    let mut root = Args::command().disable_help_subcommand(true);
    root.build();
    clap_mangen::generate_to(root, folder).map_err(cannot)?;
    Ok(fs::read_dir(folder).map_err(cannot)?.count())
}
