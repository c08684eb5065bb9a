//! The reference line of a road in the plane: straight lines, arcs, spirals and cubics
//! (ASAM OpenDRIVE 1.8, section 9.3).

use tilefold_schemas::limits::MAX_SPIRAL_TURN_RAD;

use super::tree::Node;

/// A reference line.
#[derive(Debug)]
pub(super) struct Curve {
    pieces: Vec<Piece>,
}

/// Where the reference line is and where it goes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) heading_rad: f64,
}

#[derive(Debug)]
struct Piece {
    start: f64,
    from: Pose,
    length: f64,
    shape: Shape,
}

/// A shape in its own frame: u along its first direction, v to the left, in metres.
#[derive(Debug)]
enum Shape {
    Line,
    Arc {
        curvature: f64,
    },
    Spiral {
        first: f64,
        last: f64,
    },
    Poly3([f64; 4]),
    ParamPoly3 {
        u: [f64; 4],
        v: [f64; 4],
        is_normalised: bool,
    },
}

impl Curve {
    /// The curve of a `planView`.
    pub(super) fn read<'a>(geometries: impl Iterator<Item = &'a Node>) -> Result<Self, String> {
        let mut pieces = geometries.map(Piece::read).collect::<Result<Vec<_>, _>>()?;
        if pieces.is_empty() {
            return Err("it has no geometry".to_owned());
        }
        pieces.sort_by(|one, other| one.start.total_cmp(&other.start));
        Ok(Self { pieces })
    }

    /// The pose at a station; the curve's end beyond its end.
    pub(super) fn at(&self, s: f64) -> Pose {
        let begun = self.pieces.partition_point(|piece| piece.start <= s).max(1);
        self.pieces[begun - 1].at(s)
    }

    /// The stations between `from` and `to` at which a shape begins.
    pub(super) fn breaks(&self, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let first = self.pieces.partition_point(|piece| piece.start <= from);
        let begun = self.pieces[first..].iter().map(|piece| piece.start);
        begun.take_while(move |station| *station < to)
    }
}

impl Piece {
    fn read(geometry: &Node) -> Result<Self, String> {
        let [start, x, y, heading_rad, length] =
            geometry.numbers(["s", "x", "y", "hdg", "length"])?;
        let shape = geometry.children.first().ok_or_else(|| {
            format!(
                "its <geometry> ({}) has no shape that is read",
                geometry.place
            )
        })?;
        if length < 0.0 {
            return Err(format!(
                "its <geometry> ({}) has the length {length}",
                geometry.place
            ));
        }
        let from = Pose { x, y, heading_rad };
        let shape = Shape::read(shape, length)?;
        Ok(Self {
            start,
            from,
            length,
            shape,
        })
    }

    fn at(&self, s: f64) -> Pose {
        let [u, v, turn_rad] = self
            .shape
            .at((s - self.start).clamp(0.0, self.length), self.length);
        let (sin, cos) = self.from.heading_rad.sin_cos();
        Pose {
            x: self.from.x + u * cos - v * sin,
            y: self.from.y + u * sin + v * cos,
            heading_rad: self.from.heading_rad + turn_rad,
        }
    }
}

impl Shape {
    fn read(node: &Node, length: f64) -> Result<Self, String> {
        Ok(match node.name.as_str() {
            "line" => Self::Line,
            "arc" => Self::Arc {
                curvature: node.number("curvature")?,
            },
            "spiral" => {
                let [first, last] = node.numbers(["curvStart", "curvEnd"])?;
                let turn_rad = first.abs().max(last.abs()) * length;
                if turn_rad > MAX_SPIRAL_TURN_RAD {
                    return Err(format!(
                        "its <spiral> ({}) turns by {turn_rad:.0} rad, the limit is {MAX_SPIRAL_TURN_RAD} (MAX_SPIRAL_TURN_RAD)",
                        node.place
                    ));
                }
                Self::Spiral { first, last }
            }
            "poly3" => Self::Poly3(node.numbers(["a", "b", "c", "d"])?),
            "paramPoly3" => Self::ParamPoly3 {
                u: node.numbers(["aU", "bU", "cU", "dU"])?,
                v: node.numbers(["aV", "bV", "cV", "dV"])?,
                is_normalised: node.attribute("pRange") != "arcLength",
            },
            other => {
                return Err(format!(
                    "its <{other}> ({}) is no shape that is read",
                    node.place
                ));
            }
        })
    }

    /// u, v and the turn in radians after `ds` of `length` metres.
    fn at(&self, ds: f64, length: f64) -> [f64; 3] {
        match self {
            Self::Line => [ds, 0.0, 0.0],
            Self::Arc { curvature } => arc(*curvature, ds),
            Self::Spiral { first, last } => {
                let slope = if length > 0.0 {
                    (last - first) / length
                } else {
                    0.0
                };
                spiral(*first, slope, ds)
            }
            Self::Poly3(v) => {
                let u = u_after(v, ds);
                [u, value(v, u), slope(v, u).atan()]
            }
            Self::ParamPoly3 {
                u,
                v,
                is_normalised,
            } => {
                let p = if *is_normalised && length > 0.0 {
                    ds / length
                } else {
                    ds
                };
                [value(u, p), value(v, p), slope(v, p).atan2(slope(u, p))]
            }
        }
    }
}

fn arc(curvature: f64, ds: f64) -> [f64; 3] {
    let turn_rad = curvature * ds;
    // A chord of the sine of half the turn: exact, and sound where the curvature is almost 0.
    let half = turn_rad / 2.0;
    let chord = if half == 0.0 {
        ds
    } else {
        ds * half.sin() / half
    };
    [chord * half.cos(), chord * half.sin(), turn_rad]
}

/// A curve whose curvature begins with `first` and grows by `slope` per metre.
fn spiral(first: f64, slope: f64, ds: f64) -> [f64; 3] {
    let turn_rad = |s: f64| s * (first + s * slope / 2.0);
    let most = (first.abs()).max((first + slope * ds).abs()) * ds;
    let panels = panels(most);
    [
        integral(|s| turn_rad(s).cos(), ds, panels),
        integral(|s| turn_rad(s).sin(), ds, panels),
        turn_rad(ds),
    ]
}

/// How far along u a cubic v(u) has come after `ds` metres along its arc.
fn u_after(v: &[f64; 4], ds: f64) -> f64 {
    let speed = |u: f64| slope(v, u).hypot(1.0);
    let mut u = ds;
    for _ in 0..NEWTON_STEPS {
        let turn_rad = slope(v, u).atan() - slope(v, 0.0).atan();
        let step = (integral(speed, u, panels(turn_rad.abs()) + 4) - ds) / speed(u);
        u = (u - step).clamp(0.0, ds);
        if step.abs() < 1e-9 {
            break;
        }
    }
    u
}

/// The arc only gets longer with u: a few steps are enough.
const NEWTON_STEPS: usize = 30;

/// How many panels of half a radian a turn takes.
fn panels(turn_rad: f64) -> usize {
    (turn_rad / 0.5)
        .ceil()
        .clamp(1.0, 2.0 * MAX_SPIRAL_TURN_RAD) as usize
}

/// From 0 to `end` by Gauss and Legendre, five points in each panel.
fn integral(f: impl Fn(f64) -> f64, end: f64, panels: usize) -> f64 {
    const POINTS: [(f64, f64); 5] = [
        (0.0, 0.568_888_888_888_888_9),
        (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
        (0.906_179_845_938_664, 0.236_926_885_056_189_08),
    ];
    let half = end / panels as f64 / 2.0;
    let panel = |index: usize| {
        let middle = (2 * index + 1) as f64 * half;
        POINTS
            .iter()
            .map(move |(at, weight)| (middle + at * half, weight))
    };
    let weighted = (0..panels).flat_map(panel).map(|(s, weight)| weight * f(s));
    weighted.sum::<f64>() * half
}

fn value([a, b, c, d]: &[f64; 4], p: f64) -> f64 {
    a + p * (b + p * (c + p * d))
}

fn slope([_, b, c, d]: &[f64; 4], p: f64) -> f64 {
    b + p * (2.0 * c + p * 3.0 * d)
}
