//! `cargo xtask s3-test`: stores in buckets, against an S3 server that nobody here wrote (moto).
//!
//! The server runs as long as the tests do, on a port of this machine that was free, with a key that
//! it made up. It ends with its standard input, so also where we are killed.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::command::Failure;
use crate::python;
use crate::test;

/// The version of moto; the same as in `xtask/moto.txt`.
const MOTO: &str = "5.2.5";

const BY_HAND: &str = "Python 3.10 or later with pip and PyPI in reach are needed; nothing else of Tilefold's tests needs them";

/// Starts the server and runs the tests that need it.
pub(crate) fn run(root: &Path) -> Result<(), Failure> {
    let server = Server::start(root, &moto(root)?)?;
    let mut tests = test::some(root, "--test cli -- --ignored buckets::");
    for (key, value) in &server.environment {
        tests = tests.env(key, value.as_str());
    }
    tests.run("The failing test is named above")
}

/// The folder that moto is in, installed if need be.
fn moto(root: &Path) -> Result<PathBuf, Failure> {
    let folder = python::tool_folder(root, &format!("moto-{MOTO}"));
    if !folder.join(format!("moto-{MOTO}.dist-info")).is_dir() {
        python::install(root, "xtask/moto.txt", &folder, BY_HAND)?;
    }
    Ok(folder)
}

/// The server, and what a client must know of it.
struct Server {
    process: Child,
    environment: Vec<(&'static str, String)>,
}

impl Server {
    fn start(root: &Path, moto: &Path) -> Result<Self, Failure> {
        let failed =
            |why: &str| Failure::new(format!("the S3 server does not start: {why}. {BY_HAND}"));
        let mut process = Command::new("python3")
            .arg(root.join("tests/oracles/s3_server.py"))
            .env("PYTHONPATH", moto)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| failed(&error.to_string()))?;
        let mut said = String::new();
        if let Some(stdout) = process.stdout.take() {
            BufReader::new(stdout)
                .read_line(&mut said)
                .map_err(|error| failed(&error.to_string()))?;
        }
        let words: Vec<&str> = said.split_whitespace().collect();
        let [endpoint, key, secret] = words[..] else {
            return Err(failed("its own words are above"));
        };
        let environment = vec![
            ("AWS_ENDPOINT_URL", endpoint.to_owned()),
            ("AWS_ACCESS_KEY_ID", key.to_owned()),
            ("AWS_SECRET_ACCESS_KEY", secret.to_owned()),
            ("AWS_REGION", "us-east-1".to_owned()),
        ];
        Ok(Self {
            process,
            environment,
        })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
