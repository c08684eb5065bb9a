//! A model's file before ONNX Runtime sees it: its hash, and that it needs no other file.
//!
//! External data would let a model read any file that we can. The few fields that can hold a tensor
//! are walked with prost; all others are skipped.
//!
//! Source: onnx.proto of ONNX 1.20 (field numbers below are its own).

use std::fs::File;
use std::io::Read;
use std::path::Path;

use prost::Message;
use sha2::{Digest, Sha256};
use tilefold_schemas::limits::MAX_MODEL_BYTES;

use crate::error::OnnxError;

/// TensorProto.DataLocation: in another file.
const EXTERNAL: i32 = 1;

#[derive(Clone, PartialEq, Message)]
struct ModelProto {
    #[prost(int64, tag = "1")]
    ir_version: i64,
    #[prost(message, optional, tag = "7")]
    graph: Option<GraphProto>,
    #[prost(message, repeated, tag = "25")]
    functions: Vec<FunctionProto>,
}

#[derive(Clone, PartialEq, Message)]
struct FunctionProto {
    #[prost(message, repeated, tag = "7")]
    nodes: Vec<NodeProto>,
    #[prost(message, repeated, tag = "11")]
    attributes: Vec<AttributeProto>,
}

#[derive(Clone, PartialEq, Message)]
struct GraphProto {
    #[prost(message, repeated, tag = "1")]
    nodes: Vec<NodeProto>,
    #[prost(message, repeated, tag = "5")]
    initializers: Vec<TensorProto>,
    #[prost(message, repeated, tag = "15")]
    sparse_initializers: Vec<SparseTensorProto>,
}

#[derive(Clone, PartialEq, Message)]
struct NodeProto {
    #[prost(message, repeated, tag = "5")]
    attributes: Vec<AttributeProto>,
}

#[derive(Clone, PartialEq, Message)]
struct AttributeProto {
    #[prost(message, optional, tag = "5")]
    tensor: Option<TensorProto>,
    #[prost(message, optional, boxed, tag = "6")]
    graph: Option<Box<GraphProto>>,
    #[prost(message, repeated, tag = "10")]
    tensors: Vec<TensorProto>,
    #[prost(message, repeated, tag = "11")]
    graphs: Vec<GraphProto>,
    #[prost(message, optional, tag = "22")]
    sparse_tensor: Option<SparseTensorProto>,
    #[prost(message, repeated, tag = "23")]
    sparse_tensors: Vec<SparseTensorProto>,
}

#[derive(Clone, PartialEq, Message)]
struct SparseTensorProto {
    #[prost(message, optional, tag = "1")]
    values: Option<TensorProto>,
    #[prost(message, optional, tag = "2")]
    indices: Option<TensorProto>,
}

#[derive(Clone, PartialEq, Message)]
struct TensorProto {
    #[prost(string, tag = "8")]
    name: String,
    #[prost(message, repeated, tag = "13")]
    external_data: Vec<EntryProto>,
    #[prost(int32, tag = "14")]
    data_location: i32,
}

#[derive(Clone, PartialEq, Message)]
struct EntryProto {
    #[prost(string, tag = "1")]
    key: String,
    #[prost(string, tag = "2")]
    value: String,
}

/// The bytes of a model whose SHA-256 is `expected` and which needs no other file.
///
/// # Errors
/// Another hash, no ONNX, or weights elsewhere.
pub fn read_model(path: &Path, card_path: &Path, expected: &str) -> Result<Vec<u8>, OnnxError> {
    let bytes = read_limited(path, "model", MAX_MODEL_BYTES)?;
    let found = sha256(&bytes);
    if !found.eq_ignore_ascii_case(expected) {
        return Err(OnnxError::Hash {
            model: path.to_owned(),
            card: card_path.to_owned(),
            found,
            expected: expected.to_ascii_lowercase(),
        });
    }
    check_contained(path, &bytes)?;
    Ok(bytes)
}

/// The bytes of a file of at most `limit` bytes.
pub(crate) fn read_limited(
    path: &Path,
    what: &'static str,
    limit: u64,
) -> Result<Vec<u8>, OnnxError> {
    let cannot_read = |source| OnnxError::Read {
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(cannot_read)?;
    let bytes = file.metadata().map_err(cannot_read)?.len();
    let mut content = Vec::new();
    // What a pipe or a growing file says of its length is not what it gives.
    file.take(limit + 1)
        .read_to_end(&mut content)
        .map_err(cannot_read)?;
    if content.len() as u64 > limit {
        return Err(OnnxError::TooLarge {
            path: path.to_owned(),
            what,
            bytes: bytes.max(content.len() as u64),
            limit,
        });
    }
    Ok(content)
}

/// SHA-256 in hexadecimal digits.
#[must_use]
pub fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn check_contained(path: &Path, bytes: &[u8]) -> Result<(), OnnxError> {
    let not_onnx = |reason: String| OnnxError::NotOnnx {
        path: path.to_owned(),
        reason,
    };
    let model = ModelProto::decode(bytes).map_err(|error| not_onnx(error.to_string()))?;
    let Some(graph) = &model.graph else {
        return Err(not_onnx("it has no graph".to_owned()));
    };
    let in_functions = model.functions.iter().find_map(|function| {
        let nodes = function.nodes.iter().flat_map(|node| &node.attributes);
        nodes
            .chain(&function.attributes)
            .find_map(external_in_attribute)
    });
    match external_in_graph(graph).or(in_functions) {
        None => Ok(()),
        Some(tensor) => Err(OnnxError::ExternalData {
            path: path.to_owned(),
            tensor: tensor.name.clone(),
            location: location(tensor),
        }),
    }
}

fn location(tensor: &TensorProto) -> String {
    let mut entries = tensor.external_data.iter();
    let named = entries.find(|entry| entry.key == "location");
    named.map_or_else(|| "not named".to_owned(), |entry| entry.value.clone())
}

fn external_in_graph(graph: &GraphProto) -> Option<&TensorProto> {
    let sparse = graph.sparse_initializers.iter().flat_map(parts);
    let tensors = graph.initializers.iter().chain(sparse);
    let attributes = graph.nodes.iter().flat_map(|node| &node.attributes);
    external(tensors).or_else(|| attributes.into_iter().find_map(external_in_attribute))
}

/// prost refuses messages nested deeper than a hundred, so this ends.
fn external_in_attribute(attribute: &AttributeProto) -> Option<&TensorProto> {
    let sparse = attribute
        .sparse_tensor
        .iter()
        .chain(&attribute.sparse_tensors);
    let tensors = attribute.tensor.iter().chain(&attribute.tensors);
    let graphs = attribute
        .graph
        .as_deref()
        .into_iter()
        .chain(&attribute.graphs);
    external(tensors.chain(sparse.flat_map(parts)))
        .or_else(|| graphs.into_iter().find_map(external_in_graph))
}

fn parts(sparse: &SparseTensorProto) -> impl Iterator<Item = &TensorProto> {
    sparse.values.iter().chain(&sparse.indices)
}

fn external<'a>(mut tensors: impl Iterator<Item = &'a TensorProto>) -> Option<&'a TensorProto> {
    tensors.find(|tensor| tensor.data_location == EXTERNAL || !tensor.external_data.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tensor(location: i32) -> TensorProto {
        TensorProto {
            name: "weights".to_owned(),
            external_data: Vec::new(),
            data_location: location,
        }
    }

    fn check(model: &ModelProto) -> Result<(), OnnxError> {
        check_contained(Path::new("m.onnx"), &model.encode_to_vec())
    }

    fn with(graph: GraphProto) -> ModelProto {
        ModelProto {
            ir_version: 8,
            graph: Some(graph),
            functions: Vec::new(),
        }
    }

    #[test]
    fn weights_elsewhere_are_found_at_any_depth() {
        let outer = |inner: GraphProto| GraphProto {
            nodes: vec![NodeProto {
                attributes: vec![AttributeProto {
                    graph: Some(Box::new(inner)),
                    ..AttributeProto::default()
                }],
            }],
            ..GraphProto::default()
        };
        let inner = |location| GraphProto {
            initializers: vec![tensor(location)],
            ..GraphProto::default()
        };
        assert!(check(&with(outer(inner(0)))).is_ok());
        let error = check(&with(outer(inner(EXTERNAL)))).unwrap_err();
        assert!(matches!(error, OnnxError::ExternalData { tensor, .. } if tensor == "weights"));
    }

    #[test]
    fn what_has_no_graph_is_no_model() {
        assert!(matches!(
            check_contained(Path::new("m.onnx"), b""),
            Err(OnnxError::NotOnnx { .. })
        ));
        assert!(matches!(
            check_contained(Path::new("m.onnx"), b"\x89PNG\r\n"),
            Err(OnnxError::NotOnnx { .. })
        ));
    }

    #[test]
    fn the_hash_is_that_of_the_standard() {
        // FIPS 180-4: "abc".
        assert_eq!(
            sha256(b"abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }
}
