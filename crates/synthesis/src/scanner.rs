//! What a scanner makes of a scene, effect by effect.

use serde::Serialize;

use needlebench_volume::VolumeError;

/// How the sensitivity of a slice falls off along its normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SliceProfile {
    /// All of the slice's thickness alike: sequential scans.
    Box,
    /// A Gaussian whose full width at half maximum is the thickness, cut off at 1.25 thicknesses: spiral scans.
    Bell,
}

/// The reconstruction kernel as users know it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// For soft tissue.
    Smooth,
    /// For lung and bone.
    Sharp,
}

/// What the kernel adds along edges.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Overshoot {
    /// Share of the edge's height that is added and taken away beside it, before the blur: the image plus this share
    /// of its difference from itself blurred further.
    pub share: f64,
    /// Standard deviation of that further blur, m.
    pub sigma_m: f64,
}

/// Noise of the image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Noise {
    /// Standard deviation in the middle of the circle at a thickness of 1 mm and dose 1, HU.
    pub sd_hu: f64,
    /// Share of it at the circle's rim, falling with the square of the distance from the middle.
    pub rim_share: f64,
    /// Dose, of that which gives `sd_hu`.
    pub dose: f64,
    /// Width of its grain, m: its amplitude spectrum in the slice is proportional to g(f) - 0.8 g(2 f), with
    /// g(f) = exp(-2 (pi sigma f)^2).
    pub grain_sigma_m: f64,
}

/// Dark and bright streaks that the polychromatic beam leaves about dense parts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Streaks {
    /// What is denser than this hardens the beam, HU.
    pub above_hu: f64,
    /// Share of its attenuation that a ray misses for each unit of attenuation (line integral) by what is dense.
    pub share: f64,
}

/// A scanner's settings. Every effect can be switched off; [`Scanner::ideal`] has none but the slice's thickness.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scanner {
    /// Extent of what one slice integrates over along its normal, m.
    pub slice_thickness_m: f64,
    /// How it weighs that.
    pub slice_profile: SliceProfile,
    /// Standard deviation of the Gaussian blur in the slice, m; 0: each pixel is the mean over its own area.
    pub psf_sigma_m: f64,
    /// Edge enhancement, if there is any.
    pub overshoot: Option<Overshoot>,
    /// Noise, if there is any.
    pub noise: Option<Noise>,
    /// Streaks about metal, if there are any.
    pub streaks: Option<Streaks>,
    /// Least and greatest value that is stored, HU.
    pub range_hu: [i16; 2],
    /// Whether what is outside the circle within the image is not seen. It is air in a [`needlebench_volume::Volume`].
    pub has_circle: bool,
}

/// Slices as people order them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScanPreset {
    /// 1 mm every 1 mm.
    Thin,
    /// 2.5 mm every 2.5 mm.
    Biopsy,
    /// 5 mm every 5 mm.
    Thick,
    /// 5 mm every 2.5 mm.
    ThickOverlap,
}

impl ScanPreset {
    /// Thickness of the slices and distance between them, m.
    pub fn thickness_and_increment_m(self) -> [f64; 2] {
        match self {
            Self::Thin => [1e-3, 1e-3],
            Self::Biopsy => [2.5e-3, 2.5e-3],
            Self::Thick => [5e-3, 5e-3],
            Self::ThickOverlap => [5e-3, 2.5e-3],
        }
    }
}

impl Kernel {
    /// Standard deviation of the blur in the slice, m. Assumed: half widths of 1.3 and 0.7 mm, the order of the 50 % points
    /// of published modulation transfer functions of soft-tissue and lung kernels.
    pub fn psf_sigma_m(self) -> f64 {
        match self {
            Self::Smooth => 0.55e-3,
            Self::Sharp => 0.3e-3,
        }
    }

    /// Noise in the middle at 1 mm and dose 1, HU. Assumed: a diagnostic chest scan, and 2.5 times that for a sharp kernel.
    fn noise_hu(self) -> f64 {
        match self {
            Self::Smooth => 20.0,
            Self::Sharp => 50.0,
        }
    }
}

impl Noise {
    /// Of a kernel at dose 1; 70 % of it at the rim (assumed), grain as wide as the kernel's blur.
    pub fn of(kernel: Kernel) -> Self {
        Self {
            sd_hu: kernel.noise_hu(),
            rim_share: 0.7,
            dose: 1.0,
            grain_sigma_m: kernel.psf_sigma_m(),
        }
    }

    /// Standard deviation in the middle of a slice, HU: with the root of the photons that it is made from.
    pub fn in_middle_hu(&self, slice_thickness_m: f64) -> f64 {
        /// Thickness that `sd_hu` is for, m.
        const REFERENCE_M: f64 = 1e-3;
        self.sd_hu * (REFERENCE_M / (slice_thickness_m * self.dose)).sqrt()
    }
}

impl Overshoot {
    /// Of edge-enhancing kernels (assumed).
    pub const USUAL: Self = Self {
        share: 0.3,
        sigma_m: 0.8e-3,
    };
}

impl Streaks {
    /// Assumed: a tenth of its attenuation per unit.
    pub const USUAL: Self = Self {
        above_hu: 2500.0,
        share: 0.1,
    };
}

impl Scanner {
    /// What 12-bit scanners store.
    pub(crate) const RANGE_HU: [i16; 2] = [-1024, 3071];

    /// With blur, noise, clipping and circle; without overshoot and streaks.
    pub fn new(slice_thickness_m: f64, kernel: Kernel) -> Self {
        Self {
            slice_thickness_m,
            slice_profile: SliceProfile::Box,
            psf_sigma_m: kernel.psf_sigma_m(),
            overshoot: None,
            noise: Some(Noise::of(kernel)),
            streaks: None,
            range_hu: Self::RANGE_HU,
            has_circle: true,
        }
    }

    /// Refuses settings that mean nothing.
    pub(super) fn check(&self) -> Result<(), VolumeError> {
        let positive = |name: &str, value: f64, unit: &str| {
            if value.is_finite() && value > 0.0 {
                return Ok(());
            }
            let message = format!("{name} is {value} {unit}, but must be above 0");
            Err(VolumeError::refused(message))
        };
        let at_least_0 = |name: &str, value: f64, unit: &str| {
            if value.is_finite() && value >= 0.0 {
                return Ok(());
            }
            let message = format!("{name} is {value} {unit}, but must be 0 or more");
            Err(VolumeError::refused(message))
        };
        positive("slice thickness", 1e3 * self.slice_thickness_m, "mm")?;
        at_least_0("blur in the slice", 1e3 * self.psf_sigma_m, "mm")?;
        if let Some(overshoot) = &self.overshoot {
            at_least_0("overshoot", overshoot.share, "of the edge")?;
            positive("width of the overshoot", 1e3 * overshoot.sigma_m, "mm")?;
        }
        if let Some(streaks) = &self.streaks {
            positive(
                "density from which on there are streaks",
                streaks.above_hu,
                "HU",
            )?;
            at_least_0(
                "what streaks are made of",
                streaks.share,
                "of the attenuation",
            )?;
        }
        if let Some(noise) = &self.noise {
            at_least_0("noise", noise.sd_hu, "HU")?;
            at_least_0("noise at the rim", noise.rim_share, "of that in the middle")?;
            positive("dose", noise.dose, "of the usual one")?;
            positive("grain of the noise", 1e3 * noise.grain_sigma_m, "mm")?;
        }
        Ok(())
    }

    /// Means over voxels, rounded: no blur, no noise, no circle, nothing clipped.
    pub fn ideal(slice_thickness_m: f64) -> Self {
        Self {
            slice_thickness_m,
            slice_profile: SliceProfile::Box,
            psf_sigma_m: 0.0,
            overshoot: None,
            noise: None,
            streaks: None,
            range_hu: [i16::MIN, i16::MAX],
            has_circle: false,
        }
    }
}
