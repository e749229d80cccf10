//! Where the breath has chest wall and lung while the needle goes in.

use nalgebra::Vector3;

use crate::error::LawError;

/// What a structure moves with while the patient breathes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Body {
    /// The chest wall: skin, bones, intercostal vessels.
    Wall,
    /// The lung: its vessels and fissures, and the lesion.
    Lung,
}

impl Body {
    pub(crate) fn index(self) -> usize {
        match self {
            Self::Wall => 0,
            Self::Lung => 1,
        }
    }
}

/// One state of the breath, and how likely it is. Vectors are displacements of chest wall and lung, in this order, from
/// where they were planned, in the frame of the needle, m.
///
/// Amplitudes that differ between patients are several states, each with its share of the weight.
#[derive(Debug, Clone, PartialEq)]
pub struct Hold {
    /// Probability of the state, 0 to 1.
    pub weight: f64,
    /// One standard deviation of the level that the breath is held at, which is normal about 0; the same variable for
    /// both.
    pub level_sd_m: [Vector3<f64>; 2],
    /// Mean drift while it is held.
    pub drift_m: [Vector3<f64>; 2],
    /// One standard deviation of the drift, which is normal; the same variable for both.
    pub drift_sd_m: [Vector3<f64>; 2],
    /// Of a failed hold, displacement at a full breath: it is this times sin^4(pi u) of a uniform phase u (Lujan 1999).
    pub failed_m: Option<[Vector3<f64>; 2]>,
}

impl Hold {
    /// Nothing moves.
    pub fn still(weight: f64) -> Self {
        let none = [Vector3::zeros(); 2];
        Self {
            weight,
            level_sd_m: none,
            drift_m: none,
            drift_sd_m: none,
            failed_m: None,
        }
    }

    /// Displacement of both bodies for values of level and drift, and `fullness` of a breath, 0 to 1.
    pub(crate) fn displacement_m(
        &self,
        level: f64,
        drift: f64,
        fullness: f64,
    ) -> [Vector3<f64>; 2] {
        std::array::from_fn(|body| {
            let held =
                self.level_sd_m[body] * level + self.drift_m[body] + self.drift_sd_m[body] * drift;
            match &self.failed_m {
                Some(full) => held + full[body] * fullness,
                None => held,
            }
        })
    }

    /// Level, drift about its mean and failed holds so many times as large.
    pub(crate) fn larger(&self, factor: f64) -> Self {
        let larger = |vectors: &[Vector3<f64>; 2]| vectors.map(|each| each * factor);
        Self {
            weight: self.weight,
            level_sd_m: larger(&self.level_sd_m),
            drift_m: self.drift_m,
            drift_sd_m: larger(&self.drift_sd_m),
            failed_m: self.failed_m.as_ref().map(larger),
        }
    }

    pub(crate) fn has_spread(&self) -> bool {
        let vectors = self.level_sd_m.iter().chain(&self.drift_sd_m);
        let mut all = vectors.chain(self.failed_m.iter().flatten());
        all.any(|vector| vector.norm() > 0.0)
    }

    fn is_finite(&self) -> bool {
        let vectors = self.level_sd_m.iter().chain(&self.drift_sd_m);
        let mut all = vectors
            .chain(&self.drift_m)
            .chain(self.failed_m.iter().flatten());
        all.all(|vector| vector.iter().all(|each| each.is_finite()))
    }
}

/// States with sound weights.
pub(crate) fn check(holds: &[Hold]) -> Result<(), LawError> {
    /// Of a sum of weights that were written with ten digits.
    const ROUNDING: f64 = 1e-9;
    for (state, hold) in holds.iter().enumerate() {
        if !(0.0..=1.0).contains(&hold.weight) {
            return Err(LawError::Weight {
                state,
                weight: hold.weight,
            });
        }
        if !hold.is_finite() {
            return Err(LawError::Breath { state });
        }
    }
    let sum: f64 = holds.iter().map(|hold| hold.weight).sum();
    if (sum - 1.0).abs() > ROUNDING {
        return Err(LawError::Weights { sum });
    }
    Ok(())
}
