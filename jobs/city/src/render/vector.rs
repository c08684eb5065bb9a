//! Vectors of the shading loops: single precision, in the local frame of one picture (metres east,
//! north and up of its origin), or a colour in linear light.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// A place, direction or colour.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct V3 {
    pub(super) x: f32,
    pub(super) y: f32,
    pub(super) z: f32,
}

/// A colour in linear light: red, green, blue; 1 is a white sheet in full daylight.
pub(super) type Rgb = V3;

pub(super) const fn v3(x: f32, y: f32, z: f32) -> V3 {
    V3 { x, y, z }
}

pub(super) const fn grey(value: f32) -> Rgb {
    v3(value, value, value)
}

impl V3 {
    pub(super) fn dot(self, other: Self) -> f32 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    pub(super) fn norm(self) -> f32 {
        self.dot(self).sqrt()
    }

    pub(super) fn unit(self) -> Self {
        self * (1.0 / self.norm().max(1e-12))
    }

    pub(super) fn flat(self) -> V2 {
        v2(self.x, self.y)
    }

    pub(super) fn mix(self, other: Self, share: f32) -> Self {
        self + (other - self) * share
    }

    /// Brightness of a colour (Rec. 709).
    pub(super) fn luma(self) -> f32 {
        0.2126 * self.x + 0.7152 * self.y + 0.0722 * self.z
    }
}

impl Add for V3 {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        v3(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl AddAssign for V3 {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for V3 {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        v3(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Neg for V3 {
    type Output = Self;
    fn neg(self) -> Self {
        v3(-self.x, -self.y, -self.z)
    }
}

impl Mul<f32> for V3 {
    type Output = Self;
    fn mul(self, by: f32) -> Self {
        v3(self.x * by, self.y * by, self.z * by)
    }
}

/// Colours filter each other channel by channel.
impl Mul for V3 {
    type Output = Self;
    fn mul(self, by: Self) -> Self {
        v3(self.x * by.x, self.y * by.y, self.z * by.z)
    }
}

/// A place or direction on the plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct V2 {
    pub(super) x: f32,
    pub(super) y: f32,
}

pub(super) const fn v2(x: f32, y: f32) -> V2 {
    V2 { x, y }
}

impl V2 {
    pub(super) fn dot(self, other: Self) -> f32 {
        self.x * other.x + self.y * other.y
    }

    /// Positive where `other` points to the left of this.
    pub(super) fn cross(self, other: Self) -> f32 {
        self.x * other.y - self.y * other.x
    }

    pub(super) fn norm(self) -> f32 {
        self.dot(self).sqrt()
    }

    pub(super) fn unit(self) -> Self {
        self * (1.0 / self.norm().max(1e-12))
    }

    /// Turned by a quarter, to the left.
    pub(super) fn left(self) -> Self {
        v2(-self.y, self.x)
    }
}

impl Add for V2 {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        v2(self.x + other.x, self.y + other.y)
    }
}

impl Sub for V2 {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        v2(self.x - other.x, self.y - other.y)
    }
}

impl Neg for V2 {
    type Output = Self;
    fn neg(self) -> Self {
        v2(-self.x, -self.y)
    }
}

impl Mul<f32> for V2 {
    type Output = Self;
    fn mul(self, by: f32) -> Self {
        v2(self.x * by, self.y * by)
    }
}

/// The largest whole number that is not above `x`, for `x` that fits into 32 bits: a call into the
/// system's library would cost more than the rest of a look-up.
pub(super) fn floor(x: f32) -> i32 {
    let whole = x as i32;
    whole - i32::from(whole as f32 > x)
}

/// The whole part of the binary logarithm of `x`, which is 1 or more.
pub(super) fn log2_floor(x: f32) -> usize {
    (x.to_bits() >> 23).saturating_sub(127) as usize
}

/// 0 below `from`, 1 above `to`, smooth between.
pub(super) fn smooth(from: f32, to: f32, x: f32) -> f32 {
    let share = ((x - from) / (to - from)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
