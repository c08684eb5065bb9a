//! Constant-velocity Kalman filters, one number each: the numbers of a state do not move each other.

/// A number with its rate, and what is known of both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Filter {
    pub(crate) value: f64,
    rate: f64,
    /// Variances of value and rate, and their covariance.
    variance: f64,
    rate_variance: f64,
    covariance: f64,
}

/// How a number behaves, as standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Behaviour {
    /// Of one measurement.
    pub(crate) measured: f64,
    /// Of the rate of something new, a second.
    pub(crate) rate: f64,
    /// Of the rate's change within a second.
    pub(crate) change: f64,
}

impl Filter {
    /// What was measured once.
    pub(crate) fn new(value: f64, behaviour: &Behaviour) -> Self {
        Self {
            value,
            rate: 0.0,
            variance: behaviour.measured.powi(2),
            rate_variance: behaviour.rate.powi(2),
            covariance: 0.0,
        }
    }

    /// Where it is `seconds` later (white noise on the acceleration).
    pub(crate) fn predict(&mut self, seconds: f64, behaviour: &Behaviour) {
        let noise = behaviour.change.powi(2) * seconds;
        self.value += self.rate * seconds;
        self.variance += seconds * (2.0 * self.covariance + seconds * self.rate_variance)
            + noise * seconds.powi(2) / 3.0;
        self.covariance += seconds * self.rate_variance + noise * seconds / 2.0;
        self.rate_variance += noise;
    }

    /// Squared Mahalanobis distance of a measurement.
    pub(crate) fn distance2(&self, measured: f64, behaviour: &Behaviour) -> f64 {
        (measured - self.value).powi(2) / (self.variance + behaviour.measured.powi(2))
    }

    /// What is known after a measurement.
    pub(crate) fn update(&mut self, measured: f64, behaviour: &Behaviour) {
        let innovation = measured - self.value;
        let total = self.variance + behaviour.measured.powi(2);
        let (gain, rate_gain) = (self.variance / total, self.covariance / total);
        self.value += gain * innovation;
        self.rate += rate_gain * innovation;
        self.rate_variance -= rate_gain * self.covariance;
        self.covariance *= 1.0 - gain;
        self.variance *= 1.0 - gain;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEHAVIOUR: Behaviour = Behaviour {
        measured: 2.0,
        rate: 50.0,
        change: 5.0,
    };

    #[test]
    fn a_steady_motion_is_foreseen() {
        let mut filter = Filter::new(10.0, &BEHAVIOUR);
        for frame in 1..40 {
            filter.predict(0.1, &BEHAVIOUR);
            filter.update(10.0 + 3.0 * f64::from(frame), &BEHAVIOUR);
        }
        filter.predict(0.1, &BEHAVIOUR);
        assert!((filter.value - 130.0).abs() < 0.2, "{filter:?}");
        assert!(filter.distance2(130.0, &BEHAVIOUR) < 0.1);
        assert!(filter.distance2(145.0, &BEHAVIOUR) > 3.84);
    }

    #[test]
    fn what_is_not_seen_gets_vague() {
        let mut filter = Filter::new(0.0, &BEHAVIOUR);
        filter.predict(0.1, &BEHAVIOUR);
        let soon = filter.distance2(30.0, &BEHAVIOUR);
        filter.predict(1.0, &BEHAVIOUR);
        assert!(filter.distance2(30.0, &BEHAVIOUR) < soon);
    }
}
