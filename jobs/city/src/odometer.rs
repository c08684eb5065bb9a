//! What a vehicle says of its own way: wheels count it, a gyro of theirs turns it, and both are
//! summed up from where the vehicle was switched on.

use tilefold_schemas::log::{FramePose, Odometry, Quaternion};

use crate::course::Course;
use crate::inertial::{Inertial, Wheels};

/// Over how long wheels are counted for a speed, in seconds.
const COUNTED_S: f64 = 0.02;

/// Dead reckoning of one leg.
pub(crate) struct Odometer {
    wheels: Wheels,
    gyro: Inertial,
    /// In the frame `odom`, metres and radians.
    at_m: [f64; 2],
    yaw_rad: f64,
    /// What was measured last: metres per second, radians per second.
    last: Option<(f64, f64)>,
}

impl Odometer {
    /// Stands at the origin of its frame.
    pub(crate) fn new(wheels: Wheels, gyro: Inertial) -> Self {
        Self {
            wheels,
            gyro,
            at_m: [0.0; 2],
            yaw_rad: 0.0,
            last: None,
        }
    }

    /// What it says `seconds` after the leg's begin, `period_s` after it spoke last.
    pub(crate) fn measure(&mut self, course: &Course, seconds: f64, period_s: f64) -> Odometry {
        let speed_m_s = self.wheels.measured_m_s(rolled_m_s(course, seconds));
        let rate_rad_s = course.motion(seconds).yaw_rate_rad_s + self.gyro.yaw_rate_error_rad_s();
        if let Some((last_m_s, last_rad_s)) = self.last.replace((speed_m_s, rate_rad_s)) {
            self.go(
                0.5 * (last_m_s + speed_m_s) * period_s,
                0.5 * (last_rad_s + rate_rad_s) * period_s,
            );
        }
        let [east, north] = self.at_m;
        Odometry {
            pose: FramePose {
                position_m: [east, north, 0.0],
                orientation: about_up(self.yaw_rad),
            },
            linear_velocity_m_s: [speed_m_s, 0.0, 0.0],
            angular_velocity_rad_s: [0.0, 0.0, rate_rad_s],
        }
    }

    /// Along an arc.
    fn go(&mut self, way_m: f64, turn_rad: f64) {
        // Whoever stands does not turn: what the gyro says then is its bias.
        if way_m == 0.0 {
            return;
        }
        let (sin, cos) = (self.yaw_rad + 0.5 * turn_rad).sin_cos();
        self.at_m[0] += way_m * cos;
        self.at_m[1] += way_m * sin;
        self.yaw_rad += turn_rad;
    }
}

/// The speed at which wheels really turn, in metres per second: along the slope and the bends.
fn rolled_m_s(course: &Course, seconds: f64) -> f64 {
    let from = course.point(course.station_m(seconds - COUNTED_S));
    let to = course.point(course.station_m(seconds));
    let square: f64 = (0..3).map(|axis| (to[axis] - from[axis]).powi(2)).sum();
    square.sqrt() / COUNTED_S
}

/// A turn to the left about the up axis.
pub(crate) fn about_up(yaw_rad: f64) -> Quaternion {
    let (sin, cos) = (yaw_rad / 2.0).sin_cos();
    [0.0, 0.0, sin, cos]
}
