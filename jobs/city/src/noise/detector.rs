//! Parameters of what detections on a vehicle say of the paint.
//!
//! A *pass* is one vehicle driving along one line once: its errors are alike, and those of two
//! passes are not.

use serde::Deserialize;

use super::section::{Outside, Profile, section};

/// The detector.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DetectorNoise {
    /// Where it looks, and how often.
    pub view: View,
    /// What it misses.
    pub miss: Miss,
    /// How far to the side of the paint its lines are.
    pub lateral: Lateral,
    /// What it sees where nothing is painted.
    pub clutter: Clutter,
    /// What it takes painted things for.
    pub reading: Reading,
    /// How it sees signs, stop lines and crosswalks.
    pub areas: Areas,
    /// What hides the road from it.
    pub traffic: Traffic,
}

impl DetectorNoise {
    pub(super) fn check(&self, section: &str) -> Result<(), Outside> {
        let named = |name: &str| format!("{section}.{name}");
        self.view.check(&named("view"))?;
        self.miss.check(&named("miss"))?;
        self.lateral.check(&named("lateral"))?;
        self.clutter.check(&named("clutter"))?;
        self.reading.check(&named("reading"))?;
        self.areas.check(&named("areas"))?;
        self.traffic.check(&named("traffic"))
    }
}

section! {
    /// Where the detector looks, in the vehicle frame, and how often.
    View {
        /// Frames per second.
        rate_hz: f64 = 0.1 to 100.0,
        /// Nearest paint that is seen, in metres ahead.
        near_m: f64 = 0.0 to 50.0,
        /// Farthest.
        far_m: f64 = 1.0 to 300.0,
        /// Farthest to either side, in metres.
        side_m: f64 = 1.0 to 50.0,
        /// Distance between the points of a detection, in metres.
        point_every_m: f64 = 0.02 to 10.0,
        /// Share of the seen lines that is seen at a range: `[metres ahead, share]`. One lot per
        /// detection decides which stretch of it is given.
        reach: Profile = 0.0 to 1.0,
        /// Times per minute that nothing at all is seen.
        blind_per_minute: f64 = 0.0 to 60.0,
        /// How long, in seconds.
        blind_seconds: [f64; 2] = 0.01 to 600.0,
    }
}

section! {
    /// What the detector misses. The probabilities are means over passes: each pass draws its own
    /// from Beta(mean * concentration, (1 - mean) * concentration).
    Miss {
        /// Probability to miss a line in a frame: `[metres to the side, probability]`.
        aside: Profile = 0.0 to 1.0,
        /// How alike passes are: small where some see a line always and others never.
        concentration: f64 = 0.1 to 1000.0,
        /// Seconds that a miss lasts (time constant): the next frames miss the line too.
        seconds: f64 = 0.0 to 60.0,
        /// Times per kilometre that a line is hidden for a while, by whatever it be.
        hidden_per_km: f64 = 0.0 to 100.0,
        /// How long, in metres driven.
        hidden_m: [f64; 2] = 0.0 to 500.0,
        /// What wear adds to the probability where all of the paint is worn off.
        worn: f64 = 0.0 to 1.0,
        /// Probability that a pass still sees erased paint.
        ghost: f64 = 0.0 to 1.0,
    }
}

section! {
    /// How far to the side of the paint detections are. Spreads are standard deviations, straight
    /// between `ahead` (where the vehicle drives) and `aside` (at the view's side).
    Lateral {
        /// Spread within a pass, ahead, in metres.
        ahead_m: f64 = 0.0 to 5.0,
        /// Spread within a pass, at the side.
        aside_m: f64 = 0.0 to 5.0,
        /// Seconds after which 1/e of that is left.
        seconds: f64 = 0.01 to 600.0,
        /// Spread of what stays for a pass, ahead, in metres.
        pass_ahead_m: f64 = 0.0 to 5.0,
        /// Spread of what stays for a pass, at the side.
        pass_aside_m: f64 = 0.0 to 5.0,
        /// What is added to the spread by metre of range: pixels of noise over pixels of focal
        /// length.
        per_metre: f64 = 0.0 to 0.1,
        /// Lateral distances are given times this: mean of all vehicles.
        scale: f64 = 0.5 to 2.0,
        /// Spread of that between vehicles.
        scale_spread: f64 = 0.0 to 0.2,
        /// Metres that all lines are given too far to the left.
        bias_m: f64 = -10.0 to 10.0,
        /// Spread of a line's direction, in degrees, over the same time.
        slope_deg: f64 = 0.0 to 10.0,
        /// Spread of each point, in metres.
        point_m: f64 = 0.0 to 1.0,
    }
}

section! {
    /// What the detector sees where nothing is painted.
    Clutter {
        /// Lines along kerbs, per kilometre of kerb.
        kerb_per_km: f64 = 0.0 to 500.0,
        /// Lines anywhere on the road per kilometre: shadows, seams, wet tracks.
        shadow_per_km: f64 = 0.0 to 500.0,
        /// Second lines beside painted ones, per kilometre driven.
        beside_per_km: f64 = 0.0 to 500.0,
        /// How far beside, in metres.
        beside_m: [f64; 2] = 0.0 to 5.0,
        /// How long all these are, in metres.
        length_m: [f64; 2] = 0.0 to 500.0,
        /// Whether all passes see the same: probability that a pass sees what another saw there.
        shared: f64 = 0.0 to 1.0,
        /// Lines that are there for one frame, per frame.
        flicker_per_frame: f64 = 0.0 to 10.0,
        /// How long these are, in metres.
        flicker_m: [f64; 2] = 0.0 to 50.0,
        /// Share of the frames in which the phantoms below are reported.
        phantom: f64 = 0.0 to 1.0,
        /// Lines that the vehicle reports wherever it drives, in metres to its left.
        phantom_aside_m: Vec<f64> = -50.0 to 50.0,
    }
}

section! {
    /// What the detector takes painted things for.
    Reading {
        /// Probability that a line's marking is not recognised.
        marking_unknown: f64 = 0.0 to 1.0,
        /// Probability that it is taken for another.
        marking_mistaken: f64 = 0.0 to 1.0,
        /// Probability that a colour is not recognised.
        color_unknown: f64 = 0.0 to 1.0,
        /// Probability that it is taken for another.
        color_mistaken: f64 = 0.0 to 1.0,
        /// Probability that a sign's class is not recognised.
        sign_unknown: f64 = 0.0 to 1.0,
        /// Probability that it is taken for another.
        sign_mistaken: f64 = 0.0 to 1.0,
        /// How alike a pass's readings of one thing are: probability that a frame repeats what the
        /// pass read first.
        kept: f64 = 0.0 to 1.0,
    }
}

section! {
    /// How signs, stop lines and crosswalks are seen.
    Areas {
        /// Probability to miss a sign in a frame.
        sign_miss: f64 = 0.0 to 1.0,
        /// Probability to miss a stop line.
        stop_line_miss: f64 = 0.0 to 1.0,
        /// Probability to miss a crosswalk.
        crosswalk_miss: f64 = 0.0 to 1.0,
        /// Spread of the place along the road, in metres.
        along_m: f64 = 0.0 to 10.0,
        /// Spread of the place across it, in metres.
        across_m: f64 = 0.0 to 10.0,
        /// Spread of the direction, in degrees.
        yaw_deg: f64 = 0.0 to 45.0,
        /// False signs per kilometre.
        false_per_km: f64 = 0.0 to 100.0,
    }
}

section! {
    /// Other vehicles, which hide what is behind them.
    Traffic {
        /// Vehicles per kilometre of lane.
        per_lane_km: f64 = 0.0 to 150.0,
        /// How long they are, in metres.
        length_m: [f64; 2] = 1.0 to 25.0,
        /// How wide they are, in metres.
        width_m: [f64; 2] = 0.5 to 4.0,
        /// How much faster or slower than the vehicle they drive, in metres per second (spread).
        speed_spread_m_s: f64 = 0.0 to 30.0,
    }
}
