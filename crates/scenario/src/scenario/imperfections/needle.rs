//! The needle: how it bends.

use needlebench_input::{Finding, TomlText};
use needlebench_insertion::{Tissue, WALL_FORCE_N};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the block stands.
pub const IN_IMPERFECTIONS: &str = "imperfections.needle";
pub const IN_EXPECTED: &str = "expected.needle";

/// How the needle bends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NeedleModel {
    /// A cantilever in air, clamped at the guide's exit, under a lateral force at the tip (`side_force_n`):
    /// `delta = F L^3 / (3 E I)`, the concentrated bevel force with which mechanics of needle steering begin (Misra et al.,
    /// Int. J. Robotics Research 29(13), 2010). No tissue; the direction is uniform.
    Cantilever,
    /// A beam in a guide with play that cuts its path through the tissues between skin and target; the bevel pushes the tip.
    Tissue,
}

/// What the tip looks like, or what is done with it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NeedleTip {
    /// One face: the needle bends away from it.
    #[default]
    Bevel,
    /// Pencil, diamond or trocar: a small force, in any direction.
    Symmetric,
    /// A bevel that is rolled between the fingers all the way: a smaller force, in any direction.
    Rolled,
}

/// Where a needle is turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TurnAt {
    /// By 180 degrees at the twentieth of its way, from a fifth on, that leaves the least root mean square bend.
    Best,
}

/// Needle bending by a lateral force at the tip, caused by the bevel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NeedleBlock {
    /// `tissue`: the needle cuts its path through fat, chest wall, lung and lesion; the play in the guide is solved with it
    /// and no source of its own. `cantilever`: in air, without tissue. Default: `tissue` in a patient, with a note and as in
    /// air where a needle cannot be inserted so; `cantilever` without a patient or with `side_force_n`.
    pub model: Option<NeedleModel>,
    /// RMS lateral force at the tip, N; model `cantilever` only. Default: 0.1 (assumed): 1 mm deflection of an 18 G needle
    /// with stylet, 90 mm from the guide. Radiologists report at most 5.3 mm of unwanted bending on average (de Jong et
    /// al., Medical Devices 11, 2018, 259-265).
    #[schemars(range(min = 0.0, max = 10.0))]
    pub side_force_n: Option<f64>,
    /// Young's modulus of the needle, GPa: stainless steel.
    #[schemars(range(min = 1.0, max = 500.0))]
    pub young_gpa: f64,
    /// Inner diameter of the needle, mm; 0 with the stylet inserted.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub bore_mm: f64,
    /// The tip; model `tissue` only, as are all that follow.
    pub tip: NeedleTip,
    /// Angle of the bevel's face from the needle's axis, deg. The force across the tip is averaged over the face's length.
    #[schemars(range(min = 5.0, max = 90.0))]
    pub bevel_deg: f64,
    /// Where the bevel's face looks, as the mark at the hub shows it: `unknown`; a time on a clock seen by whoever holds the
    /// hub, `12:00` towards the patient's head (to the left for a needle along the body); `superior`, `inferior`, `left`,
    /// `right`, `anterior`, `posterior`; or a structure of the phantom such as `spine`. The needle bends away from it.
    pub bevel: String,
    /// Standard deviation of a known direction, deg. Assumed: what a hand turns by.
    #[schemars(range(min = 0.0, max = 90.0))]
    pub bevel_spread_deg: f64,
    /// Depth behind the skin at which the needle is turned by 180 degrees, mm. Default: never.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub turn_at_mm: Option<f64>,
    /// The depth of the turn, for each goal: instead of `turn_at_mm`.
    pub turn_at: Option<TurnAt>,
    /// Whether the guide is tilted about the entry point so that the mean tip of the bent needle comes to the target, not that
    /// of a straight one; for a bevel of known direction. The straight needle keeps its margins all the same.
    pub aim: bool,
    /// Forces across the tip.
    pub forces: ForcesBlock,
    /// Stiffnesses of the tissues.
    pub stiffness: StiffnessBlock,
    /// A force that was measured with one's own needle, instead of `forces.wall_n` and its spread.
    pub measured: Option<MeasuredForce>,
}

/// Forces across a bevelled tip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ForcesBlock {
    /// Median in the chest wall, N, of a needle of 1.27 mm (18 G) in 20 kN/m2; other needles in proportion to their outer
    /// diameter (assumed), stiffer tissue to the power of 0.53. From the bend of a 22 G in ballistic gel (Rand et al. 2016).
    #[schemars(range(min = 0.0, max = 5.0))]
    pub wall_n: f64,
    /// Its spread from needle to needle: a lognormal's standard deviation as a factor. Assumed.
    #[schemars(range(min = 1.0, max = 5.0))]
    pub wall_spread: f64,
    /// Factor on all forces for living tissue. Assumed: 1, the upper side: bevels bent little or not at all in some living
    /// organs (Majewicz et al. 2012).
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "gel and beef have 1, living tissue 0.1 to 1"))]
    pub living: f64,
    /// Force in fat as a share of that in the wall. Assumed.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub fat_share: f64,
    /// Force in lung as a share of that in the wall. Assumed.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub lung_share: f64,
    /// Force in the lesion as a share of that in the wall. Assumed.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub lesion_share: f64,
}

/// Stiffnesses of tissues: lateral force per length per displacement, median.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StiffnessBlock {
    /// Fat, kN/m2. Assumed.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub fat_kn_m2: f64,
    /// Muscles of the chest wall, kN/m2: preset of a library for needle insertion; gels have 5 to 170.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub wall_kn_m2: f64,
    /// Lung, kN/m2. Assumed.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub lung_kn_m2: f64,
    /// Lesion, kN/m2. Assumed.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub lesion_kn_m2: f64,
}

/// A force that was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredForce {
    /// What `needlebench needle fit` wrote of one's own recorded bends, relative to this file.
    pub file: String,
}

impl Default for NeedleBlock {
    fn default() -> Self {
        Self {
            model: None,
            side_force_n: None,
            young_gpa: 200.0,
            bore_mm: 0.0,
            tip: NeedleTip::default(),
            bevel_deg: 25.0,
            bevel: UNKNOWN.to_owned(),
            bevel_spread_deg: 10.0,
            turn_at_mm: None,
            turn_at: None,
            aim: false,
            forces: ForcesBlock::default(),
            stiffness: StiffnessBlock::default(),
            measured: None,
        }
    }
}

impl Default for ForcesBlock {
    fn default() -> Self {
        Self {
            wall_n: WALL_FORCE_N.median,
            wall_spread: WALL_FORCE_N.spread,
            living: 1.0,
            fat_share: Tissue::Fat.force_share().median,
            lung_share: Tissue::Lung.force_share().median,
            lesion_share: Tissue::Lesion.force_share().median,
        }
    }
}

impl Default for StiffnessBlock {
    fn default() -> Self {
        Self {
            fat_kn_m2: median_kn_m2(Tissue::Fat),
            wall_kn_m2: median_kn_m2(Tissue::Wall),
            lung_kn_m2: median_kn_m2(Tissue::Lung),
            lesion_kn_m2: median_kn_m2(Tissue::Lesion),
        }
    }
}

fn median_kn_m2(tissue: Tissue) -> f64 {
    tissue.stiffness_n_m2().median * 1e-3
}

/// RMS lateral force at the tip of a needle in air, N. Assumed: see `side_force_n`.
pub const SIDE_FORCE_N: f64 = 0.1;

/// The bevel's direction is not known.
const UNKNOWN: &str = "unknown";

/// Directions in a patient, phantom frame (left, posterior, superior).
const ANATOMICAL: [(&str, [f64; 3]); 6] = [
    ("superior", [0.0, 0.0, 1.0]),
    ("inferior", [0.0, 0.0, -1.0]),
    ("left", [1.0, 0.0, 0.0]),
    ("right", [-1.0, 0.0, 0.0]),
    ("anterior", [0.0, -1.0, 0.0]),
    ("posterior", [0.0, 1.0, 0.0]),
];

/// Where the face of a bevel looks.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum BevelFace<'b> {
    /// Anywhere.
    Unknown,
    /// Clockwise from the patient's head as seen along the insertion, rad.
    Clock(f64),
    /// In the phantom frame.
    Direction([f64; 3]),
    /// Towards a structure.
    Structure(&'b str),
}

impl NeedleBlock {
    /// Where its face looks.
    pub(crate) fn face(&self) -> BevelFace<'_> {
        let bevel = self.bevel.trim();
        if bevel == UNKNOWN {
            return BevelFace::Unknown;
        }
        if let Some((_, direction)) = ANATOMICAL.iter().find(|(name, _)| *name == bevel) {
            return BevelFace::Direction(*direction);
        }
        let time = bevel.split_once(':').and_then(|(hours, minutes)| {
            let (hours, minutes) = (hours.parse::<u8>().ok()?, minutes.parse::<u8>().ok()?);
            let is_time = (1..=12).contains(&hours) && minutes < 60;
            is_time.then_some((f64::from(hours % 12) + f64::from(minutes) / 60.0) / 12.0)
        });
        match time {
            Some(share) => BevelFace::Clock(share * std::f64::consts::TAU),
            None => BevelFace::Structure(bevel),
        }
    }

    /// The model: the one that is named, else the one that its keys are for.
    pub(crate) fn model(&self) -> NeedleModel {
        let usual = match self.side_force_n {
            Some(_) => NeedleModel::Cantilever,
            None => NeedleModel::Tissue,
        };
        self.model.unwrap_or(usual)
    }

    /// Whether a needle in tissue is asked for, and not the default.
    pub(crate) fn asks_for_tissue(&self) -> bool {
        self.model == Some(NeedleModel::Tissue) || !self.of_tissue().is_empty()
    }

    /// Keys for a needle in tissue alone that are given.
    fn of_tissue(&self) -> Vec<&'static str> {
        let usual = Self::default();
        let keys = [
            ("tip", self.tip != usual.tip),
            ("bevel_deg", self.bevel_deg != usual.bevel_deg),
            ("bevel", self.bevel != usual.bevel),
            (
                "bevel_spread_deg",
                self.bevel_spread_deg != usual.bevel_spread_deg,
            ),
            ("turn_at_mm", self.turn_at_mm.is_some()),
            ("turn_at", self.turn_at.is_some()),
            ("aim", self.aim),
            ("forces", self.forces != usual.forces),
            ("stiffness", self.stiffness != usual.stiffness),
            ("measured", self.measured.is_some()),
        ];
        let given = keys.into_iter().filter(|(_, is_given)| *is_given);
        given.map(|(key, _)| key).collect()
    }

    /// Checks for keys that the model or the tip has no use for.
    pub(super) fn check(&self, toml: &TomlText<'_>, place: &str) -> Vec<Finding> {
        let usual = Self::default();
        let (unused, own, hint) = match self.model() {
            NeedleModel::Cantilever => (
                self.of_tissue(),
                "cantilever",
                "it is for a needle in tissue: `model = \"tissue\"` without `side_force_n`",
            ),
            NeedleModel::Tissue => (
                self.side_force_n
                    .map(|_| "side_force_n")
                    .into_iter()
                    .collect(),
                "tissue",
                "its forces are those of `forces.wall_n`; `side_force_n` is for `model = \"cantilever\"`",
            ),
        };
        let mut findings: Vec<Finding> = unused
            .into_iter()
            .map(|key| {
                let message = format!("`{key}` has no meaning in model `{own}`");
                toml.finding(&format!("{place}.{key}"), message).hint(hint)
            })
            .collect();
        let has_direction = self.tip == NeedleTip::Bevel;
        if self.model() == NeedleModel::Tissue && !has_direction {
            let keys = [
                ("bevel", self.bevel != usual.bevel),
                ("turn_at_mm", self.turn_at_mm.is_some()),
                ("turn_at", self.turn_at.is_some()),
            ];
            for (key, _) in keys.into_iter().filter(|(_, is_given)| *is_given) {
                let message = format!("`{key}` needs a tip that bends to one side");
                let finding = toml.finding(&format!("{place}.{key}"), message);
                findings.push(finding.hint("`tip = \"bevel\"`"));
            }
        }
        if self.turn_at.is_some() && self.turn_at_mm.is_some() {
            let message = "`turn_at` contradicts `turn_at_mm`";
            let finding = toml.finding(&format!("{place}.turn_at"), message);
            findings.push(finding.hint("a depth of one's own, or the best"));
        }
        if self.aim && (self.bevel.trim() == UNKNOWN || !has_direction) {
            let message = "`aim` needs a needle that is known to bend to one side";
            let finding = toml.finding(&format!("{place}.aim"), message);
            findings.push(
                finding
                    .hint("`tip = \"bevel\"` with `bevel`: where its face looks, such as `3:00`"),
            );
        }
        let contradicts = [
            ("wall_n", self.forces.wall_n != usual.forces.wall_n),
            (
                "wall_spread",
                self.forces.wall_spread != usual.forces.wall_spread,
            ),
        ];
        for (key, is_given) in contradicts {
            if is_given && self.measured.is_some() {
                let message = format!("`{key}` contradicts `measured`");
                let finding = toml.finding(&format!("{place}.forces.{key}"), message);
                findings
                    .push(finding.hint("the file of `measured` has the force and its interval"));
            }
        }
        findings
    }
}
