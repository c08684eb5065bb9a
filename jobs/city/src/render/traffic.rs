//! Vehicles around the camera.

use nalgebra::Isometry3;

use super::noise::hash;
use super::solids::{Solid, SolidKind};
use super::vector::{v2, v3};

/// From this height on a vehicle is drawn as a van, truck or bus, in metres.
const HAULER_M: f64 = 1.9;

/// A vehicle that is not ours: a box in which a car (or, if it is higher than 1.9 m, a van, truck or
/// bus) is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct TrafficVehicle {
    /// Its pose when the picture is taken: origin on the ground in the middle of the box, x ahead.
    /// It stands upright: of its rotation only the yaw counts.
    pub map_from_vehicle: Isometry3<f64>,
    /// Length, width and height in metres.
    pub size_m: [f64; 3],
    /// Its paint: red, green and blue reflectance, 0 to 1 (linear).
    pub color: [f32; 3],
    /// How fast it moves ahead, in metres per second.
    pub speed_m_s: f64,
}

impl TrafficVehicle {
    /// Its shape in the local frame of `origin`.
    pub(super) fn solid(&self, number: usize, origin: [f64; 3]) -> Solid {
        let ahead = self.map_from_vehicle.rotation * nalgebra::Vector3::x();
        let ahead = v2(ahead.x as f32, ahead.y as f32).unit();
        let at = self.map_from_vehicle.translation.vector;
        let [length, width, height] = self.size_m.map(|metres| metres.max(0.1) as f32);
        let [red, green, blue] = self.color;
        let speed = self.speed_m_s as f32;
        Solid {
            kind: if self.size_m[2] < HAULER_M {
                SolidKind::Car
            } else {
                SolidKind::Hauler
            },
            foot: v3(
                (at.x - origin[0]) as f32,
                (at.y - origin[1]) as f32,
                (at.z - origin[2]) as f32,
            ),
            ahead,
            size: v3(length, width, height),
            color: v3(red, green, blue),
            lots: hash(number as i32, (length * 100.0) as i32, 41),
            velocity: v3(ahead.x, ahead.y, 0.0) * speed,
            vehicle: Some(number),
            in_sun: 1.0,
        }
    }
}
