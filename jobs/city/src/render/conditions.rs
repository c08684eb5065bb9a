//! Light and weather of a picture, by the categories in which lane and sign benchmarks are reported
//! (CULane: Pan et al., 2018; CeyMo: Jayasinghe et al., 2022).

use std::f64::consts::{PI, TAU};

use crate::random::Random;

/// What makes a picture hard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Category {
    /// Daylight, dry, sun from somewhere or clouds.
    Normal,
    /// As normal, with dense traffic.
    Crowded,
    /// A low sun ahead shines into the lens.
    Glare,
    /// A sun ahead above the picture: the road is in the dark, its wear shines.
    Backlight,
    /// Headlights and street lamps.
    Night,
    /// A wet road, drops, spray.
    Rain,
    /// Hard shadows of buildings and trees.
    Shadow,
    /// Fog.
    Fog,
}

impl Category {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Normal,
        Self::Crowded,
        Self::Glare,
        Self::Backlight,
        Self::Night,
        Self::Rain,
        Self::Shadow,
        Self::Fog,
    ];

    /// Its name in files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Crowded => "crowded",
            Self::Glare => "glare",
            Self::Backlight => "backlight",
            Self::Night => "night",
            Self::Rain => "rain",
            Self::Shadow => "shadow",
            Self::Fog => "fog",
        }
    }

    /// The category called `name`, if there is one.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|category| category.name() == name)
    }
}

/// Light and weather. Strengths are relative to a clear day.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// What they are an example of.
    pub category: Category,
    /// Height of the sun above the horizon, in radians.
    pub sun_elevation_rad: f64,
    /// Direction towards the sun, radians counter-clockwise from east.
    pub sun_yaw_rad: f64,
    /// Strength of its direct light, 0 to 1.
    pub sun: f64,
    /// Strength of the sky's light, 0 to 1.
    pub sky: f64,
    /// Share of the sky that is covered by clouds.
    pub clouds: f64,
    /// How wet the road is, 0 to 1.
    pub wet: f64,
    /// How hard it rains, 0 to 1.
    pub rain: f64,
    /// Light lost per metre of air.
    pub haze_per_m: f64,
    /// Share of the sun's light that the lens scatters over the picture.
    pub veil: f64,
    /// Whether headlights and street lamps are lit.
    pub lamps: bool,
    /// How much of the road the trees of the roadside shade: share of places where one stands.
    pub trees: f64,
    /// Seconds for which a row is exposed.
    pub exposure_s: f64,
    /// Standard deviation of the sensor's noise at middle grey, as a share of white.
    pub noise: f64,
    /// Vehicles per kilometre of lane: for whoever places the traffic.
    pub vehicles_per_km: f64,
    /// Whether lens and sensor leave their marks: vignetting, bloom, unsharpness. Off for pictures
    /// that are measured.
    pub lens_marks: bool,
}

impl Conditions {
    /// Even light, a dry road and a perfect sensor: for tests.
    #[must_use]
    pub fn plain() -> Self {
        Self {
            category: Category::Normal,
            sun_elevation_rad: 1.2,
            sun_yaw_rad: 0.0,
            sun: 0.0,
            sky: 1.0,
            clouds: 1.0,
            wet: 0.0,
            rain: 0.0,
            haze_per_m: 0.0,
            veil: 0.0,
            lamps: false,
            trees: 0.0,
            exposure_s: 0.0,
            noise: 0.0,
            vehicles_per_km: 0.0,
            lens_marks: false,
        }
    }

    /// Conditions of a category, drawn by seed, for a vehicle that heads in the direction `yaw_rad`
    /// (radians counter-clockwise from east): glare needs a sun ahead.
    #[must_use]
    pub fn draw(category: Category, yaw_rad: f64, seed: u64) -> Self {
        let mut random = Random::new(seed, category.name(), 0);
        let random = &mut random;
        let day = Self::day(category, random);
        match category {
            Category::Normal => day,
            Category::Crowded => Self {
                vehicles_per_km: random.between(45.0, 80.0),
                ..day
            },
            Category::Glare => day.against_sun(yaw_rad, (0.09, 0.24), 0.3, random),
            Category::Backlight => day.against_sun(yaw_rad, (0.32, 0.6), 0.1, random),
            Category::Shadow => Self {
                sun: random.between(0.9, 1.0),
                clouds: random.between(0.0, 0.25),
                sun_elevation_rad: random.between(0.65, 1.0),
                // From the side, but not right across: houses would shade all of the street.
                sun_yaw_rad: yaw_rad + random.sign() * random.between(0.6, 1.3),
                trees: random.between(0.7, 1.0),
                ..day
            },
            Category::Night => day.night(random),
            Category::Rain => Self {
                wet: random.between(0.6, 1.0),
                rain: random.between(0.3, 1.0),
                haze_per_m: random.between(0.003, 0.008),
                ..day.overcast(random)
            },
            Category::Fog => Self {
                wet: random.between(0.0, 0.35),
                haze_per_m: random.between(0.012, 0.05),
                ..day.overcast(random)
            },
        }
    }

    fn day(category: Category, random: &mut Random) -> Self {
        let clouds = random.between(0.0, 1.0);
        Self {
            category,
            sun_elevation_rad: random.between(0.5, 1.1),
            sun_yaw_rad: random.between(-PI, PI),
            sun: if clouds > 0.75 {
                0.1
            } else {
                1.0 - 0.4 * clouds
            },
            sky: random.between(0.8, 1.0),
            clouds,
            haze_per_m: random.between(0.0006, 0.002),
            veil: 0.02,
            trees: random.between(0.2, 0.6),
            exposure_s: random.between(0.0005, 0.003),
            noise: random.between(0.004, 0.01),
            vehicles_per_km: random.between(4.0, 20.0),
            lens_marks: true,
            ..Self::plain()
        }
    }

    fn against_sun(
        self,
        yaw_rad: f64,
        elevation_rad: (f64, f64),
        veil: f64,
        random: &mut Random,
    ) -> Self {
        Self {
            sun: 1.0,
            clouds: random.between(0.0, 0.4),
            sun_elevation_rad: random.between(elevation_rad.0, elevation_rad.1),
            sun_yaw_rad: (yaw_rad + random.normal(0.1)).rem_euclid(TAU),
            veil: veil * random.between(0.6, 1.3),
            haze_per_m: random.between(0.001, 0.004),
            ..self
        }
    }

    fn overcast(self, random: &mut Random) -> Self {
        Self {
            sun: 0.0,
            sky: random.between(0.5, 0.8),
            clouds: 1.0,
            lamps: random.chance(0.3),
            exposure_s: random.between(0.003, 0.008),
            noise: random.between(0.008, 0.016),
            ..self
        }
    }

    fn night(self, random: &mut Random) -> Self {
        Self {
            sun: 0.0,
            sky: random.between(0.0015, 0.006),
            clouds: random.between(0.3, 1.0),
            lamps: true,
            wet: if random.chance(0.3) { 0.5 } else { 0.0 },
            exposure_s: random.between(0.012, 0.03),
            noise: random.between(0.010, 0.022),
            veil: 0.0,
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_are_repeatable_and_keep_to_their_category() {
        for category in Category::ALL {
            let drawn = Conditions::draw(category, 0.5, 9);
            assert_eq!(drawn, Conditions::draw(category, 0.5, 9));
            assert_ne!(drawn, Conditions::draw(category, 0.5, 10));
            assert_eq!(drawn.category, category);
            assert_eq!(Category::from_name(category.name()), Some(category));
        }
        assert!(Conditions::draw(Category::Night, 0.0, 1).lamps);
        let glare = Conditions::draw(Category::Glare, 0.5, 1);
        assert!((glare.sun_yaw_rad - 0.5).cos() > 0.6);
    }
}
