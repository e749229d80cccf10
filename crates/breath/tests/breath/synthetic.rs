//! Traces with known amplitude, period, level and drift.

use std::f64::consts::PI;

use needlebench_breath::{Recording, Samples};
use needlebench_numerics::random::SplitMix64;

/// What a trace is made by.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    /// Mean and variation of lognormal amplitudes.
    pub amplitude_m: f64,
    pub amplitude_cv: f64,
    /// Correlation of the logarithm of each with the next.
    pub amplitude_correlation: f64,
    /// Mean and variation of lognormal periods.
    pub period_s: f64,
    pub period_cv: f64,
    pub drift_m_per_s: f64,
    /// Standard deviation that the level gains in a second, and that of each end of expiration alone.
    pub walk_m: f64,
    pub alone_m: f64,
}

/// Quiet breathing with all that makes it irregular.
pub const QUIET: Law = Law {
    amplitude_m: 0.012,
    amplitude_cv: 0.15,
    amplitude_correlation: 0.0,
    period_s: 5.5,
    period_cv: 0.12,
    drift_m_per_s: 1e-5,
    walk_m: 1e-4,
    alone_m: 3e-4,
};

/// The same breath again and again.
pub const REGULAR: Law = Law {
    amplitude_cv: 0.0,
    period_cv: 0.0,
    drift_m_per_s: 0.0,
    walk_m: 0.0,
    alone_m: 0.0,
    ..QUIET
};

/// A lognormal variable of this mean and variation, by a standard normal one.
fn lognormal(normal: f64, mean: f64, cv: f64) -> f64 {
    let variance = libm::log1p(cv * cv);
    mean * libm::exp(variance.sqrt() * normal - 0.5 * variance)
}

impl Law {
    /// Displacement at 10 Hz: from one end of expiration to the next half a wave, which is level at both, and sin^4
    /// upon it. The lowest samples are the ends.
    pub fn displacement_m(&self, duration_s: f64, seed: u64) -> Vec<f64> {
        let mut random = SplitMix64::new(seed);
        // The first end is before the trace.
        let mut start_s = -self.period_s * random.open_unit();
        let mut walk_m = 0.0;
        let mut normal = random.standard_normal();
        let mut end_m = |random: &mut SplitMix64, time_s: f64, gone_s: f64| {
            walk_m += self.walk_m * gone_s.sqrt() * random.standard_normal();
            walk_m + self.alone_m * random.standard_normal() + self.drift_m_per_s * time_s
        };
        let mut start_m = end_m(&mut random, start_s, 0.0);
        let (mut samples, mut count) = (Vec::new(), 0_u32);
        loop {
            let rho = self.amplitude_correlation;
            normal = rho * normal + (1.0 - rho * rho).sqrt() * random.standard_normal();
            let amplitude_m = lognormal(normal, self.amplitude_m, self.amplitude_cv);
            let period_s = lognormal(random.standard_normal(), self.period_s, self.period_cv);
            let next_m = end_m(&mut random, start_s + period_s, period_s);
            loop {
                let time_s = 0.1 * f64::from(count);
                let phase = (time_s - start_s) / period_s;
                if time_s > duration_s {
                    return samples;
                }
                if phase >= 1.0 {
                    break;
                }
                let sine = libm::sin(PI * phase);
                let way = 0.5 - 0.5 * libm::cos(PI * phase);
                samples.push(start_m + (next_m - start_m) * way + amplitude_m * sine.powi(4));
                count += 1;
            }
            start_s += period_s;
            start_m = next_m;
        }
    }

    pub fn recording(&self, duration_s: f64, seed: u64) -> Recording {
        Recording::from_samples("made", along(&self.displacement_m(duration_s, seed), 0.1)).unwrap()
    }
}

/// Samples of a marker that moves along one direction somewhere in the room.
pub fn along(displacement_m: &[f64], step_s: f64) -> Samples {
    let direction = [0.36, -0.48, 0.8];
    let place = [0.25, -1.1, 0.4];
    let position = |length: &f64| [0, 1, 2].map(|axis| place[axis] + length * direction[axis]);
    Samples {
        times_s: (0..displacement_m.len())
            .map(|count| step_s * count as f64)
            .collect(),
        positions_m: displacement_m.iter().map(position).collect(),
        ..Samples::default()
    }
}
