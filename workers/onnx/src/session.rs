//! One session of ONNX Runtime: one intra-op thread, no spinning, one fixed input.

use ort::ep;
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::{TensorElementType, TensorRef, ValueType};

use crate::error::OnnxError;
use crate::network::{Device, Model};

/// A tensor that a network gives: its numbers, row-major.
pub(crate) struct Output<'a> {
    pub(crate) shape: Vec<usize>,
    pub(crate) values: &'a [f32],
}

/// What a tensor should be.
#[derive(Debug, Clone)]
pub(crate) struct Wanted {
    pub(crate) name: String,
    pub(crate) shape: Vec<i64>,
}

/// Opens a session whose tensors are those of the card.
///
/// # Errors
/// CUDA is asked for and cannot be had, ONNX Runtime refuses the model, or its tensors differ.
pub(crate) fn open(model: &Model) -> Result<Session, OnnxError> {
    let session = build(model).map_err(|reason| refused(model, reason))?;
    let card = &model.card;
    check(
        model,
        "input",
        session.inputs().iter(),
        &[card.wanted_input()],
    )?;
    check(
        model,
        "output",
        session.outputs().iter(),
        &card.wanted_outputs(),
    )?;
    if session.inputs().len() != 1 {
        return Err(differs(
            model,
            format!(
                "it takes {} inputs, where one picture is given",
                session.inputs().len()
            ),
        ));
    }
    Ok(session)
}

/// Its errors hold a builder and stay in here: they cannot be sent to another thread.
fn build(model: &Model) -> Result<Session, String> {
    let say = |error: &dyn std::fmt::Display| error.to_string();
    let mut builder = Session::builder(&model.library.environment)
        .map_err(|error| say(&error))?
        .with_intra_threads(1)
        .map_err(|error| say(&error))?
        .with_intra_op_spinning(false)
        .map_err(|error| say(&error))?
        .with_inter_op_spinning(false)
        .map_err(|error| say(&error))?
        .with_optimization_level(GraphOptimizationLevel::All)
        .map_err(|error| say(&error))?;
    if let Device::Cuda(number) = model.device {
        // Without this it would run on the CPU and say nothing.
        let cuda = ep::CUDA::default()
            .with_device_id(number)
            .build()
            .error_on_failure();
        builder = builder
            .with_execution_providers([cuda])
            .map_err(|error| say(&error))?;
    }
    builder
        .commit_from_memory(&model.bytes)
        .map_err(|error| say(&error))
}

fn refused(model: &Model, reason: String) -> OnnxError {
    match model.device {
        Device::Cuda(_) => OnnxError::Cuda { reason },
        Device::Cpu => OnnxError::Session {
            path: model.path.clone(),
            reason,
        },
    }
}

fn differs(model: &Model, what: String) -> OnnxError {
    OnnxError::Tensors {
        path: model.path.clone(),
        what,
    }
}

fn check<'a>(
    model: &Model,
    side: &str,
    outlets: impl Iterator<Item = &'a ort::value::Outlet> + Clone,
    wanted: &[Wanted],
) -> Result<(), OnnxError> {
    for Wanted { name, shape } in wanted {
        let Some(outlet) = outlets.clone().find(|outlet| outlet.name() == name) else {
            let names: Vec<&str> = outlets.clone().map(ort::value::Outlet::name).collect();
            let names = names.join(", ");
            return Err(differs(
                model,
                format!("the card names the {side} `{name}`, the model has {names}"),
            ));
        };
        let ValueType::Tensor {
            ty, shape: found, ..
        } = outlet.dtype()
        else {
            return Err(differs(model, format!("the {side} `{name}` is no tensor")));
        };
        // A dimension that the model leaves open (-1) is fixed by what we give it.
        let agrees = found.len() == shape.len()
            && found
                .iter()
                .zip(shape)
                .all(|(found, wanted)| *found == -1 || found == wanted);
        if *ty != TensorElementType::Float32 || !agrees {
            return Err(differs(
                model,
                format!(
                    "the {side} `{name}` is {ty:?} {:?}, by the card it is Float32 {shape:?}",
                    found.iter().collect::<Vec<_>>()
                ),
            ));
        }
    }
    Ok(())
}

/// Runs the network on one input and hands its outputs, in the order of `names`, to `read`.
///
/// # Errors
/// What ONNX Runtime says, or an output that is not what the card says.
pub(crate) fn run<T>(
    session: &mut Session,
    (shape, input): ([i64; 4], &[f32]),
    wanted: &[Wanted],
    read: impl FnOnce(&[Output<'_>]) -> T,
) -> Result<T, String> {
    let input = TensorRef::from_array_view((shape, input)).map_err(|error| error.to_string())?;
    let outputs = session
        .run(ort::inputs![input])
        .map_err(|error| error.to_string())?;
    let mut tensors = Vec::with_capacity(wanted.len());
    for Wanted { name, shape } in wanted {
        let value = outputs
            .get(name)
            .ok_or_else(|| format!("no output `{name}`"))?;
        let (found, values) = value
            .try_extract_tensor::<f32>()
            .map_err(|error| error.to_string())?;
        // Only now are open dimensions known.
        if found.iter().ne(shape.iter()) {
            return Err(format!(
                "the output `{name}` came as {found:?}, by the card it is {shape:?}"
            ));
        }
        let shape = shape.iter().map(|side| *side as usize).collect();
        tensors.push(Output { shape, values });
    }
    Ok(read(&tensors))
}
