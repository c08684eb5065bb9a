//! Parameters of what a vehicle measures of itself: position, heading, speed, how its camera is
//! mounted, and what its clocks say.

use super::section::{Drift, section};

section! {
    /// The receiver. Spreads are standard deviations of one horizontal axis.
    GnssNoise {
        /// Fixes per second.
        rate_hz: f64 = 0.1 to 100.0,
        /// Spread of the error that stays for a drive, in metres.
        bias_m: f64 = 0.0 to 20.0,
        /// Parts of the error that drift, in metres.
        drift: Vec<Drift> = 0.0 to 20.0,
        /// Spread of the part that is new with every fix, in metres.
        white_m: f64 = 0.0 to 5.0,
        /// Heights are worse by this factor.
        height_factor: f64 = 0.0 to 10.0,
        /// How old positions are when they are stamped, in seconds: mean of all receivers.
        delay_s: f64 = -2.0 to 2.0,
        /// Spread of that between drives, in seconds.
        delay_spread_s: f64 = 0.0 to 1.0,
        /// How it wavers from fix to fix, in seconds.
        delay_drift: Vec<Drift> = 0.0 to 1.0,
        /// Times per minute that positions come late, or hang, for a moment.
        stalls_per_minute: f64 = 0.0 to 60.0,
        /// How old a position is then, in seconds: least and most, with a Pareto distribution of
        /// exponent 1.2 between them.
        stall_s: [f64; 2] = 0.001 to 60.0,
        /// How long that lasts, in seconds: least and most, logarithms being uniform.
        stall_seconds: [f64; 2] = 0.001 to 60.0,
        /// Multipath jumps per minute under an open sky.
        jumps_per_minute: f64 = 0.0 to 60.0,
        /// Multipath jumps per minute between buildings.
        jumps_near_buildings_per_minute: f64 = 0.0 to 60.0,
        /// How far it jumps, in metres.
        jump_m: [f64; 2] = 0.0 to 50.0,
        /// How long it stays there, in seconds.
        jump_seconds: [f64; 2] = 0.01 to 300.0,
        /// Times per minute that there is no fix under an open sky.
        outages_per_minute: f64 = 0.0 to 60.0,
        /// Times per minute that there is no fix between buildings.
        outages_near_buildings_per_minute: f64 = 0.0 to 60.0,
        /// How long there is none, in seconds.
        outage_seconds: [f64; 2] = 0.01 to 600.0,
        /// Share of fixes that are those before them, once more.
        repeated: f64 = 0.0 to 1.0,
        /// What receivers claim of a horizontal axis, in metres (1 sigma); heights by the factor
        /// above.
        claimed_m: f64 = 0.001 to 100.0,
    }
}

section! {
    /// The inertial sensor.
    ImuNoise {
        /// Messages per second.
        rate_hz: f64 = 0.1 to 1000.0,
        /// Spread of the heading's error that stays for a drive, in degrees.
        yaw_bias_deg: f64 = 0.0 to 45.0,
        /// Parts of it that drift, in degrees.
        yaw_drift: Vec<Drift> = 0.0 to 45.0,
        /// Spread of the part that is new with every message, in degrees.
        yaw_white_deg: f64 = 0.0 to 10.0,
        /// Spread of the yaw rate's error that stays for a drive, in degrees per second.
        rate_bias_deg_s: f64 = 0.0 to 5.0,
        /// Spread of the part that is new with every message, in degrees per second.
        rate_white_deg_s: f64 = 0.0 to 20.0,
        /// What sensors claim of their yaw, in degrees (1 sigma).
        claimed_yaw_deg: f64 = 0.001 to 90.0,
    }
}

section! {
    /// The wheels' speed.
    WheelNoise {
        /// Messages per second; 0: none.
        rate_hz: f64 = 0.0 to 1000.0,
        /// Spread of the scale between vehicles: 0.01 is 1 %.
        scale_spread: f64 = 0.0 to 0.2,
        /// Spread of the part that is new with every message, in metres per second.
        white_m_s: f64 = 0.0 to 2.0,
    }
}

section! {
    /// The camera of the camera profile.
    CameraNoise {
        /// Pictures per second.
        rate_hz: f64 = 0.01 to 100.0,
    }
}

section! {
    /// How a camera is really mounted, against what its calibration says; and the body on its
    /// springs.
    MountingNoise {
        /// Spread of the roll between vehicles, in degrees.
        roll_deg: f64 = 0.0 to 5.0,
        /// Spread of the pitch, in degrees.
        pitch_deg: f64 = 0.0 to 5.0,
        /// Spread of the yaw, in degrees.
        yaw_deg: f64 = 0.0 to 5.0,
        /// Spread of the position on each axis, in metres.
        position_m: f64 = 0.0 to 1.0,
        /// How the body rolls while driving, in degrees.
        body_roll: Vec<Drift> = 0.0 to 5.0,
        /// How it pitches, in degrees.
        body_pitch: Vec<Drift> = 0.0 to 5.0,
    }
}

section! {
    /// The camera's clock against the receiver's.
    ClockNoise {
        /// Seconds that detections are stamped late (they show what was there before): mean of all
        /// drives.
        offset_s: f64 = -60.0 to 60.0,
        /// Spread between drives, in seconds; it stays for a drive.
        offset_spread_s: f64 = 0.0 to 30.0,
    }
}
