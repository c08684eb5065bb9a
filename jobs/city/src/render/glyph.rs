//! The shapes of ground signs, as small pictures of coverage with mip levels.
//!
//! A glyph fills its panel: x from 0 (left) to 1 (right), y from 0 (rear) to 1 (ahead), as the driver
//! who reads it sees it. Letters are strokes; arrows and the diamond are polygons.

use tilefold_schemas::element::SignClass;

use super::vector::log2_floor;

/// Texels: a panel is much longer than wide.
const WIDE: usize = 64;
const LONG: usize = 256;
/// Samples of a texel along each side, when a glyph is drawn.
const GRAIN: usize = 3;

type Dot = [f32; 2];

/// One sign's coverage.
pub(super) struct Glyph {
    /// From fine to coarse; each half as long and as wide as the one before.
    levels: Vec<Vec<f32>>,
}

impl Glyph {
    /// Every sign class that has a glyph, and its writings: a speed limit has several.
    pub(super) fn all() -> Vec<Self> {
        (0..GLYPHS)
            .map(|number| Self::drawn(&outline(number)))
            .collect()
    }

    /// The number of a class's glyph; `lot` chooses where there are several.
    pub(super) fn number(class: SignClass, lot: u32) -> usize {
        match class {
            SignClass::StraightArrow | SignClass::Unknown | SignClass::Other => 0,
            SignClass::LeftArrow => 1,
            SignClass::RightArrow => 2,
            SignClass::StraightLeftArrow => 3,
            SignClass::StraightRightArrow => 4,
            SignClass::Diamond | SignClass::BoxJunction => 5,
            SignClass::BusLane => 6,
            SignClass::CycleLane => 7,
            SignClass::Slow => 8,
            SignClass::SpeedLimit => SPEED_LIMITS + lot as usize % LIMITS.len(),
        }
    }

    fn drawn(outline: &Outline) -> Self {
        let texel = |index: usize| {
            let (x, y) = (index % WIDE, index / WIDE);
            let hits = (0..GRAIN * GRAIN).filter(|grain| {
                let share = |texel: usize, grain: usize, side: usize| {
                    (texel as f32 + (grain as f32 + 0.5) / GRAIN as f32) / side as f32
                };
                outline.has([share(x, grain % GRAIN, WIDE), share(y, grain / GRAIN, LONG)])
            });
            hits.count() as f32 / (GRAIN * GRAIN) as f32
        };
        let mut levels = vec![(0..WIDE * LONG).map(texel).collect::<Vec<f32>>()];
        while WIDE >> levels.len() > 0 {
            let (wide, long) = (WIDE >> levels.len(), LONG >> levels.len());
            let finer = &levels[levels.len() - 1];
            let mean = |index: usize| {
                let at = (index / wide) * 4 * wide + (index % wide) * 2;
                let below = at + 2 * wide;
                (finer[at] + finer[at + 1] + finer[below] + finer[below + 1]) / 4.0
            };
            let coarser = (0..wide * long).map(mean).collect();
            levels.push(coarser);
        }
        Self { levels }
    }

    /// Coverage at a place of the panel, blurred over `blur` of its length.
    pub(super) fn at(&self, x: f32, y: f32, blur: f32) -> f32 {
        // Half an octave up: the nearest level.
        let level = log2_floor((blur * LONG as f32 * std::f32::consts::SQRT_2).max(1.0));
        let level = level.min(self.levels.len() - 1);
        let (wide, long) = (WIDE >> level, LONG >> level);
        let (x, y) = (x * wide as f32 - 0.5, y * long as f32 - 0.5);
        let (fx, fy) = (x.floor(), y.floor());
        let (sx, sy) = (x - fx, y - fy);
        let table = &self.levels[level];
        let texel = |x: f32, y: f32| {
            let is_in = x >= 0.0 && y >= 0.0 && x < wide as f32 && y < long as f32;
            if is_in {
                table[y as usize * wide + x as usize]
            } else {
                0.0
            }
        };
        let low = texel(fx, fy) * (1.0 - sx) + texel(fx + 1.0, fy) * sx;
        let high = texel(fx, fy + 1.0) * (1.0 - sx) + texel(fx + 1.0, fy + 1.0) * sx;
        low * (1.0 - sy) + high * sy
    }
}

/// A glyph as polygons (filled) and strokes: from, to, half of their width.
#[derive(Default)]
struct Outline {
    polygons: Vec<Vec<Dot>>,
    strokes: Vec<(Dot, Dot)>,
    /// Half of the strokes' width, as shares of the panel's width and length.
    half: Dot,
}

impl Outline {
    fn has(&self, dot: Dot) -> bool {
        // Even-odd over all polygons: one within another is a hole.
        let inside = self
            .polygons
            .iter()
            .filter(|polygon| contains(polygon, dot));
        inside.count() % 2 == 1 || self.strokes.iter().any(|stroke| self.near(stroke, dot))
    }

    fn near(&self, &(from, to): &(Dot, Dot), dot: Dot) -> bool {
        let scaled = |dot: Dot| [dot[0] / self.half[0], dot[1] / self.half[1]];
        let (a, b, p) = (scaled(from), scaled(to), scaled(dot));
        let (along, away) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        let length = (along[0] * along[0] + along[1] * along[1]).max(1e-9);
        let share = ((away[0] * along[0] + away[1] * along[1]) / length).clamp(0.0, 1.0);
        let miss = [away[0] - along[0] * share, away[1] - along[1] * share];
        miss[0] * miss[0] + miss[1] * miss[1] < 1.0
    }
}

fn contains(polygon: &[Dot], [x, y]: Dot) -> bool {
    let mut inside = false;
    for (index, &[ax, ay]) in polygon.iter().enumerate() {
        let [bx, by] = polygon[(index + 1) % polygon.len()];
        if (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax) {
            inside = !inside;
        }
    }
    inside
}

const SPEED_LIMITS: usize = 9;
const LIMITS: [&str; 3] = ["30", "50", "60"];
const GLYPHS: usize = SPEED_LIMITS + LIMITS.len();

fn outline(number: usize) -> Outline {
    match number {
        0 => polygons(vec![straight()]),
        1 => polygons(vec![turn(1.0)]),
        2 => polygons(vec![turn(-1.0)]),
        3 => polygons(combined(1.0)),
        4 => polygons(combined(-1.0)),
        5 => polygons(diamond()),
        6 => word("BUS"),
        7 => bicycle(),
        8 => word("SLOW"),
        _ => word(LIMITS[(number - SPEED_LIMITS) % LIMITS.len()]),
    }
}

fn polygons(polygons: Vec<Vec<Dot>>) -> Outline {
    Outline {
        polygons,
        ..Outline::default()
    }
}

fn straight() -> Vec<Dot> {
    vec![
        [0.40, 0.0],
        [0.60, 0.0],
        [0.60, 0.58],
        [1.0, 0.58],
        [0.5, 1.0],
        [0.0, 0.58],
        [0.40, 0.58],
    ]
}

/// A bent arrow; to the left for `side` 1, mirrored for -1.
fn turn(side: f32) -> Vec<Dot> {
    let left = [
        [0.78, 0.0],
        [0.98, 0.0],
        [0.98, 0.58],
        [0.84, 0.72],
        [0.46, 0.80],
        [0.46, 0.98],
        [0.0, 0.70],
        [0.46, 0.44],
        [0.46, 0.62],
        [0.74, 0.56],
        [0.78, 0.50],
    ];
    left.map(|dot| mirrored(dot, side)).to_vec()
}

/// Straight ahead and to the side: one outline, so that the arms join.
fn combined(side: f32) -> Vec<Vec<Dot>> {
    let left = [
        [0.60, 0.0],
        [0.78, 0.0],
        [0.78, 0.66],
        [1.0, 0.66],
        [0.69, 1.0],
        [0.38, 0.66],
        [0.60, 0.66],
        [0.60, 0.44],
        [0.36, 0.52],
        [0.36, 0.66],
        [0.0, 0.42],
        [0.36, 0.24],
        [0.36, 0.38],
        [0.60, 0.28],
    ];
    vec![left.map(|dot| mirrored(dot, side)).to_vec()]
}

fn mirrored([x, y]: Dot, side: f32) -> Dot {
    if side > 0.0 { [x, y] } else { [1.0 - x, y] }
}

fn diamond() -> Vec<Vec<Dot>> {
    let ring = |reach: f32| {
        vec![
            [0.5, 0.5 - 0.5 * reach],
            [0.5 + 0.5 * reach, 0.5],
            [0.5, 0.5 + 0.5 * reach],
            [0.5 - 0.5 * reach, 0.5],
        ]
    };
    vec![ring(1.0), ring(0.62)]
}

/// Letters side by side over the whole panel, stretched as road letters are.
fn word(text: &str) -> Outline {
    let count = text.len() as f32;
    let cell = 1.0 / count;
    let half = [0.11 * cell, 0.035];
    let mut strokes = Vec::new();
    for (index, letter) in text.chars().enumerate() {
        let place = |[x, y]: Dot| {
            let wide = cell * 0.84 - 2.0 * half[0];
            let left = index as f32 * cell + cell * 0.08 + half[0];
            [left + x * wide, half[1] + y * (1.0 - 2.0 * half[1])]
        };
        for line in letter_lines(letter) {
            let dots: Vec<Dot> = line.iter().map(|&dot| place(dot)).collect();
            strokes.extend(dots.windows(2).map(|pair| (pair[0], pair[1])));
        }
    }
    Outline {
        polygons: Vec::new(),
        strokes,
        half,
    }
}

/// A letter's lines in a unit square, y upwards.
fn letter_lines(letter: char) -> Vec<Vec<Dot>> {
    let ring = vec![
        [0.3, 0.0],
        [0.7, 0.0],
        [1.0, 0.15],
        [1.0, 0.85],
        [0.7, 1.0],
        [0.3, 1.0],
        [0.0, 0.85],
        [0.0, 0.15],
        [0.3, 0.0],
    ];
    match letter {
        'B' => vec![
            vec![
                [0.0, 0.0],
                [0.0, 1.0],
                [0.7, 1.0],
                [0.95, 0.88],
                [0.95, 0.66],
                [0.7, 0.54],
            ],
            vec![
                [0.0, 0.54],
                [0.7, 0.54],
                [1.0, 0.42],
                [1.0, 0.13],
                [0.7, 0.0],
                [0.0, 0.0],
            ],
        ],
        'U' => vec![vec![
            [0.0, 1.0],
            [0.0, 0.15],
            [0.3, 0.0],
            [0.7, 0.0],
            [1.0, 0.15],
            [1.0, 1.0],
        ]],
        'S' => vec![vec![
            [0.0, 0.12],
            [0.3, 0.0],
            [0.7, 0.0],
            [1.0, 0.14],
            [1.0, 0.36],
            [0.75, 0.5],
            [0.25, 0.54],
            [0.0, 0.66],
            [0.0, 0.86],
            [0.3, 1.0],
            [0.7, 1.0],
            [1.0, 0.88],
        ]],
        'L' => vec![vec![[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]],
        'W' => vec![vec![
            [0.0, 1.0],
            [0.25, 0.0],
            [0.5, 0.75],
            [0.75, 0.0],
            [1.0, 1.0],
        ]],
        '3' => vec![vec![
            [0.0, 0.9],
            [0.3, 1.0],
            [0.7, 1.0],
            [1.0, 0.88],
            [1.0, 0.64],
            [0.5, 0.53],
            [1.0, 0.42],
            [1.0, 0.12],
            [0.7, 0.0],
            [0.3, 0.0],
            [0.0, 0.1],
        ]],
        '5' => vec![vec![
            [1.0, 1.0],
            [0.0, 1.0],
            [0.0, 0.58],
            [0.7, 0.58],
            [1.0, 0.46],
            [1.0, 0.12],
            [0.7, 0.0],
            [0.3, 0.0],
            [0.0, 0.1],
        ]],
        '6' => vec![vec![
            [0.95, 0.9],
            [0.7, 1.0],
            [0.3, 1.0],
            [0.0, 0.85],
            [0.0, 0.15],
            [0.3, 0.0],
            [0.7, 0.0],
            [1.0, 0.15],
            [1.0, 0.42],
            [0.7, 0.55],
            [0.0, 0.5],
        ]],
        // O and 0.
        _ => vec![ring],
    }
}

fn bicycle() -> Outline {
    let half = [0.035, 0.022];
    let mut strokes = Vec::new();
    for middle in [0.24, 0.76] {
        let dots: Vec<Dot> = (0..=16)
            .map(|step| {
                let angle = step as f32 / 16.0 * std::f32::consts::TAU;
                [middle + 0.20 * angle.cos(), 0.26 + 0.22 * angle.sin()]
            })
            .collect();
        strokes.extend(dots.windows(2).map(|pair| (pair[0], pair[1])));
    }
    let frame: [&[Dot]; 4] = [
        &[
            [0.24, 0.26],
            [0.40, 0.66],
            [0.68, 0.66],
            [0.50, 0.26],
            [0.24, 0.26],
        ],
        &[[0.50, 0.26], [0.36, 0.78]],
        &[[0.28, 0.79], [0.44, 0.79]],
        &[[0.76, 0.26], [0.66, 0.86], [0.80, 0.90]],
    ];
    for line in frame {
        strokes.extend(line.windows(2).map(|pair| (pair[0], pair[1])));
    }
    Outline {
        polygons: Vec::new(),
        strokes,
        half,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(number: usize, half: impl Fn(f32) -> bool) -> f32 {
        let glyph = Glyph::drawn(&outline(number));
        let dots =
            (0..2_500).map(|i| ((i % 50) as f32 / 50.0 + 0.01, (i / 50) as f32 / 50.0 + 0.01));
        dots.filter(|&(x, _)| half(x))
            .map(|(x, y)| glyph.at(x, y, 0.0))
            .sum()
    }

    #[test]
    fn left_arrows_point_left_and_right_arrows_are_their_mirrors() {
        let head = |number| (area(number, |x| x < 0.5), area(number, |x| x >= 0.5));
        let (left, right) = (head(1), head(2));
        assert!((left.0 - right.1).abs() < 20.0 && (left.1 - right.0).abs() < 20.0);
        let tip = Glyph::drawn(&outline(1));
        assert!(tip.at(0.15, 0.70, 0.0) > 0.9 && tip.at(0.85, 0.95, 0.0) < 0.1);
    }

    #[test]
    fn every_glyph_has_paint_and_keeps_its_share_when_blurred() {
        for number in 0..GLYPHS {
            let glyph = Glyph::drawn(&outline(number));
            let mean = glyph.levels[0].iter().sum::<f32>() / (WIDE * LONG) as f32;
            assert!((0.1..0.6).contains(&mean), "{number}: {mean}");
            let coarse = &glyph.levels[4];
            let blurred = coarse.iter().sum::<f32>() / coarse.len() as f32;
            assert!((mean - blurred).abs() < 1e-3);
        }
    }
}
