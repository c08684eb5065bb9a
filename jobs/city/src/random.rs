//! Lots, drawn from named streams: what one part of the city draws does not shift what another
//! draws.

use std::f64::consts::TAU;

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use tilefold_schemas::id::hash_text;

/// One stream of lots.
#[derive(Debug, Clone)]
pub struct Random {
    generator: Pcg64Mcg,
}

impl Random {
    /// The stream called `name` with number `index`, of the city with this seed.
    #[must_use]
    pub fn new(seed: u64, name: &str, index: u32) -> Self {
        let stream = hash_text(&format!("{seed} {name} {index}"));
        Self {
            generator: Pcg64Mcg::seed_from_u64(stream.cast_unsigned()),
        }
    }

    /// Uniform in `[0, 1)`, with 53 bits.
    pub fn unit(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in `[from, to)`.
    pub fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.unit()
    }

    /// Normal with mean 0 (Box and Muller, 1958).
    pub fn normal(&mut self, sigma: f64) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        sigma * radius * (TAU * self.unit()).cos()
    }

    /// Exponential with this mean.
    pub fn exponential(&mut self, mean: f64) -> f64 {
        -mean * (1.0 - self.unit()).ln()
    }

    /// A whole number with this mean: the one below it or the one above.
    pub fn count(&mut self, mean: f64) -> usize {
        mean as usize + usize::from(self.chance(mean.fract()))
    }

    /// Beta-distributed with this mean; the larger the concentration, the closer to it. A mean of 0
    /// or 1 has no spread.
    pub fn beta(&mut self, mean: f64, concentration: f64) -> f64 {
        if mean <= 0.0 || mean >= 1.0 {
            return mean.clamp(0.0, 1.0);
        }
        let hits = self.gamma(mean * concentration);
        let misses = self.gamma((1.0 - mean) * concentration);
        // Both can underflow to 0 where the concentration is tiny: then it is one end or the other.
        match hits + misses {
            0.0 => f64::from(u8::from(self.chance(mean))),
            sum => hits / sum,
        }
    }

    /// Gamma-distributed with scale 1 (Marsaglia and Tsang, 2000).
    fn gamma(&mut self, shape: f64) -> f64 {
        if shape < 1.0 {
            let lot = (1.0 - self.unit()).powf(1.0 / shape);
            return self.gamma(shape + 1.0) * lot;
        }
        let d = shape - 1.0 / 3.0;
        loop {
            let x = self.normal(1.0);
            let v = (1.0 + x / (9.0 * d).sqrt()).powi(3);
            if v > 0.0 && (1.0 - self.unit()).ln() < 0.5 * x * x + d - d * v + d * v.ln() {
                return d * v;
            }
        }
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// Uniform in `0..count`; 0 if there is nothing to choose from.
    pub fn index(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// -1 or 1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// Any order of `items`, each as likely as any other.
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.index(last + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_repeatable_and_apart() {
        let first = |name, index| Random::new(7, name, index).unit();
        assert_eq!(first("a", 0), first("a", 0));
        assert_ne!(first("a", 0), first("a", 1));
        assert_ne!(first("a", 0), first("b", 0));
    }

    #[test]
    fn normal_lots_have_their_mean_and_spread() {
        let mut random = Random::new(1, "normal", 0);
        let lots: Vec<f64> = (0..20_000).map(|_| random.normal(2.0)).collect();
        let mean = lots.iter().sum::<f64>() / 20_000.0;
        let variance = lots.iter().map(|lot| lot * lot).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.05, "{mean}");
        assert!((variance - 4.0).abs() < 0.15, "{variance}");
    }

    #[test]
    fn beta_lots_have_their_mean_and_spread() {
        let mut random = Random::new(1, "beta", 0);
        for (mean, concentration) in [(0.2, 2.0), (0.7, 20.0), (0.5, 0.5)] {
            let lots: Vec<f64> = (0..20_000)
                .map(|_| random.beta(mean, concentration))
                .collect();
            let found = lots.iter().sum::<f64>() / 20_000.0;
            let squares = lots.iter().map(|lot| (lot - mean).powi(2)).sum::<f64>() / 20_000.0;
            let variance = mean * (1.0 - mean) / (concentration + 1.0);
            assert!((found - mean).abs() < 0.012, "{mean}: {found}");
            assert!(
                (squares / variance - 1.0).abs() < 0.05,
                "{variance}: {squares}"
            );
        }
        assert_eq!([0.0, 1.0].map(|mean| random.beta(mean, 2.0)), [0.0, 1.0]);
    }
}
