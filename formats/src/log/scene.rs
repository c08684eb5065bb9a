//! foxglove.SceneUpdate: detections in metres.
//!
//! Every line of an entity is a detection, moved by the line's pose into the entity's frame. An
//! update without entities is an empty frame: looked, and saw nothing. An update that only speaks
//! of other things says nothing of lines; boxes of other vehicles are kept as such.

use foxglove::messages::line_primitive::Type;
use foxglove::messages::{LinePrimitive, Point3, Pose, SceneEntity, SceneUpdate};
use tilefold_schemas::limits::{
    MAX_DETECTION_POINT_M, MAX_DETECTIONS_PER_FRAME, MAX_POINTS_PER_DETECTION,
    MAX_PRIMITIVES_PER_MESSAGE,
};
use tilefold_schemas::log::{DetectionSpace, FramePose};

use super::decode::{Decoded, Loss};
use super::detection::{Attributes, Frames, Shape};
use super::error::DecodeError;
use super::protobuf::{decode, to_pose, to_stamp};
use super::sound;
use super::vehicles::{Vehicles, is_vehicle};
use super::wire::Level;

const ENTITIES: u64 = 2;
const LINES: u64 = 11;
const TRIANGLES: u64 = 12;
const LEVELS: &[Level] = &[
    Level {
        what: "entities and deletions",
        limit: 10 * MAX_DETECTIONS_PER_FRAME,
        into: &[ENTITIES],
    },
    Level {
        what: "parts of entities",
        limit: MAX_PRIMITIVES_PER_MESSAGE,
        into: &[LINES, TRIANGLES],
    },
    Level {
        what: "points and colours",
        limit: MAX_DETECTIONS_PER_FRAME * MAX_POINTS_PER_DETECTION,
        into: &[],
    },
];

/// foxglove.SceneUpdate: one frame per stamp and frame of its entities.
pub(crate) fn scene_update(
    bytes: &[u8],
    _: &str,
    decoded: &mut Vec<Decoded>,
) -> Result<Option<Loss>, DecodeError> {
    let scene: SceneUpdate = decode(bytes, "foxglove.SceneUpdate", LEVELS)?;
    let mut frames = Frames::new(DetectionSpace::Metres);
    let mut vehicles = Vehicles::new(DetectionSpace::Metres);
    let mut is_about_others = false;
    for entity in &scene.entities {
        let metadata = entity.metadata.iter();
        let pairs = metadata.map(|pair| (pair.key.as_str(), pair.value.as_str()));
        match Attributes::read(pairs.clone())? {
            Some(attributes) => add_entity(&mut frames, entity, &attributes)?,
            None => {
                is_about_others |= !entity.lines.is_empty() || has_solids(entity);
                if is_vehicle(pairs) {
                    add_vehicle(&mut vehicles, entity)?;
                }
            }
        }
    }
    if frames.is_empty() && !is_about_others {
        let first = scene.entities.first();
        let stamp_ns = to_stamp(first.and_then(|entity| entity.timestamp))?;
        frames.open(stamp_ns, first.map_or("", |entity| &entity.frame_id));
    }
    vehicles.finish(decoded);
    Ok(frames.finish(decoded))
}

fn add_entity(
    frames: &mut Frames,
    entity: &SceneEntity,
    attributes: &Attributes,
) -> Result<(), DecodeError> {
    let at = frames.open(to_stamp(entity.timestamp)?, &entity.frame_id);
    if entity.lines.is_empty() && has_solids(entity) {
        frames.lose_not_line();
    }
    for line in &entity.lines {
        let shape = match line.r#type() {
            Type::LineStrip => Shape::Strip,
            Type::LineLoop => Shape::Loop,
            Type::LineList => Shape::Pairs,
        };
        frames.add(at, attributes, shape, line_points(line)?)?;
    }
    Ok(())
}

/// The corners of a vehicle's boxes.
fn add_vehicle(vehicles: &mut Vehicles, entity: &SceneEntity) -> Result<(), DecodeError> {
    let stamp_ns = to_stamp(entity.timestamp)?;
    for cube in &entity.cubes {
        let pose = cube.pose.map(line_pose).transpose()?.flatten();
        let Some(size) = cube.size else {
            continue;
        };
        let corners = (0..8_u32).map(|corner| {
            let side = |bit: u32, length: f64| {
                let sign = if corner >> bit & 1 == 1 { 0.5 } else { -0.5 };
                sign * length
            };
            let corner = [side(0, size.x), side(1, size.y), side(2, size.z)];
            within_reach(move_point(corner, pose.as_ref()))
        });
        let corners = corners.collect::<Result<_, _>>()?;
        vehicles.add(stamp_ns, &entity.frame_id, corners)?;
    }
    Ok(())
}

/// Whether an entity draws anything but lines and labels.
fn has_solids(entity: &SceneEntity) -> bool {
    !(entity.arrows.is_empty()
        && entity.cubes.is_empty()
        && entity.spheres.is_empty()
        && entity.cylinders.is_empty()
        && entity.triangles.is_empty()
        && entity.models.is_empty())
}

/// The points of a line in its entity's frame, in metres, in the order that its indices give.
fn line_points(line: &LinePrimitive) -> Result<Vec<[f64; 3]>, DecodeError> {
    let pose = line.pose.map(line_pose).transpose()?.flatten();
    let place =
        |point: &Point3| within_reach(move_point([point.x, point.y, point.z], pose.as_ref()));
    if line.indices.is_empty() {
        return line.points.iter().map(place).collect();
    }
    let indexed = line
        .indices
        .iter()
        .take(MAX_POINTS_PER_DETECTION + 1)
        .map(|index| {
            let point = line.points.get(*index as usize);
            let wrong =
                || sound::value_error("index of a point", f64::from(*index), "less than points");
            place(point.ok_or_else(wrong)?)
        });
    indexed.collect()
}

fn within_reach(point: [f64; 3]) -> Result<[f64; 3], DecodeError> {
    let is_far = |value: &&f64| !sound::is_within(**value, MAX_DETECTION_POINT_M);
    match point.iter().find(is_far) {
        Some(value) => Err(sound::value_error(
            "point in metres",
            *value,
            "at most 1e8 either way",
        )),
        None => Ok(point),
    }
}

/// A line's pose; `None` if it moves nothing, so that points then stay bit for bit.
fn line_pose(pose: Pose) -> Result<Option<FramePose>, DecodeError> {
    let identity = foxglove::messages::Quaternion {
        w: 1.0,
        ..Default::default()
    };
    let pose = to_pose(Pose {
        orientation: pose.orientation.or(Some(identity)),
        ..pose
    })?;
    let [x, y, z, _] = pose.orientation;
    let is_identity = pose.position_m == [0.0; 3] && [x, y, z] == [0.0; 3];
    Ok((!is_identity).then_some(pose))
}

/// `q p q* + t`, with `q` normalised.
fn move_point(point: [f64; 3], pose: Option<&FramePose>) -> [f64; 3] {
    let Some(pose) = pose else {
        return point;
    };
    let norm = pose
        .orientation
        .iter()
        .map(|part| part * part)
        .sum::<f64>()
        .sqrt();
    let [x, y, z, w] = pose.orientation.map(|part| part / norm);
    let twice = cross([x, y, z], point).map(|part| 2.0 * part);
    let across = cross([x, y, z], twice);
    std::array::from_fn(|axis| point[axis] + w * twice[axis] + across[axis] + pose.position_m[axis])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
