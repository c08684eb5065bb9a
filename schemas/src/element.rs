//! A base-map element: a thing painted on the road that the map claims to be there.

use std::collections::BTreeMap;

use crate::id::{ContentHash, ElementId, first_i64};

macro_rules! code_enum {
    ($(#[$meta:meta])* $name:ident { $( $(#[$vmeta:meta])* $variant:ident = $code:literal, $text:literal; )+ }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
        #[repr(i16)]
        pub enum $name { $( $(#[$vmeta])* $variant = $code, )+ }

        impl $name {
            /// Every value, in the order of its code.
            pub const ALL: &'static [Self] = &[ $( Self::$variant, )+ ];

            /// The number stored in tables.
            #[must_use]
            pub fn code(self) -> i16 {
                self as i16
            }

            /// The value of a stored number, if there is one.
            #[must_use]
            pub fn from_code(code: i16) -> Option<Self> {
                match code { $( $code => Some(Self::$variant), )+ _ => None }
            }

            /// The name in files, metadata and reports.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $( Self::$variant => $text, )+ }
            }

            /// The value called `name`, if there is one.
            #[must_use]
            pub fn from_name(name: &str) -> Option<Self> {
                match name { $( $text => Some(Self::$variant), )+ _ => None }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}
pub(crate) use code_enum;

code_enum! {
    /// What kind of thing an element or a detection is.
    ElementKind {
        /// A painted line along the road: polyline.
        #[default]
        LaneMarking = 0, "lane_marking";
        /// A painted line across the lane: polyline.
        StopLine = 1, "stop_line";
        /// A pedestrian crossing: polygon outline, first vertex not repeated.
        Crosswalk = 2, "crosswalk";
        /// An arrow, text or symbol on the road: outline, first vertex not repeated.
        GroundSign = 3, "ground_sign";
    }
}

code_enum! {
    /// How a lane marking is painted, from left to right in the direction of its line.
    Marking {
        /// Not stated.
        #[default]
        Unknown = 0, "unknown";
        /// One solid line.
        Solid = 1, "solid";
        /// One dashed line.
        Dashed = 2, "dashed";
        /// Two solid lines.
        SolidSolid = 3, "solid_solid";
        /// Solid on the left, dashed on the right.
        SolidDashed = 4, "solid_dashed";
        /// Dashed on the left, solid on the right.
        DashedSolid = 5, "dashed_solid";
        /// Two dashed lines.
        DashedDashed = 6, "dashed_dashed";
        /// Dots, zigzag and whatever else is paint.
        Other = 7, "other";
    }
}

code_enum! {
    /// Colour of paint.
    Color {
        /// Not stated.
        #[default]
        Unknown = 0, "unknown";
        /// White.
        White = 1, "white";
        /// Yellow.
        Yellow = 2, "yellow";
        /// Any other.
        Other = 3, "other";
    }
}

code_enum! {
    /// Class of a ground sign; the eleven of the CeyMo data set (Jayasinghe et al., 2022) and the rest.
    SignClass {
        /// Not stated, or no ground sign.
        #[default]
        Unknown = 0, "unknown";
        /// Arrow straight ahead.
        StraightArrow = 1, "straight_arrow";
        /// Arrow to the left.
        LeftArrow = 2, "left_arrow";
        /// Arrow to the right.
        RightArrow = 3, "right_arrow";
        /// Arrow straight and left.
        StraightLeftArrow = 4, "straight_left_arrow";
        /// Arrow straight and right.
        StraightRightArrow = 5, "straight_right_arrow";
        /// Diamond (crossing ahead).
        Diamond = 6, "diamond";
        /// Speed limit written on the road.
        SpeedLimit = 7, "speed_limit";
        /// Bus lane.
        BusLane = 8, "bus_lane";
        /// Cycle lane.
        CycleLane = 9, "cycle_lane";
        /// SLOW.
        Slow = 10, "slow";
        /// Box junction.
        BoxJunction = 11, "box_junction";
        /// Any other.
        Other = 12, "other";
    }
}

/// A base-map element with everything its source said about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// Id in the base map.
    pub id: ElementId,
    /// What kind of thing.
    pub kind: ElementKind,
    /// How it is painted.
    pub marking: Marking,
    /// Colour of its paint.
    pub color: Color,
    /// Class, if it is a ground sign.
    pub sign: SignClass,
    /// Vertices `[longitude_deg, latitude_deg, elevation_m]` on WGS 84, in map order.
    pub points: Vec<[f64; 3]>,
    /// Every tag of the source, as read.
    pub tags: BTreeMap<String, String>,
}

impl Element {
    /// Hash of what the element is. Tags that do not change the paint do not enter it.
    ///
    /// Coordinates enter at 1e-8 degrees and millimetres, so that a map written with fewer
    /// digits than it was read with keeps its hashes.
    #[must_use]
    pub fn content_hash(&self) -> ContentHash {
        let mut hasher = blake3::Hasher::new();
        for code in [
            self.kind.code(),
            self.marking.code(),
            self.color.code(),
            self.sign.code(),
        ] {
            hasher.update(&code.to_le_bytes());
        }
        for [longitude_deg, latitude_deg, elevation_m] in &self.points {
            let rounded = [longitude_deg * 1e8, latitude_deg * 1e8, elevation_m * 1e3];
            for value in rounded {
                hasher.update(&(value.round() as i64).to_le_bytes());
            }
        }
        ContentHash(first_i64(&hasher.finalize()))
    }
}
