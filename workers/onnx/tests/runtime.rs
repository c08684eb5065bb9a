//! ONNX Runtime at work: the same numbers as python's, the same answer twice, and an error for each
//! thing that can be wrong with a model.
//!
//! ONNX Runtime is there (`cargo xtask setup`) or these tests fail. The models are made here, a
//! graph of one convolution each, so that a checkout without data has something to run.

use std::fs;
use std::path::{Path, PathBuf};

use tilefold_onnx::model_file::sha256;
use tilefold_onnx::{Device, Model, OnnxError};
use tilefold_schemas::Picture;
use tilefold_schemas::observation::Place;
use tilefold_workers::detector::Detector;

/// Where the repository is.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A mask of what is redder than grey, as the smallest network there is: `ll` = 1x1 convolution of
/// `images`. Written by hand in protobuf's wire format.
fn red_mask(width: i64, height: i64, external: bool) -> Vec<u8> {
    fn varint(mut value: u64, out: &mut Vec<u8>) {
        while value >= 0x80 {
            out.push((value & 0x7f) as u8 | 0x80);
            value >>= 7;
        }
        out.push(value as u8);
    }
    fn number(tag: u32, value: i64) -> Vec<u8> {
        let mut out = Vec::new();
        varint(u64::from(tag << 3), &mut out);
        varint(value as u64, &mut out);
        out
    }
    fn bytes(tag: u32, content: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        varint(u64::from(tag << 3 | 2), &mut out);
        varint(content.len() as u64, &mut out);
        out.extend(content);
        out
    }
    let text = |tag: u32, text: &str| bytes(tag, text.as_bytes());
    let value = |tag: u32, name: &str, shape: [i64; 4]| {
        let dimensions: Vec<u8> = shape
            .iter()
            .flat_map(|side| bytes(1, &number(1, *side)))
            .collect();
        let tensor = [number(1, 1), bytes(2, &dimensions)].concat();
        bytes(tag, &[text(1, name), bytes(2, &bytes(1, &tensor))].concat())
    };
    // Channel 1 is red less the mean of green and blue, channel 0 a tenth.
    let weights: [f32; 6] = [0.0, 0.0, 0.0, 10.0, -5.0, -5.0];
    let raw: Vec<u8> = weights
        .iter()
        .flat_map(|weight| weight.to_le_bytes())
        .collect();
    let shape: Vec<u8> = [2, 3, 1, 1]
        .iter()
        .flat_map(|side| number(1, *side))
        .collect();
    let place = if external {
        let entry = [text(1, "location"), text(2, "/etc/passwd")].concat();
        [bytes(13, &entry), number(14, 1)].concat()
    } else {
        bytes(9, &raw)
    };
    let weights = bytes(5, &[shape, number(2, 1), text(8, "w"), place].concat());
    let bias: Vec<u8> = [1.0_f32, 0.0]
        .iter()
        .flat_map(|bias| bias.to_le_bytes())
        .collect();
    let bias = bytes(
        5,
        &[number(1, 2), number(2, 1), text(8, "b"), bytes(9, &bias)].concat(),
    );
    let node = bytes(
        1,
        &[
            text(1, "images"),
            text(1, "w"),
            text(1, "b"),
            text(2, "ll"),
            text(4, "Conv"),
        ]
        .concat(),
    );
    let graph = [
        node,
        text(2, "g"),
        weights,
        bias,
        value(11, "images", [1, 3, height, width]),
        value(12, "ll", [1, 2, height, width]),
    ];
    [
        number(1, 8),
        bytes(8, &number(2, 13)),
        bytes(7, &graph.concat()),
    ]
    .concat()
}

/// A card and its model in a folder of their own.
fn made(folder: &Path, model: &[u8], change: impl Fn(String) -> String) -> PathBuf {
    fs::write(folder.join("red.onnx"), model).unwrap();
    let card = format!(
        r#"
        name = "red"
        kind = "lane_segmentation"
        model = "red.onnx"
        sha256 = "{}"
        input = {{ name = "images", width_px = 64, height_px = 48 }}
        lines = {{ output = "ll", channel = 1, min_rows = 10 }}
        "#,
        sha256(model)
    );
    let path = folder.join("red.toml");
    fs::write(&path, change(card)).unwrap();
    path
}

fn open(card: &Path) -> Result<Model, OnnxError> {
    Model::open(card, None, Device::Cpu)
}

/// Grey, with a red stripe that leans to the right.
fn striped(width: u32, height: u32) -> Picture {
    let pixel = |i: u32| {
        let (x, y) = (f64::from(i % width), f64::from(i / width));
        let middle = f64::from(width) * (0.3 + 0.3 * y / f64::from(height));
        if (x - middle).abs() < f64::from(width) / 32.0 {
            [220, 20, 30]
        } else {
            [90, 90, 90]
        }
    };
    Picture::new(width, height, (0..width * height).flat_map(pixel).collect()).unwrap()
}

#[test]
fn a_stripe_is_found_where_it_is_in_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let card = made(folder.path(), &red_mask(64, 48, false), |card| card);
    let mut network = open(&card).unwrap().network().unwrap();
    for picture in [striped(64, 48), striped(320, 240)] {
        let found = network.detect(&picture).unwrap();
        assert_eq!(found.len(), 1);
        let Place::Line(points) = &found[0].place else {
            panic!("a line")
        };
        let width = f64::from(picture.width_px);
        for [x, y] in points {
            let expected = width * (0.3 + 0.3 * y / f64::from(picture.height_px));
            assert!((x - expected).abs() < 0.012 * width, "{x} {y} {expected}");
        }
        // The same once more, and from another session.
        assert_eq!(network.detect(&picture).unwrap(), found);
        assert_eq!(
            open(&card)
                .unwrap()
                .network()
                .unwrap()
                .detect(&picture)
                .unwrap(),
            found
        );
    }
}

#[test]
fn every_wrong_model_has_its_error_and_its_fix() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |model: &[u8], change: &dyn Fn(String) -> String| {
        let card = made(folder.path(), model, change);
        open(&card).unwrap_err().to_string()
    };
    let sound = red_mask(64, 48, false);
    let same = |card: String| card;
    let wrong_hash = |card: String| card.replace(&sha256(&sound), &"0".repeat(64));
    let expectations: [(String, &[&str]); 8] = [
        (
            refused(&sound, &wrong_hash),
            &["red.onnx: has the SHA-256", "correct `sha256`"],
        ),
        (
            refused(&red_mask(64, 48, true), &same),
            &[
                "`w` lies in another file (/etc/passwd)",
                "save_as_external_data=False",
            ],
        ),
        (
            refused(b"GIF89a", &same),
            &["is no ONNX model", "export it again"],
        ),
        (
            refused(&red_mask(32, 48, false), &same),
            &[
                "the input `images` is Float32 [1, 3, 48, 32]",
                "[1, 3, 48, 64]",
                "correct the card",
            ],
        ),
        (
            refused(&sound, &|card| card.replace("\"ll\"", "\"lanes\"")),
            &["the card names the output `lanes`, the model has ll"],
        ),
        (
            refused(&sound, &|card| card.replace("min_rows", "min_row")),
            &["red.toml: is no model card", "min_row"],
        ),
        (
            refused(&sound, &|card| {
                card.replace("\"red.onnx\"", "\"blue.onnx\"")
            }),
            &[
                "its model blue.onnx is neither beside it",
                "TILEFOLD_MODELS",
            ],
        ),
        (
            refused(&sound, &|card| {
                card.replace("\"red.onnx\"", "\"../red.onnx\"")
            }),
            &["`model` must be a file's name"],
        ),
    ];
    for (error, parts) in expectations {
        for part in parts {
            assert!(error.contains(part), "{error}\nlacks: {part}");
        }
    }
}

#[test]
fn a_library_that_is_none_is_named_with_the_way_to_get_one() {
    let folder = tempfile::tempdir().unwrap();
    let error = tilefold_onnx::library::find(Some(folder.path()))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("ONNX Runtime was not found") && error.contains("cargo xtask setup"),
        "{error}"
    );
}

#[test]
fn cuda_without_its_library_is_an_error_and_never_the_cpu() {
    let folder = tempfile::tempdir().unwrap();
    let card = made(folder.path(), &red_mask(64, 48, false), |card| card);
    match Model::open(&card, None, Device::Cuda(0)) {
        // A machine with CUDA and its library has nothing to complain of.
        Ok(_) => {}
        Err(error) => {
            let error = error.to_string();
            assert!(
                error.contains("CUDA cannot be used") && error.contains("onnxruntime-gpu"),
                "{error}"
            );
        }
    }
}

/// Python's onnxruntime on the same tensor, where it is installed (`PYTHON` names the interpreter).
#[test]
fn python_s_onnxruntime_gives_the_same_bits() {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let folder = tempfile::tempdir().unwrap();
    let card = made(folder.path(), &red_mask(64, 48, false), |card| card);
    let data =
        std::env::var("TILEFOLD_TEST_DATA").map_or(root().join("../shared/data"), PathBuf::from);
    let twin = data.join("models/twinlitenet_360x640.onnx");
    let mut cards = vec![card];
    if twin.is_file() {
        let card = folder.path().join("twinlitenet_360x640.toml");
        fs::copy(
            root().join("workers/onnx/cards/twinlitenet_360x640.toml"),
            &card,
        )
        .unwrap();
        fs::copy(&twin, folder.path().join("twinlitenet_360x640.onnx")).unwrap();
        cards.push(card);
    } else {
        eprintln!("skipped for TwinLiteNet: {} is not there", twin.display());
    }
    for card in cards {
        let model = open(&card).unwrap();
        let mut network = model.network().unwrap();
        let tensor = network.input_of(&striped(320, 240)).unwrap();
        let ours = network.run_raw(&tensor).unwrap();
        let bytes = |values: &[f32]| {
            values
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect::<Vec<u8>>()
        };
        let input = folder.path().join("input.f32");
        fs::write(&input, bytes(&tensor)).unwrap();
        let output = folder.path().join("output.f32");
        let script = "import sys, numpy, onnxruntime as o\n\
            s = o.SessionOptions(); s.intra_op_num_threads = 1\n\
            n = o.InferenceSession(sys.argv[1], s, providers=['CPUExecutionProvider'])\n\
            i = n.get_inputs()[0]\n\
            x = numpy.fromfile(sys.argv[2], numpy.float32).reshape(i.shape)\n\
            n.run(['ll'], {i.name: x})[0].tofile(sys.argv[3])\n";
        let ran = std::process::Command::new(&python)
            .args(["-c", script])
            .args([&model.path, &input, &output])
            .output();
        let ran = match ran {
            Ok(ran) if ran.status.success() => ran,
            Ok(ran) if String::from_utf8_lossy(&ran.stderr).contains("No module named") => {
                eprintln!(
                    "skipped: {python} has no onnxruntime (`pip install onnxruntime==1.31.1 numpy`)"
                );
                return;
            }
            other => panic!("{other:?}"),
        };
        assert!(ran.stdout.is_empty());
        assert_eq!(
            bytes(&ours[0]),
            fs::read(&output).unwrap(),
            "{}",
            model.path.display()
        );
    }
}
