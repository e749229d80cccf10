//! The needle as a beam, in air or in tissue.

use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock};

use needlebench_cell::Tool;
use needlebench_input::{Finding, Location, ModelSource, TomlText, from_toml, source_of};
use needlebench_insertion::{
    Bevel, Factor, Guide, Holder, Insertion, InsertionError, Layers, LayersError, MODEL, Needle,
    Point, Slip, Tissue,
};
use needlebench_phantom::PassedLayer;
use serde::Deserialize;

use crate::scenario::{NeedleBlock, NeedleModel, NeedleTip, SIDE_FORCE_N, TurnAt};

/// Bending of the needle.
#[derive(Debug, Clone, PartialEq)]
pub enum NeedleBending {
    /// In air.
    Cantilever(Cantilever),
    /// In tissue.
    Tissue(Box<TissueNeedle>),
}

/// A needle in air that is clamped at the guide's exit, under a force across its tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cantilever {
    /// Root mean square of the force, N.
    pub side_force_n: f64,
    /// Flexural rigidity, N m^2.
    pub rigidity_nm2: f64,
}

impl Cantilever {
    /// Deflection per force at a depth of a needle that is held at depth 0 and ends at `length_m`, m/N:
    /// `s^2 (3 L - s) / (6 E I)`.
    pub fn compliance_m_per_n(&self, depth_m: f64, length_m: f64) -> f64 {
        depth_m * depth_m * (3.0 * length_m - depth_m) / (6.0 * self.rigidity_nm2)
    }
}

/// The needle's way through tissue, for a needle that bends in it.
#[derive(Debug, Clone, PartialEq)]
pub struct NeedlePath {
    /// Tissues from the skin to the needle's tip, the outermost first.
    pub layers: Vec<PassedLayer>,
    /// Unit vector lateral to the needle towards which a bevelled tip is pushed, away from its face: x and y of the guide's
    /// exit at roll 0. None where the direction is not known.
    pub pushed_towards: Option<[f64; 2]>,
    /// Twelve and three on the clock at the hub, of the same: towards the patient's head as near as the needle lets, and a
    /// quarter further as seen along the insertion.
    pub clock: [[f64; 2]; 2],
    /// Depth at which the needle is turned by 180 degrees, m.
    pub turn_at_m: Option<f64>,
    /// What was drawn of it.
    known: KnownBends,
    /// What was drawn of it with all else.
    drawn: DrawnBends,
}

/// Bends that were drawn of one needle at one stand-off: they are the same in all configurations, wherever the patient lies.
#[derive(Debug, Clone, Default)]
struct KnownBends(OnceLock<Drawn>);

#[derive(Debug, Clone)]
struct Drawn {
    needle: TissueNeedle,
    stand_off_m: f64,
    bends: Arc<Bends>,
}

/// Bends of many needles.
#[derive(Debug, Clone, PartialEq)]
pub struct Bends {
    /// At skin and tip, m, the least first.
    pub sorted_m: [Vec<f64>; 2],
    /// Mean of the product of both, m^2.
    pub product_m2: f64,
}

impl Bends {
    /// Of bends at skin and tip, m.
    pub fn new(drawn_m: &[[f64; 2]]) -> Self {
        let products = drawn_m.iter().map(|[skin_m, tip_m]| skin_m * tip_m);
        let product_m2 = products.sum::<f64>() / drawn_m.len() as f64;
        let sorted_m = [0, 1].map(|index| {
            let mut all_m: Vec<f64> = drawn_m.iter().map(|both_m| both_m[index]).collect();
            all_m.sort_by(f64::total_cmp);
            all_m
        });
        Self {
            sorted_m,
            product_m2,
        }
    }
}

/// Bends of draws that a budget takes: the same in all configurations. What they were drawn for stands first.
#[derive(Debug, Default)]
struct DrawnBends(Mutex<Vec<DrawnOnce>>);

#[derive(Debug)]
struct DrawnOnce {
    of: DrawnFor,
    bends_m: Arc<[[f64; 2]]>,
}

#[derive(Debug, Clone, PartialEq)]
struct DrawnFor {
    needle: TissueNeedle,
    stand_off_m: f64,
    first: Vec<f64>,
    count: usize,
}

/// Bends are drawn anew for a copy: what it is copied for is another needle, mostly.
impl Clone for DrawnBends {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for DrawnBends {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// They say nothing that the path does not say, and so all are equal.
impl PartialEq for KnownBends {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl NeedlePath {
    /// A way on which the needle is not turned: see the fields.
    pub fn new(
        layers: Vec<PassedLayer>,
        pushed_towards: Option<[f64; 2]>,
        clock: [[f64; 2]; 2],
    ) -> Self {
        Self {
            layers,
            pushed_towards,
            clock,
            turn_at_m: None,
            known: KnownBends::default(),
            drawn: DrawnBends::default(),
        }
    }

    /// The same way with the needle turned at a depth, m, or not at all.
    #[must_use]
    pub fn turned_at(&self, turn_at_m: Option<f64>) -> Self {
        Self {
            turn_at_m,
            ..Self::new(self.layers.clone(), self.pushed_towards, self.clock)
        }
    }

    /// From the skin to the tip, m.
    pub fn depth_m(&self) -> f64 {
        self.layers.iter().map(|layer| layer.length_m).sum()
    }

    /// Bends at skin and tip, m, of each of many draws: those of a needle at a stand-off are solved once, for all whose first row
    /// of values is the same and who are as many.
    ///
    /// # Panics
    /// Where another thread has panicked while it had them.
    pub fn drawn_m(
        &self,
        needle: &TissueNeedle,
        stand_off_m: f64,
        (first, count): (&[f64], usize),
        solve: impl FnOnce() -> Vec<[f64; 2]>,
    ) -> Arc<[[f64; 2]]> {
        let key = DrawnFor {
            needle: needle.clone(),
            stand_off_m,
            first: first.to_vec(),
            count,
        };
        let all = || self.drawn.0.lock().expect("nobody panics with them");
        let known = |all: &[DrawnOnce]| {
            let found = all.iter().find(|each| each.of == key)?;
            Some(Arc::clone(&found.bends_m))
        };
        if let Some(bends_m) = known(&all()) {
            return bends_m;
        }
        // Not while others wait: two that solve the same find the same.
        let bends_m: Arc<[[f64; 2]]> = solve().into();
        let mut all = all();
        if let Some(bends_m) = known(&all) {
            return bends_m;
        }
        all.push(DrawnOnce {
            of: key.clone(),
            bends_m: Arc::clone(&bends_m),
        });
        bends_m
    }

    /// Bends at skin and tip as `draw` has them, m: drawn once for the needle and the stand-off that are asked for first.
    pub fn bends(
        &self,
        needle: &TissueNeedle,
        stand_off_m: f64,
        draw: impl Fn() -> Bends,
    ) -> Arc<Bends> {
        let known = self.known.0.get_or_init(|| Drawn {
            needle: needle.clone(),
            stand_off_m,
            bends: Arc::new(draw()),
        });
        if known.needle == *needle && known.stand_off_m == stand_off_m {
            Arc::clone(&known.bends)
        } else {
            Arc::new(draw())
        }
    }
}

/// Where a needle is turned on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Turn {
    /// Nowhere.
    Never,
    /// At a depth, m.
    At(f64),
    /// Where it leaves the least bend: see [`TissueNeedle::best_turn_m`].
    Best,
}

/// A needle that cuts its path through tissue, and what is known of its forces.
#[derive(Debug, Clone, PartialEq)]
pub struct TissueNeedle {
    /// The needle.
    pub needle: Needle,
    /// What holds it; its play is half of the play of `[imperfections.guide]`, none without that block.
    pub guide: Guide,
    /// The tip.
    pub tip: Point,
    /// Angle of the bevel's face, rad.
    pub bevel_rad: f64,
    /// Standard deviation of a known direction of the bevel, rad.
    pub bevel_spread_rad: f64,
    /// Where it is turned by 180 degrees.
    pub turn: Turn,
    /// Whether the guide is aimed against the mean bend.
    pub is_aimed: bool,
    /// Force across a bevelled tip in the wall, N, of a needle of 1.27 mm in 20 kN/m2.
    pub wall_force_n: Factor,
    /// Whether that force was measured, and not assumed.
    pub is_force_measured: bool,
    /// Factor on all forces for living tissue.
    pub living: f64,
    /// Stiffnesses, N/m2, of fat, wall, lung and lesion.
    pub stiffness_n_m2: [Factor; TissueNeedle::KINDS.len()],
    /// Forces as shares of that in the wall, of the same.
    pub force_shares: [Factor; TissueNeedle::KINDS.len()],
}

impl TissueNeedle {
    /// The tissues that have coefficients of their own.
    pub const KINDS: [Tissue; 4] = [Tissue::Fat, Tissue::Wall, Tissue::Lung, Tissue::Lesion];

    /// The same needle in air.
    pub(super) fn in_air(&self) -> Cantilever {
        Cantilever {
            side_force_n: SIDE_FORCE_N,
            rigidity_nm2: self.needle.bending_stiffness_nm2(),
        }
    }

    /// The median of all that is uncertain.
    pub fn medians(&self) -> NeedleDraw {
        NeedleDraw {
            needle: self.needle,
            stiffness_n_m2: self.stiffness_n_m2.map(|each| each.median),
            force_shares: self.force_shares.map(|each| each.median),
            wall_force_n: self.wall_force_n.median,
        }
    }

    /// What holds it: a bore without play leaves it no angle.
    fn holder(&self) -> Holder {
        if self.guide.play_m > 0.0 {
            Holder::Guide(self.guide)
        } else {
            Holder::Clamp
        }
    }

    /// Layers with what they do to a needle.
    ///
    /// # Errors
    /// [`LayersError`] for what is no layer.
    pub fn layers(&self, draw: &NeedleDraw, path: &NeedlePath) -> Result<Layers, LayersError> {
        let force_n = draw.wall_force_n * self.living * self.tip.share();
        let layers = path.layers.iter().map(|layer| {
            let index = Self::KINDS.iter().position(|kind| *kind == layer.tissue);
            let (stiffness_n_m2, share) = index.map_or((0.0, 0.0), |index| {
                (draw.stiffness_n_m2[index], draw.force_shares[index])
            });
            let outer_m = draw.needle.outer_m;
            let (tissue, length_m) = (layer.tissue, layer.length_m);
            let mut layer = tissue.layer_of(length_m, outer_m, stiffness_n_m2, force_n, share);
            // Far tails of lognormals are beyond what the solver takes for a tissue.
            layer.stiffness_n_m2 = layer.stiffness_n_m2.min(STIFFEST_N_M2);
            layer.force_n = layer.force_n.min(STRONGEST_N);
            layer
        });
        Layers::new(layers.collect())
    }

    /// What of an insertion the solver is asked for: along one axis lateral to the needle, towards which the tip is pushed.
    fn inserted<T>(
        &self,
        draw: &NeedleDraw,
        path: &NeedlePath,
        holder: &Holder,
        stand_off_m: f64,
        solve: impl Fn(&Needle, &Holder, f64, &Layers, &Bevel) -> Result<T, InsertionError>,
    ) -> Result<T, TissueError> {
        let layers = self.layers(draw, path)?;
        let bevel = Bevel {
            towards: [1.0, 0.0],
            angle_rad: self.bevel_rad,
            turn_at_m: path.turn_at_m,
        };
        Ok(solve(&draw.needle, holder, stand_off_m, &layers, &bevel)?)
    }

    /// Where a needle is pushed on its way, if that is known: see [`NeedlePath::pushed_towards`].
    pub fn pushed_towards(&self, path: &NeedlePath) -> Option<[f64; 2]> {
        path.pushed_towards.filter(|_| self.tip == Point::Bevel)
    }

    /// The needle at the end of its way, along one axis across it: y of the solver's frame is towards where the tip is pushed.
    ///
    /// # Errors
    /// [`TissueError`] for sizes that no needle or guide has.
    pub fn insert(
        &self,
        draw: &NeedleDraw,
        path: &NeedlePath,
        stand_off_m: f64,
    ) -> Result<Insertion, TissueError> {
        let insert = needlebench_insertion::insert;
        self.inserted(draw, path, &self.holder(), stand_off_m, insert)
    }

    /// How far the median needle is off the axis at the end of its way, m, when a hand holds it by its hub and moves on with it,
    /// without a guide: what the guide is worth. The needle is `length_m` long from hub to tip.
    ///
    /// # Errors
    /// [`TissueError`] for a needle that is too short for the way.
    pub fn bend_by_hub_m(&self, path: &NeedlePath, length_m: f64) -> Result<f64, TissueError> {
        let ends = needlebench_insertion::ends;
        let ends_m = self.inserted(&self.medians(), path, &Holder::Hub(length_m), 0.0, ends)?;
        Ok(ends_m[1][0])
    }

    /// The median needle at the end of its way.
    ///
    /// # Errors
    /// [`TissueError`] as of [`Self::insert`].
    pub fn insert_median(
        &self,
        path: &NeedlePath,
        stand_off_m: f64,
    ) -> Result<Insertion, TissueError> {
        self.insert(&self.medians(), path, stand_off_m)
    }

    /// A way with the needle turned where it is to be: see [`Turn`]. Not turned where it cannot be inserted.
    #[must_use]
    pub fn turned(&self, path: NeedlePath, stand_off_m: f64) -> NeedlePath {
        match self.turn {
            Turn::Never => path,
            Turn::At(at_m) => path.turned_at(Some(at_m)),
            Turn::Best => match self.best_turn_m(&path, stand_off_m) {
                Ok(at_m) => path.turned_at(Some(at_m)),
                Err(_) => path,
            },
        }
    }

    /// Depth, m, of a turn by 180 degrees that leaves the least root mean square bend at the tip, of twentieths of the way from
    /// a fifth on: the answer is flat within 5 mm.
    ///
    /// # Errors
    /// [`TissueError`] as of [`Self::insert`].
    pub fn best_turn_m(&self, path: &NeedlePath, stand_off_m: f64) -> Result<f64, TissueError> {
        let depth_m = path.depth_m();
        let mut best = (f64::INFINITY, 0.0);
        for step in TURNS {
            let at_m = depth_m * f64::from(step) / TURN_STEPS;
            let turned = path.turned_at(Some(at_m));
            let [_, square_m2] = self.expected_bend(&turned, stand_off_m)?;
            if square_m2 < best.0 {
                best = (square_m2, at_m);
            }
        }
        Ok(best.1)
    }

    /// Mean bend at the tip, m, towards where it is pushed: what an axis is aimed against. The mean of a direction that is
    /// normal about the known one is shorter than 1, and the model's own factor is a lognormal.
    ///
    /// Accuracy: 3 % of the mean of 20 000 draws (`uncertainty`: `tissue::what_is_aimed_against_is_the_mean`).
    ///
    /// # Errors
    /// [`TissueError`] as of [`Self::insert`].
    pub fn mean_bend_m(&self, path: &NeedlePath, stand_off_m: f64) -> Result<f64, TissueError> {
        let [mean_m, _] = self.expected_bend(path, stand_off_m)?;
        let model = libm::log(MODEL.spread);
        let shrunk =
            libm::exp(0.5 * (model * model - self.bevel_spread_rad * self.bevel_spread_rad));
        Ok(mean_m * MODEL.median * shrunk)
    }

    /// Expected bend at the tip and expected square of it, m and m^2, over forces and stiffnesses: what each factor alone
    /// adds, by Gauss-Hermite of three points in its logarithm. Nothing is drawn.
    fn expected_bend(&self, path: &NeedlePath, stand_off_m: f64) -> Result<[f64; 2], TissueError> {
        let at_tip_m =
            |draw: &NeedleDraw| Ok::<f64, TissueError>(self.bends_m(draw, path, stand_off_m)?[1]);
        let medians = self.medians();
        let middle_m = at_tip_m(&medians)?;
        let mut expected = [middle_m, middle_m * middle_m];
        let mut add = |spread: f64, with: &dyn Fn(&mut NeedleDraw, f64)| {
            if spread <= 1.0 {
                return Ok(());
            }
            let factor = libm::exp(3.0_f64.sqrt() * libm::log(spread));
            for factor in [factor, factor.recip()] {
                let mut draw = medians;
                with(&mut draw, factor);
                let bend_m = at_tip_m(&draw)?;
                expected[0] += (bend_m - middle_m) / 6.0;
                expected[1] += (bend_m * bend_m - middle_m * middle_m) / 6.0;
            }
            Ok::<(), TissueError>(())
        };
        add(self.wall_force_n.spread, &|draw, factor| {
            draw.wall_force_n *= factor;
        })?;
        for (kind, tissue) in Self::KINDS.iter().enumerate() {
            if path.layers.iter().all(|layer| layer.tissue != *tissue) {
                continue;
            }
            add(self.stiffness_n_m2[kind].spread, &|draw, factor| {
                draw.stiffness_n_m2[kind] *= factor;
            })?;
            add(self.force_shares[kind].spread, &|draw, factor| {
                draw.force_shares[kind] *= factor;
            })?;
        }
        Ok(expected)
    }

    /// What a needle that is in does when the tissue beyond a depth moves lateral to it by some distance while the guide holds it:
    /// by medians, without the bend that it has. Along the motion.
    ///
    /// # Errors
    /// [`TissueError`] as of [`Self::insert`].
    pub fn carried(
        &self,
        path: &NeedlePath,
        stand_off_m: f64,
        from_m: f64,
        by_m: f64,
    ) -> Result<Carried, TissueError> {
        let medians = self.medians();
        let layers = self.layers(&medians, path)?;
        let (needle, holder) = (&medians.needle, self.holder());
        let bevel = Bevel {
            towards: [0.0; 2],
            angle_rad: self.bevel_rad,
            turn_at_m: None,
        };
        let slip = Slip {
            from_m,
            by_m: [by_m, 0.0],
        };
        let straight =
            needlebench_insertion::insert(needle, &holder, stand_off_m, &layers, &bevel)?;
        let moved = straight.slipped(needle, &holder, stand_off_m, &layers, &bevel, slip)?;
        Ok(Carried {
            tip_m: moved.tip_m()[0],
            guide_n: moved.pushed_n(&layers, Some(slip))[0],
        })
    }

    /// How far the tip is off the axis where it pierces the skin and at the end of its way, m, towards where it is pushed.
    ///
    /// # Errors
    /// [`TissueError`] as of [`Self::insert`].
    pub fn bends_m(
        &self,
        draw: &NeedleDraw,
        path: &NeedlePath,
        stand_off_m: f64,
    ) -> Result<[f64; 2], TissueError> {
        let ends = needlebench_insertion::ends;
        let ends = self.inserted(draw, path, &self.holder(), stand_off_m, ends)?;
        Ok(ends.map(|[towards, _]| towards))
    }
}

/// How a needle is aimed about its entry point so that its bent tip comes to where that of a straight one was to come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Angle of the axis away from where the needle bends to, rad.
    pub tilt_rad: f64,
    /// Depth at which the needle ends along it, m.
    pub tip_m: f64,
}

impl Aim {
    /// Against a bend lateral to the aimed axis at a place so deep, m; none where it bends as far as it is deep.
    pub fn new(target_m: f64, bend_m: f64) -> Option<Self> {
        let share = bend_m / target_m;
        (share.abs() < 1.0).then(|| Self {
            tilt_rad: libm::asin(share),
            tip_m: (target_m * target_m - bend_m * bend_m).sqrt(),
        })
    }
}

/// Depths of a turn that are tried, as shares of the way.
const TURNS: std::ops::RangeInclusive<u32> = 4..=19;
const TURN_STEPS: f64 = 20.0;

/// Points of a bent needle, m apart.
const STEP_M: f64 = 5e-3;

/// How far what an inserted needle has cut is off the axis at a depth, m.
pub fn bend_at_m(inserted: &Insertion, depth_m: f64) -> f64 {
    let depths_m = &inserted.depths_m;
    let next = depths_m
        .partition_point(|&each| each < depth_m)
        .clamp(1, depths_m.len() - 1);
    let [from_m, to_m] = [depths_m[next - 1], depths_m[next]];
    let share = ((depth_m - from_m) / (to_m - from_m)).clamp(0.0, 1.0);
    inserted.path_m[next - 1][0] * (1.0 - share) + inserted.path_m[next][0] * share
}

/// Depths and bends of what an inserted needle has cut, m, at steps of at most 5 mm.
pub fn bends_along_m(inserted: &Insertion) -> Vec<[f64; 2]> {
    let end_m = inserted.depths_m.last().copied().unwrap_or(0.0);
    let count = (end_m / STEP_M).ceil().max(1.0);
    let mut points = Vec::new();
    let mut number = 0.0;
    while number <= count {
        let depth_m = end_m * number / count;
        points.push([depth_m, bend_at_m(inserted, depth_m)]);
        number += 1.0;
    }
    points
}

/// Stiffest tissue, N/m2, and strongest force across a tip, N, that the solver takes.
const STIFFEST_N_M2: f64 = 1e6;
const STRONGEST_N: f64 = 5.0;

/// A needle that moving tissue takes along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Carried {
    /// How far the tip goes, m.
    pub tip_m: f64,
    /// The force that the guide holds the needle with, N.
    pub guide_n: f64,
}

/// A needle, and the tissues of a patient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeedleDraw {
    /// The needle.
    pub needle: Needle,
    /// Stiffnesses, N/m2, by [`TissueNeedle::KINDS`].
    pub stiffness_n_m2: [f64; TissueNeedle::KINDS.len()],
    /// Forces as shares of that in the wall, of the same.
    pub force_shares: [f64; TissueNeedle::KINDS.len()],
    /// Force across a bevelled tip in the wall, N, of a needle of 1.27 mm in 20 kN/m2.
    pub wall_force_n: f64,
}

/// Why a needle is not inserted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TissueError {
    /// The layers.
    #[error(transparent)]
    Layers(#[from] LayersError),
    /// Needle, guide or bevel.
    #[error(transparent)]
    Insertion(#[from] InsertionError),
}

/// What `needle fit` writes.
#[derive(Debug, Deserialize)]
struct Fitted {
    tip_force_n: f64,
    interval_95_n: [f64; 2],
}

/// Half of the width of a normal's 95 % interval, standard deviations.
const HALF_95: f64 = 1.959_963_984_540_054;

/// The bending of a block that stands at `place`; its play is `play_m` to either side.
pub(super) fn needle_bending(
    toml: &TomlText<'_>,
    place: &str,
    block: &NeedleBlock,
    tool: &Tool,
    play_m: f64,
    base: &Path,
    sources: &mut Vec<ModelSource>,
) -> Result<NeedleBending, Finding> {
    let (outer_m, bore_m) = (tool.needle.outer_diameter_m, block.bore_mm * 1e-3);
    if bore_m >= outer_m {
        return Err(toml
            .finding(
                &format!("{place}.bore_mm"),
                format!(
                    "a needle bore of {} mm is not smaller than the needle of {:.3} mm",
                    block.bore_mm,
                    outer_m * 1e3
                ),
            )
            .hint("0 for a needle with the stylet inserted"));
    }
    let needle = Needle {
        outer_m,
        inner_m: bore_m,
        has_stylet: bore_m == 0.0,
        young_pa: block.young_gpa * 1e9,
    };
    if block.model() == NeedleModel::Cantilever {
        return Ok(NeedleBending::Cantilever(Cantilever {
            side_force_n: block.side_force_n.unwrap_or(SIDE_FORCE_N),
            rigidity_nm2: needle.bending_stiffness_nm2(),
        }));
    }
    let forces = &block.forces;
    let mut wall_force_n = Factor {
        median: forces.wall_n,
        spread: forces.wall_spread,
    };
    if let Some(measured) = &block.measured {
        let key = format!("{place}.measured.file");
        let (factor, source) = fitted(toml, &key, &measured.file, base)?;
        wall_force_n = factor;
        sources.push(source);
    }
    let stiffness = &block.stiffness;
    let stiffnesses = [
        stiffness.fat_kn_m2,
        stiffness.wall_kn_m2,
        stiffness.lung_kn_m2,
        stiffness.lesion_kn_m2,
    ];
    let shares = [
        forces.fat_share,
        1.0,
        forces.lung_share,
        forces.lesion_share,
    ];
    let kinds = TissueNeedle::KINDS;
    Ok(NeedleBending::Tissue(Box::new(TissueNeedle {
        needle,
        guide: Guide {
            length_m: tool.guide_length_m(),
            play_m,
        },
        tip: match block.tip {
            NeedleTip::Bevel => Point::Bevel,
            NeedleTip::Symmetric => Point::Symmetric,
            NeedleTip::Rolled => Point::Rolled,
        },
        bevel_rad: block.bevel_deg.to_radians(),
        bevel_spread_rad: block.bevel_spread_deg.to_radians(),
        turn: match (block.turn_at, block.turn_at_mm) {
            (Some(TurnAt::Best), _) => Turn::Best,
            (None, Some(mm)) => Turn::At(mm * 1e-3),
            (None, None) => Turn::Never,
        },
        is_aimed: block.aim,
        wall_force_n,
        is_force_measured: block.measured.is_some(),
        living: forces.living,
        stiffness_n_m2: std::array::from_fn(|index| Factor {
            median: stiffnesses[index] * 1e3,
            ..kinds[index].stiffness_n_m2()
        }),
        force_shares: std::array::from_fn(|index| Factor {
            median: shares[index],
            ..kinds[index].force_share()
        }),
    })))
}

/// The force that a file of `needle fit` has.
fn fitted(
    toml: &TomlText<'_>,
    key: &str,
    file: &str,
    base: &Path,
) -> Result<(Factor, ModelSource), Finding> {
    let location = Location::Disk(base.join(file));
    let shown = location.display();
    let bytes = location.read().map_err(|error| {
        let finding = toml.finding(key, format!("cannot read `{shown}`: {error}"));
        finding.hint("`needlebench needle fit BENDS.csv --output FILE` writes it")
    })?;
    let text = String::from_utf8(bytes.clone())
        .map_err(|_| Finding::new(&shown, "the file is not UTF-8 text"))?;
    let Fitted {
        tip_force_n,
        interval_95_n: [low_n, high_n],
    } = from_toml(&shown, &text)?;
    if !(0.0 < low_n && low_n <= tip_force_n && tip_force_n <= high_n && high_n <= 5.0) {
        let message = format!(
            "`tip_force_n` of {tip_force_n} N with an interval of {low_n} to {high_n} N is no force across a tip"
        );
        return Err(Finding::new(&shown, message).key("interval_95_n").hint(
            "above 0 and at most 5 N, the force in its interval; an interval that reaches 0 says nothing: record more bends",
        ));
    }
    let spread = libm::exp(libm::log(high_n / low_n) / (2.0 * HALF_95));
    let factor = Factor {
        median: tip_force_n,
        spread,
    };
    Ok((factor, source_of(shown, &bytes)))
}
