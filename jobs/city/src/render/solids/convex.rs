//! Where a ray enters a convex body.

use crate::render::vector::V3;

/// A half space: `normal . p <= offset`. The normal need not have length 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane(pub(super) V3, pub(super) f32);

/// How far along the ray it enters the body that all planes bound, and through which plane; none if
/// it misses or starts inside.
pub(super) fn clip(planes: &[Plane], from: V3, to: V3) -> Option<(f32, usize)> {
    let (mut enter, mut leave, mut face) = (0.0_f32, f32::INFINITY, usize::MAX);
    for (index, Plane(normal, offset)) in planes.iter().enumerate() {
        let speed = normal.dot(to);
        let room = offset - normal.dot(from);
        if speed.abs() < 1e-12 {
            if room < 0.0 {
                return None;
            }
            continue;
        }
        let at = room / speed;
        if speed > 0.0 {
            leave = leave.min(at);
        } else if at > enter {
            (enter, face) = (at, index);
        }
        if enter > leave {
            return None;
        }
    }
    (face != usize::MAX).then_some((enter, face))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::vector::v3;

    #[test]
    fn a_ray_enters_a_box_through_its_near_side() {
        let slab = [
            Plane(v3(1.0, 0.0, 0.0), 1.0),
            Plane(v3(-1.0, 0.0, 0.0), 1.0),
            Plane(v3(0.0, 1.0, 0.0), 1.0),
            Plane(v3(0.0, -1.0, 0.0), 1.0),
        ];
        let hit = |from, to| clip(&slab, from, to);
        assert_eq!(hit(v3(-3.0, 0.5, 0.0), v3(1.0, 0.0, 0.0)), Some((2.0, 1)));
        assert_eq!(hit(v3(-3.0, 1.5, 0.0), v3(1.0, 0.0, 0.0)), None);
        assert_eq!(hit(v3(0.0, 0.0, 0.0), v3(1.0, 0.0, 0.0)), None);
    }
}
