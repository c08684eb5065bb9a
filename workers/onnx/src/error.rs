//! Why a model cannot be run: what, where, why, and what mends it.

use std::path::PathBuf;

/// Why a model cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum OnnxError {
    /// No ONNX Runtime anywhere.
    #[error(
        "ONNX Runtime was not found: looked for {name} in {}; run `cargo xtask setup` in the checkout, or name the library with --onnxruntime FILE or ORT_DYLIB_PATH",
        list(places)
    )]
    NoLibrary {
        /// Name of the file.
        name: &'static str,
        /// Where it was looked for.
        places: Vec<PathBuf>,
    },
    /// A library that cannot be loaded.
    #[error(
        "{}: cannot be loaded as ONNX Runtime: {reason}; run `cargo xtask setup` for the version that is known to work, and name no other with --onnxruntime or ORT_DYLIB_PATH",
        path.display()
    )]
    Library {
        /// The library.
        path: PathBuf,
        /// What the loader says.
        reason: String,
    },
    /// A second library in one process.
    #[error(
        "{}: this process runs with {} already; name one library only",
        wanted.display(), loaded.display()
    )]
    SecondLibrary {
        /// What is asked for now.
        wanted: PathBuf,
        /// What is loaded.
        loaded: PathBuf,
    },
    /// A file that cannot be read.
    #[error("{}: cannot be read: {source}; check the path and its rights", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file beyond its limit.
    #[error("{}: has {bytes} bytes, more than the {limit} that a {what} may have; is it the right file?", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What it should be.
        what: &'static str,
        /// Its bytes.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// A card that is not TOML, or not of a card's form.
    #[error("{}: is no model card: {reason}; docs/reference/models.md describes one", path.display())]
    Card {
        /// The card.
        path: PathBuf,
        /// What is wrong, with its line.
        reason: String,
    },
    /// A card's model is nowhere.
    #[error(
        "{}: its model {model} is neither beside it nor in a folder of TILEFOLD_MODELS; put the file beside the card, or set TILEFOLD_MODELS to its folder",
        card.display()
    )]
    NoModel {
        /// The card.
        card: PathBuf,
        /// Name of the model's file.
        model: String,
    },
    /// A model that is not the card's.
    #[error(
        "{}: has the SHA-256 {found}, its card {} says {expected}: it is another model, or damaged; fetch the file that the card describes, or correct `sha256` in the card if you mean this one",
        model.display(), card.display()
    )]
    Hash {
        /// The model.
        model: PathBuf,
        /// The card.
        card: PathBuf,
        /// Hash of the file.
        found: String,
        /// Hash in the card.
        expected: String,
    },
    /// A file that is no ONNX model.
    #[error("{}: is no ONNX model: {reason}; export it again", path.display())]
    NotOnnx {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Weights in other files.
    #[error(
        "{}: its tensor `{tensor}` lies in another file ({location}); only models of a single file are run: load it with python's onnx and save it with `onnx.save(model, path, save_as_external_data=False)`",
        path.display()
    )]
    ExternalData {
        /// The model.
        path: PathBuf,
        /// The tensor.
        tensor: String,
        /// What the model says of where it is.
        location: String,
    },
    /// The model's inputs or outputs are not what the card says.
    #[error("{}: {what}; correct the card, or export the model with these tensors", path.display())]
    Tensors {
        /// The model.
        path: PathBuf,
        /// What differs: name, shape, type.
        what: String,
    },
    /// CUDA was asked for and is not there.
    #[error(
        "CUDA cannot be used: {reason}; install the library of the wheel `onnxruntime-gpu` with CUDA 13 and cuDNN 9 and name it with --onnxruntime, or leave --cuda away"
    )]
    Cuda {
        /// What ONNX Runtime says.
        reason: String,
    },
    /// ONNX Runtime refuses the model.
    #[error("{}: ONNX Runtime cannot run it: {reason}; check it with python's `onnx.checker`", path.display())]
    Session {
        /// The model.
        path: PathBuf,
        /// What ONNX Runtime says.
        reason: String,
    },
}

fn list(places: &[PathBuf]) -> String {
    let places: Vec<String> = places.iter().map(|p| p.display().to_string()).collect();
    places.join(", ")
}
