//! A city ready to be driven through: its world, what happened in it, and when.

use crate::ground::Ground;
use crate::noise::NoiseProfile;
use crate::reach::Reach;
use crate::render::Renderer;
use crate::spec::CitySpec;
use crate::world::World;

/// A city ready to be driven through.
pub(crate) struct City<'a> {
    pub(crate) spec: &'a CitySpec,
    pub(crate) world: &'a World,
    pub(crate) ground: Ground<'a>,
    pub(crate) reach: Reach,
    pub(crate) noise: NoiseProfile,
    /// Takes pictures, where logs hold them.
    pub(crate) renderer: Option<Renderer<'a>>,
    /// When the campaign begins.
    pub(crate) begin_ns: i64,
}
