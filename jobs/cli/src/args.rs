//! What can be said on the command line. Help, man pages and completions come from here.

use std::path::PathBuf;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand, ValueEnum};
use tilefold_engine::{Device, FusionModel, Registering};

use crate::at::{At, at};

/// Finds where an HD map no longer matches the road, from the camera and GNSS logs of ordinary
/// vehicles.
///
/// Exit codes: 0 done; 1 failed, nothing has changed, safe to run again; 2 usage; 3 done, but
/// something was set aside (listed by name, file, offset and reason); 4 verify or compare differs.
#[derive(Debug, Parser)]
#[command(name = "tilefold", version, max_term_width = 100)]
pub(crate) struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Form of the result on standard output.
    #[arg(long, global = true, value_enum, default_value_t)]
    pub format: Format,
    /// Progress on standard error. Bars need a terminal; `json` prints a line an event.
    #[arg(long, global = true, value_enum, default_value_t)]
    pub progress: ProgressForm,
    /// What is logged on standard error: this and what is graver.
    #[arg(
        long,
        global = true,
        value_enum,
        default_value_t,
        env = "TILEFOLD_LOG_LEVEL"
    )]
    pub log_level: LogLevel,
    /// Form of the log.
    #[arg(
        long,
        global = true,
        value_enum,
        default_value_t,
        env = "TILEFOLD_LOG_FORM"
    )]
    pub log_form: LogForm,
    /// Threads; 0 takes all cores.
    #[arg(long, global = true, default_value_t = 0, env = "TILEFOLD_THREADS")]
    pub threads: usize,
}

impl Args {
    /// The arguments of this process, with what clap cannot know of: which form is for which
    /// command. Usage errors end the process with their exit code.
    pub(crate) fn parse_checked() -> Self {
        let args = Self::parse();
        let is_drawn = match args.format {
            Format::Geojson => matches!(
                args.command,
                Command::Export { .. } | Command::Regions { .. }
            ),
            format if format.is_for_export() => matches!(args.command, Command::Export { .. }),
            _ => true,
        };
        if !is_drawn {
            let name = args.format.to_possible_value();
            let name = name.as_ref().map_or("", |value| value.get_name());
            let why =
                format!("--format {name} is for `export`; this command prints `text` or `json`");
            Self::command()
                .error(ErrorKind::ArgumentConflict, why)
                .exit();
        }
        if let Command::Export(export) = &args.command {
            export.check(args.format);
        }
        args
    }
}

/// Form of the result on standard output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum Format {
    /// Tables for people.
    #[default]
    Text,
    /// One JSON value.
    Json,
    /// RFC 7946 (`export` and `regions`; all forms below: `export` only).
    Geojson,
    /// A Parquet table with geometry, version 1.1.
    Geoparquet,
    /// FlatGeobuf with its spatial index.
    Flatgeobuf,
    /// Vector tiles in one file: the changes over the map.
    Pmtiles,
    /// A scene of the changes over the map, in Foxglove's messages.
    Mcap,
    /// The map with the changes in it; takes `--map`.
    Lanelet2,
    /// The changes of the map as an OsmChange; takes `--map`.
    Osc,
    /// The review page as a folder that opens without a server; takes `--out`.
    Html,
}

impl Format {
    fn is_for_export(self) -> bool {
        !matches!(self, Self::Text | Self::Json)
    }

    fn is_map(self) -> bool {
        matches!(self, Self::Lanelet2 | Self::Osc)
    }
}

/// Form of progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum ProgressForm {
    /// Bars on a terminal, nothing elsewhere.
    #[default]
    Auto,
    /// One JSON object a line.
    Json,
    /// Nothing.
    Off,
}

/// How grave what is logged has to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum LogLevel {
    /// Nothing is logged.
    Off,
    /// What failed.
    Error,
    /// What may have to be looked after.
    #[default]
    Warn,
    /// The steps of a job, what was set aside, other writers that were faster.
    Info,
    /// Each unit of work, and what storage does.
    Debug,
    /// Everything.
    Trace,
}

/// Form of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum LogForm {
    /// Lines for people.
    #[default]
    Text,
    /// One JSON object a line.
    Json,
}

/// Name of a fusion model on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum ModelName {
    /// The equations of Zhang et al. (2025) as printed.
    Paper,
    /// Likelihood ratios of a detection model.
    #[default]
    Calibrated,
}

impl From<ModelName> for FusionModel {
    fn from(name: ModelName) -> Self {
        match name {
            ModelName::Paper => Self::Paper,
            ModelName::Calibrated => Self::Calibrated,
        }
    }
}

/// Whether something is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum Switch {
    /// It is.
    #[default]
    On,
    /// It is not.
    Off,
}

impl From<Switch> for Registering {
    fn from(switch: Switch) -> Self {
        match switch {
            Switch::On => Self::On,
            Switch::Off => Self::Off,
        }
    }
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Makes a small city with known changes, drives through it, runs the job and scores it.
    Demo {
        /// Folder for the city and its store; made anew.
        #[arg(long, default_value = "out/demo")]
        out: PathBuf,
        /// Seed of the city.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Drives with cameras, and looks at their pictures with the network of this card, instead of
        /// logs with detections.
        #[arg(long, value_name = "CARD")]
        detector: Option<PathBuf>,
        /// ONNX Runtime.
        #[command(flatten)]
        runtime: Runtime,
    },
    /// Makes a city by seed, or takes a map as one: changes it, drives through it, writes maps, truth
    /// and logs.
    Simulate(Simulation),
    /// Creates a store from a base map.
    Init {
        /// Folder of the new store, or `s3://BUCKET/PREFIX`, here and wherever a store is asked for.
        store: PathBuf,
        /// Map files (Lanelet2 .osm, OpenDRIVE .xodr, Argoverse 2 .json).
        #[arg(long, required = true, num_args = 1..)]
        map: Vec<PathBuf>,
        /// Level of the NDS tiles.
        #[arg(long, default_value_t = 15, value_parser = clap::value_parser!(u8).range(0..=15))]
        tile_level: u8,
        /// Secret of the keyed hash that stands for vehicle ids: 64 hexadecimal digits. Without
        /// it, it is derived from the map, so that equal inputs give equal stores.
        #[arg(long, env = "TILEFOLD_VEHICLE_SALT", hide_env_values = true, value_parser = salt)]
        vehicle_salt: Option<Salt>,
    },
    /// Maps new logs, folds what they touch, commits a version. Again = update: what the store
    /// knows already adds nothing.
    Run {
        /// The store.
        store: PathBuf,
        /// MCAP files, or folders of them.
        #[arg(required_unless_present = "as_of")]
        logs: Vec<PathBuf>,
        /// How evidence becomes a posterior.
        #[arg(long, value_enum, default_value_t)]
        model: ModelName,
        /// Model card (.toml) of the network that looks at the pictures of logs without detections.
        #[arg(long, value_name = "CARD")]
        detector: Option<PathBuf>,
        /// ONNX Runtime.
        #[command(flatten)]
        runtime: Runtime,
        /// Folds only what was seen until then: a time like 2026-03-15T00:00:00Z. The version says so.
        #[arg(long, value_parser = time)]
        as_of: Option<i64>,
        /// Whether poses are laid on the map before residuals are taken. `off` shows what that is
        /// worth; a store holds evidence of one kind only.
        #[arg(long, value_enum, default_value_t)]
        registration: Switch,
        /// How much memory the job may take, like 2GB: what does not fit waits on disk, in the folder
        /// TMPDIR. The result is the same.
        #[arg(long, value_name = "SIZE", value_parser = size)]
        memory: Option<u64>,
        /// Shows what would be done, and does nothing.
        #[arg(long)]
        plan: bool,
        /// File for metrics in the text form of Prometheus (node_exporter's textfile collector takes
        /// names that end in .prom); written every ten seconds and at the end.
        #[arg(long, value_name = "FILE", conflicts_with = "plan")]
        metrics: Option<PathBuf>,
    },
    /// How fast this machine is: runs a job in a temporary folder and prints its stages, with their
    /// rates in a second of one thread's work.
    Bench(Bench),
    /// Looks at pictures: what a network sees in a picture, a folder of pictures or a log.
    Detect(Detection),
    /// Says what is there of what Tilefold needs, and how to get what is not.
    Doctor {
        /// Model cards to be opened as well.
        cards: Vec<PathBuf>,
        /// ONNX Runtime.
        #[command(flatten)]
        runtime: Runtime,
    },
    /// Fits the sensor model to the store's evidence - how often, and how well, the fleet's detectors
    /// match paint - and folds everything anew with it.
    Calibrate {
        /// The store.
        store: PathBuf,
    },
    /// Takes evidence out, as if it had never come in: folds anew what it touched, commits a version.
    ///
    /// What was made from it, context included, leaves with it; the report names the logs that bring
    /// back the rest. Older versions keep it until `vacuum`.
    Retract {
        /// The store.
        store: PathBuf,
        /// What is to be forgotten.
        #[command(flatten)]
        what: What,
    },
    /// Lays a new version of the base map under the store. What is unchanged keeps its evidence, what
    /// was edited starts anew, claims that the map now confirms are named.
    Rebase {
        /// The store.
        store: PathBuf,
        /// Map files (Lanelet2 .osm, OpenDRIVE .xodr, Argoverse 2 .json).
        #[arg(long, required = true, num_args = 1..)]
        map: Vec<PathBuf>,
    },
    /// Removes the data files of versions that were replaced long ago, and of jobs that were killed.
    /// The latest version always stays.
    Vacuum {
        /// The store.
        store: PathBuf,
        /// Versions that were current in the last so many days stay readable.
        #[arg(long, value_name = "DAYS", default_value_t = 30)]
        retain_days: u32,
        /// Files written in the last so many hours stay: a job may be about to commit them.
        #[arg(long, value_name = "HOURS", default_value_t = 24)]
        grace_hours: u32,
        /// Only tells what would be removed.
        #[arg(long)]
        dry_run: bool,
    },
    /// Says what a file is, by its content - a log, a map, a model or a store -, what is in it, what is
    /// damaged, and what mends that. Everything that a job would read is read.
    Inspect {
        /// The file, or the folder or URL of a store or of a divided map.
        file: PathBuf,
    },
    /// Lists the versions of a store.
    Log {
        /// The store.
        store: PathBuf,
    },
    /// Summarises a version: verdicts by tile and the changes.
    Show {
        /// The store.
        store: PathBuf,
        /// Version by number, or as of a time like 2026-03-15T00:00:00Z; the latest if not given.
        #[arg(long, visible_alias = "as-of", value_parser = at)]
        version: Option<At>,
    },
    /// Lists changes that lie beside each other as regions: what happened there, and since when.
    /// `--format geojson` gives them as polygons.
    Regions {
        /// The store.
        store: PathBuf,
        /// Version by number, or as of a time like 2026-03-15T00:00:00Z; the latest if not given.
        #[arg(long, visible_alias = "as-of", value_parser = at)]
        version: Option<At>,
        /// Least posterior of the changes.
        #[arg(long, default_value_t = 0.85)]
        threshold: f64,
    },
    /// Says why a version says what it says of a change or an element: what every pass adds, what
    /// would flip the verdict, and the frames to look at.
    Explain {
        /// The store.
        store: PathBuf,
        /// A change (16 hexadecimal digits), or an element of the map by its id.
        id: String,
        /// Version by number, or as of a time like 2026-03-15T00:00:00Z; the latest if not given.
        #[arg(long, visible_alias = "as-of", value_parser = at)]
        version: Option<At>,
        /// Frames to look at, as pictures.
        #[command(flatten)]
        frames: Frames,
    },
    /// Recomputes the digests of a version and compares them with what was committed.
    Verify {
        /// The store.
        store: PathBuf,
        /// Version by number, or as of a time like 2026-03-15T00:00:00Z; the latest if not given.
        #[arg(long, visible_alias = "as-of", value_parser = at)]
        version: Option<At>,
    },
    /// Shows what differs between two maps, by geometry and not only by id, or between two versions of
    /// a store. Exit code 4 where something does.
    Compare(Compare),
    /// Writes the changes of a version, to standard output if no file is named; `--format` says in
    /// which form (GeoJSON if it says none).
    Export(Export),
    /// Serves the review page: the changes on a map, why each is claimed, and what a reviewer decides.
    /// Runs until it is stopped.
    Serve(Serving),
    /// Keeps what a reviewer says of a change, as the review page does; or takes the decisions that
    /// a review page without a server saved.
    Decide(Deciding),
    /// Scores a version against known changes.
    Evaluate {
        /// The store.
        store: PathBuf,
        /// GeoJSON of the true changes. Without it nothing has changed (a control).
        #[arg(long)]
        truth: Option<PathBuf>,
        /// Version by number, or as of a time like 2026-03-15T00:00:00Z; the latest if not given.
        #[arg(long, visible_alias = "as-of", value_parser = at)]
        version: Option<At>,
        /// Fusion model; the other one is shown beside it. The evidence is folded anew where the
        /// version was not made with it; nothing is written.
        #[arg(long, value_enum, default_value_t)]
        model: ModelName,
        /// Least posterior of a claim (T_s).
        #[arg(long, default_value_t = 0.85)]
        threshold: f64,
        /// Least number of vehicles of a claim (V).
        #[arg(long, default_value_t = 5)]
        min_vehicles: i32,
        /// Vehicles, drawn by lot, that are also judged alone (V = 1); 0 for none.
        #[arg(long, default_value_t = 20)]
        single_vehicles: usize,
        /// Side of the places that are resampled for 95 % intervals, in metres.
        #[arg(long, default_value_t = 500.0, value_parser = place_m)]
        place_m: f64,
        /// Seed of the resampling and of the lot.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// CSV that says which element each detection is of; its columns are in
        /// docs/reference/evaluation.md. The map stage is run once more over `--logs` and compared.
        #[arg(long, requires = "logs")]
        matching: Option<PathBuf>,
        /// MCAP files, or folders of them, for `--matching`.
        #[arg(long, num_args = 1.., requires = "matching")]
        logs: Vec<PathBuf>,
        /// Folder for pictures as SVG and PNG: `overview`, `coverage`, `reliability` and `sweep`.
        #[arg(long)]
        plots: Option<PathBuf>,
    },
    /// Prints the reference of the command line (docs/reference/cli.md).
    #[command(hide = true)]
    Reference,
    /// Prints completions for a shell. For bash: `tilefold completions bash >
    /// ~/.local/share/bash-completion/completions/tilefold`.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Writes man pages, one for each command: `tilefold man --out ~/.local/share/man/man1`, then
    /// `man tilefold-run`.
    Man {
        /// Folder for the pages; made if it is not there.
        #[arg(long, short, value_name = "FOLDER")]
        out: PathBuf,
    },
}

/// Frames of an explanation as pictures.
#[derive(Debug, clap::Args)]
pub(crate) struct Frames {
    /// Folder for the frames to look at, as PNG: what was detected (yellow), the map (blue), and what
    /// is said to be added (green), removed (red) or modified (orange).
    #[arg(long, value_name = "FOLDER", group = "pictures")]
    pub frames: Option<PathBuf>,
    /// MCAP file for the same frames, to look at in Foxglove: pictures (`/case/image`) and what is drawn
    /// over them (`/case/annotations`).
    #[arg(long, value_name = "FILE", group = "pictures")]
    pub case: Option<PathBuf>,
    /// Logs, or folders of them, where they are no longer where they were.
    #[arg(long, num_args = 1.., requires = "pictures", value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Model card (.toml) of the network that looked at pictures without detections.
    #[arg(long, requires = "pictures", value_name = "CARD")]
    pub detector: Option<PathBuf>,
    /// ONNX Runtime.
    #[command(flatten)]
    pub runtime: Runtime,
}

/// Where networks run.
#[derive(Debug, clap::Args)]
pub(crate) struct Runtime {
    /// Library of ONNX Runtime. If not given: ORT_DYLIB_PATH, beside this program, `.ort/`.
    #[arg(long, value_name = "FILE")]
    pub onnxruntime: Option<PathBuf>,
    /// Runs networks on the graphics card of this number (0 if none is given); an error where that
    /// cannot be.
    #[arg(long, value_name = "NUMBER", num_args = 0..=1, default_missing_value = "0")]
    pub cuda: Option<i32>,
}

impl Runtime {
    /// What networks run on.
    pub(crate) fn device(&self) -> Device {
        self.cuda.map_or(Device::Cpu, Device::Cuda)
    }
}

/// What `detect` looks at.
#[derive(Debug, clap::Args)]
pub(crate) struct Detection {
    /// A picture (JPEG, PNG), a folder of pictures, or a log with camera images.
    pub input: PathBuf,
    /// Model card (.toml) of the network; its model lies beside it, or in a folder of
    /// TILEFOLD_MODELS.
    #[arg(long, visible_alias = "detector", value_name = "CARD")]
    pub model: PathBuf,
    /// Folder for the pictures with what was seen drawn into them, as PNG.
    #[arg(long, value_name = "FOLDER")]
    pub overlay: Option<PathBuf>,
    /// Of a log: MCAP file to write, with the pictures and what was seen and believed as
    /// annotations in pixels.
    #[arg(long, short, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// ONNX Runtime.
    #[command(flatten)]
    pub runtime: Runtime,
}

/// What `bench` runs on.
#[derive(Debug, clap::Args)]
pub(crate) struct Bench {
    /// MCAP files, or folders of them, instead of drives through a city of its own.
    #[arg(requires = "map")]
    pub logs: Vec<PathBuf>,
    /// Map files that go with the logs.
    #[arg(long, num_args = 1.., requires = "logs")]
    pub map: Vec<PathBuf>,
    /// Folder for a picture: `stages` as SVG and PNG.
    #[arg(long, value_name = "FOLDER")]
    pub plots: Option<PathBuf>,
    /// Drives through a city of its own, 2 km each.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "map")]
    pub drives: u32,
}

/// What `retract` takes out.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = true)]
pub(crate) struct What {
    /// A drive: the key of its vehicle and the second of its first frame. A wrong one lists them.
    #[arg(long, value_name = "ID", conflicts_with_all = ["vehicle", "log", "from", "to"])]
    pub drive: Option<String>,
    /// A vehicle: its name in the logs, or its key in the store.
    #[arg(long, value_name = "ID", conflicts_with_all = ["log", "from", "to"])]
    pub vehicle: Option<String>,
    /// A log: its file name, or its path as it was given to `run`.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["from", "to"])]
    pub log: Option<String>,
    /// What was captured from then on: a time like 2026-03-15T00:00:00Z.
    #[arg(long, value_name = "TIME", value_parser = time)]
    pub from: Option<i64>,
    /// What was captured before then.
    #[arg(long, value_name = "TIME", value_parser = time)]
    pub to: Option<i64>,
}

/// What `compare` compares.
#[derive(Debug, clap::Args)]
pub(crate) struct Compare {
    /// A map; or a store, whose versions are compared.
    pub a: PathBuf,
    /// The other map.
    pub b: Option<PathBuf>,
    /// Of maps: what lies within this many metres is in the same place.
    #[arg(long, default_value_t = 0.01)]
    pub tolerance_m: f64,
    /// Of a store: the first version, by number or as of a time; the one before the second if not given.
    #[arg(long, conflicts_with = "b", value_parser = at)]
    pub from: Option<At>,
    /// Of a store: the second version, by number or as of a time; the latest if not given.
    #[arg(long, conflicts_with = "b", value_parser = at)]
    pub to: Option<At>,
}

/// What `export` writes.
#[derive(Debug, clap::Args)]
pub(crate) struct Export {
    /// The store.
    pub store: PathBuf,
    /// Version by number, or as of a time like 2026-03-15T00:00:00Z; the latest if not given.
    #[arg(long, visible_alias = "as-of", value_parser = at)]
    pub version: Option<At>,
    /// File to write; of several maps, the folder for them.
    #[arg(long, short, visible_alias = "output")]
    pub out: Option<PathBuf>,
    /// For `lanelet2` and `osc`: the map that the store was made from (`init --map`), or those of its
    /// maps that are wanted.
    #[arg(long, num_args = 1.., value_name = "FILE")]
    pub map: Vec<PathBuf>,
    /// Least posterior of what is written. If not given: 0.5 for what is looked at, and 0.85, as in
    /// `evaluate`, for what goes into a map.
    #[arg(long)]
    pub threshold: Option<f64>,
    /// Least number of vehicles that looked at what is written. If not given: 0 for what is looked
    /// at, and 5, as in `evaluate`, for what goes into a map.
    #[arg(long)]
    pub min_vehicles: Option<i32>,
    /// Also what did not change and what is unknown; not for maps.
    #[arg(long)]
    pub all: bool,
    /// Only what a reviewer accepted, whatever its posterior and vehicles.
    #[arg(long, conflicts_with_all = ["all", "threshold", "min_vehicles"])]
    pub accepted: bool,
    /// File of the reviewers' decisions; `decisions.jsonl` in the store if not given.
    #[arg(long, value_name = "FILE")]
    pub decisions: Option<PathBuf>,
}

/// What `serve` serves, and where.
#[derive(Debug, clap::Args)]
pub(crate) struct Serving {
    /// The store.
    pub store: PathBuf,
    /// Version that the page opens with, by number or as of a time; the latest if not given.
    #[arg(long, visible_alias = "as-of", value_parser = at)]
    pub version: Option<At>,
    /// Address to listen on. Any other than this machine's own lets everybody there look and decide.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    pub bind: std::net::IpAddr,
    /// Port; 0 takes a free one.
    #[arg(long, default_value_t = 7878)]
    pub port: u16,
    /// Name under which this machine may be asked, besides `localhost` and its addresses.
    #[arg(long, value_name = "NAME")]
    pub host: Vec<String>,
    /// MCAP files, or folders of them: the page shows the frames that say most of a change, with what
    /// was detected and the map. No other files are looked into, whatever the store names.
    #[arg(long, value_name = "LOG", num_args = 1..)]
    pub frames_from: Vec<PathBuf>,
    /// Model card (.toml) of the network that looked at the pictures of logs without detections.
    #[arg(long, value_name = "CARD", requires = "frames_from")]
    pub detector: Option<PathBuf>,
    /// ONNX Runtime.
    #[command(flatten)]
    pub runtime: Runtime,
    /// File that keeps the decisions; `decisions.jsonl` in the store if not given. A store in a
    /// bucket has no place for it: name one.
    #[arg(long, value_name = "FILE")]
    pub decisions: Option<PathBuf>,
}

/// What `decide` keeps.
#[derive(Debug, clap::Args)]
pub(crate) struct Deciding {
    /// The store.
    pub store: PathBuf,
    /// The change (16 hexadecimal digits).
    #[arg(required_unless_present = "from", requires = "say")]
    pub change: Option<String>,
    /// What is said of it.
    #[arg(value_enum, conflicts_with = "from")]
    pub say: Option<Say>,
    /// Why.
    #[arg(long, default_value = "")]
    pub note: String,
    /// Who says so.
    #[arg(long, env = "TILEFOLD_REVIEWER", default_value = "")]
    pub reviewer: String,
    /// Takes every decision of a file that a review page saved.
    #[arg(long, value_name = "FILE", conflicts_with = "change")]
    pub from: Option<PathBuf>,
    /// File of the reviewers' decisions; `decisions.jsonl` in the store if not given.
    #[arg(long, value_name = "FILE")]
    pub decisions: Option<PathBuf>,
}

/// What a reviewer says of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Say {
    /// It is so: the map is to be changed.
    Accept,
    /// It is not so.
    Reject,
    /// Not to be said yet.
    Later,
    /// What was said before is taken back.
    Undo,
}

impl Export {
    /// Whether some of the changes are asked for.
    fn chooses(&self) -> bool {
        self.all || self.accepted || self.threshold.is_some() || self.min_vehicles.is_some()
    }

    /// Ends the process where the options do not go together.
    fn check(&self, format: Format) {
        let is_page = format == Format::Html;
        let why = match (format.is_map(), &self.map[..], self.all) {
            _ if is_page && self.out.is_none() => {
                "the review page is a folder: name it with --out FOLDER"
            }
            _ if is_page && self.chooses() => {
                "the review page has every change; choose on it, or export another form"
            }
            (true, [], _) => "this form needs the map that the store was made from: --map FILE",
            (true, _, true) => "--all is not for maps: only changes go into one",
            (false, [_, ..], _) => "--map is for `--format lanelet2` and `--format osc`",
            _ => return,
        };
        Args::command()
            .error(ErrorKind::ArgumentConflict, why)
            .exit();
    }
}

/// What `simulate` makes.
#[derive(Debug, clap::Args)]
pub(crate) struct Simulation {
    /// Folder for `before.osm` (the map), `after.osm` (the road), `truth.geojson`,
    /// `history.geojson` and `logs/`; files of these names are replaced.
    pub out: PathBuf,
    /// Seed: the same seed and options give the same bytes.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// What the logs hold.
    #[arg(long, value_enum, default_value_t)]
    pub profile: ProfileName,
    /// A Lanelet2 map (.osm) to drive through instead of a drawn city.
    #[arg(long, conflicts_with = "km")]
    pub map: Option<PathBuf>,
    /// Kilometres of road of a drawn city.
    #[arg(long, default_value_t = 3.0)]
    pub km: f64,
    /// Where a drawn city's middle is: longitude and latitude in degrees.
    #[arg(long, value_names = ["LONGITUDE", "LATITUDE"], num_args = 2, default_values_t = [10.0, 50.0], allow_negative_numbers = true, conflicts_with = "map")]
    pub at: Vec<f64>,
    /// Vehicles.
    #[arg(long, default_value_t = 32)]
    pub vehicles: u32,
    /// Drives of all vehicles together; one and a half for each if not given.
    #[arg(long)]
    pub drives: Option<u32>,
    /// Length of a drive in kilometres.
    #[arg(long, default_value_t = 2.5)]
    pub drive_km: f64,
    /// Days over which the drives are spread.
    #[arg(long, default_value_t = 28)]
    pub days: u32,
    /// Share of the map's elements to which something happens. 0: a control.
    #[arg(long, default_value_t = 0.06)]
    pub changes: f64,
    /// Share of the changes that happen between the first drive and the last, not before.
    #[arg(long, default_value_t = 0.0)]
    pub during: f64,
    /// How well the vehicles measure: the name of a profile or a TOML file.
    #[arg(long, default_value = "paper_like")]
    pub noise: String,
    /// Writes `matching.csv`: which element every detection is of.
    #[arg(long)]
    pub matching_truth: bool,
}

/// Name of a log profile on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum ProfileName {
    /// Detections in metres, as made on the vehicle.
    #[default]
    Detections,
    /// Camera images.
    Camera,
}

fn place_m(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(side_m) if (1.0..=1e6).contains(&side_m) => Ok(side_m),
        _ => Err("a side is 1 to 1000000 metres".to_owned()),
    }
}

/// A secret of 32 bytes; not printed.
#[derive(Clone, Copy)]
pub(crate) struct Salt(pub [u8; 32]);

impl std::fmt::Debug for Salt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Salt(..)")
    }
}

/// Nanoseconds since the Unix epoch.
fn time(text: &str) -> Result<i64, String> {
    let time = chrono::DateTime::parse_from_rfc3339(text)
        .map_err(|_| "no time; give one like 2026-03-15T00:00:00Z".to_owned())?;
    time.timestamp_nanos_opt()
        .ok_or_else(|| "a year between 1678 and 2262 is needed".to_owned())
}

/// Bytes: a number with kB, MB, GB (powers of 1000) or KiB, MiB, GiB (powers of 1024).
fn size(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
    let factor = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" | "k" => 1e3,
        "mb" | "m" => 1e6,
        "gb" | "g" => 1e9,
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        unit => {
            return Err(format!(
                "there is no unit {unit}; give a size like 2GB or 512MiB"
            ));
        }
    };
    match digits.trim().parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok((number * factor) as u64),
        _ => Err("give a size like 2GB or 512MiB".to_owned()),
    }
}

fn salt(text: &str) -> Result<Salt, String> {
    let digits: Vec<u32> = text
        .chars()
        .filter_map(|digit| digit.to_digit(16))
        .collect();
    let count = text.chars().count();
    if digits.len() != 64 || count != 64 {
        return Err(format!(
            "{} of its {count} characters are hexadecimal digits; give 64 of them and nothing else, e.g. from `openssl rand -hex 32`",
            digits.len()
        ));
    }
    let mut bytes = [0; 32];
    for (byte, pair) in bytes.iter_mut().zip(digits.chunks(2)) {
        *byte = (pair[0] * 16 + pair[1]) as u8;
    }
    Ok(Salt(bytes))
}
