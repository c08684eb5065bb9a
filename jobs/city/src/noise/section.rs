//! Sections of a parameter file: numbers with their limits, stated once for reading, checking and
//! documentation.

use serde::Deserialize;

/// A number outside of its limits.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outside {
    /// The key as the file has it, with its sections.
    pub(crate) key: String,
    pub(crate) value: f64,
    pub(crate) least: f64,
    pub(crate) most: f64,
}

/// A part of an error that forgets itself over time (a Gauss-Markov process of first order).
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drift {
    /// Spread over long times, in the unit of what drifts.
    pub sigma: f64,
    /// Seconds after which 1/e of it is left; 0.01 to 10,000.
    pub seconds: f64,
}

/// What can be held against limits.
pub(crate) trait Limited {
    /// Refuses what is not in `least..=most`; `key` names it.
    fn check(&self, key: &str, least: f64, most: f64) -> Result<(), Outside>;
}

impl Limited for f64 {
    fn check(&self, key: &str, least: f64, most: f64) -> Result<(), Outside> {
        if (least..=most).contains(self) {
            return Ok(());
        }
        Err(Outside {
            key: key.to_owned(),
            value: *self,
            least,
            most,
        })
    }
}

/// From and to.
impl Limited for [f64; 2] {
    fn check(&self, key: &str, least: f64, most: f64) -> Result<(), Outside> {
        self[0].check(&format!("{key}[0]"), least, most)?;
        self[1].check(&format!("{key}[1]"), self[0], most)
    }
}

impl Limited for Vec<Drift> {
    fn check(&self, key: &str, least: f64, most: f64) -> Result<(), Outside> {
        for (index, drift) in self.iter().enumerate() {
            let key = format!("{key}[{index}]");
            drift.sigma.check(&format!("{key}.sigma"), least, most)?;
            drift.seconds.check(&format!("{key}.seconds"), 0.01, 1e4)?;
        }
        Ok(())
    }
}

impl Limited for Vec<f64> {
    fn check(&self, key: &str, least: f64, most: f64) -> Result<(), Outside> {
        let mut values = self.iter().enumerate();
        values.try_for_each(|(index, value)| value.check(&format!("{key}[{index}]"), least, most))
    }
}

/// Probability by distance: straight between the points given, level outside of them.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(transparent)]
pub struct Profile(Vec<[f64; 2]>);

impl Profile {
    /// The probability at a distance in metres.
    #[must_use]
    pub fn at(&self, distance_m: f64) -> f64 {
        let after = self.0.partition_point(|point| point[0] <= distance_m);
        match (after.checked_sub(1).map(|i| self.0[i]), self.0.get(after)) {
            (Some([x0, y0]), Some([x1, y1])) => y0 + (y1 - y0) * (distance_m - x0) / (x1 - x0),
            (Some([_, y]), None) | (None, Some(&[_, y])) => y,
            (None, None) => 0.0,
        }
    }
}

/// Distances 0 to 300 m, each beyond the one before; the limits are those of the probabilities.
impl Limited for Profile {
    fn check(&self, key: &str, least: f64, most: f64) -> Result<(), Outside> {
        let mut last_m = 0.0;
        for (index, [distance_m, value]) in self.0.iter().enumerate() {
            distance_m.check(&format!("{key}[{index}][0]"), last_m, 300.0)?;
            value.check(&format!("{key}[{index}][1]"), least, most)?;
            last_m = distance_m + 1e-6;
        }
        Ok(())
    }
}

/// A section's fields, each with its limits.
macro_rules! section {
    ($(#[$about:meta])* $name:ident {
        $($(#[$doc:meta])* $field:ident: $kind:ty = $least:literal to $most:literal,)*
    }) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $(
                $(#[$doc])*
                #[doc = concat!("\n\nLimits: ", $least, " to ", $most, ".")]
                pub $field: $kind,
            )*
        }

        impl $name {
            /// Refuses the first field outside of its limits; `section` is the section's name.
            pub(crate) fn check(&self, section: &str) -> Result<(), $crate::noise::section::Outside> {
                use $crate::noise::section::Limited;
                $(
                    let key = format!("{section}.{}", stringify!($field));
                    self.$field.check(&key, f64::from($least), f64::from($most))?;
                )*
                Ok(())
            }
        }
    };
}

pub(crate) use section;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_straight_between_its_points_and_level_outside() {
        let profile = Profile(vec![[1.0, 0.2], [3.0, 0.6]]);
        let at = [0.0, 1.0, 2.0, 3.0, 9.0].map(|x| profile.at(x));
        assert_eq!(
            at.map(|y| (y * 1e9).round() / 1e9),
            [0.2, 0.2, 0.4, 0.6, 0.6]
        );
        assert!(
            Profile(vec![[2.0, 0.1], [1.0, 0.1]])
                .check("p", 0.0, 1.0)
                .is_err()
        );
    }

    #[test]
    fn what_is_not_a_number_is_outside() {
        assert!(f64::NAN.check("x", 0.0, 1.0).is_err());
        assert!([0.5, 0.2].check("x", 0.0, 1.0).is_err());
    }
}
