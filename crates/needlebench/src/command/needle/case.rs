//! A needle, what holds it, and the layers that it is to pass: the file of `needlebench needle insert`.

use std::path::Path;

use needlebench_input::schema::FileSchema;
use needlebench_input::{Finding, TomlText, read_text};
use needlebench_insertion::{
    Bevel, Holder, Layer, Layers, Needle, Point, Slip, Tissue, WALL_FORCE_N,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::setup::{By, Hold, Sizes, Wrong, in_mm};

const STIFFNESS_HINT: &str =
    "in kN/m2: lung has 2, muscle 20, stiff gel 150. Did you give N/m2? 1000 N/m2 are 1 kN/m2";

/// Of sums of lengths, mm.
const ROUNDING_MM: f64 = 1e-9;

/// Angle of a Chiba needle's bevel, deg.
pub(super) const BEVEL_DEG: f64 = 25.0;

/// A needle in layers of tissue.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    /// The needle.
    needle: NeedleSection,
    /// What holds it.
    held: HeldSection,
    /// Its tip.
    #[serde(default)]
    tip: TipSection,
    /// What it passes, from the skin inwards.
    #[schemars(length(min = 1, max = 100))]
    layers: Vec<LayerSection>,
    /// Tissue that moves lateral to the needle afterwards.
    #[serde(default)]
    slip: Option<SlipSection>,
}

/// The needle.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NeedleSection {
    /// Gauge, with the diameters of a regular wall.
    #[serde(default)]
    #[schemars(range(min = 16, max = 22))]
    gauge: Option<u8>,
    /// Outer diameter, mm, instead of a gauge.
    #[serde(default)]
    #[schemars(range(min = 0.1, max = 5.0))]
    outer_mm: Option<f64>,
    /// Inner diameter, mm. Default: that of the gauge.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 5.0))]
    inner_mm: Option<f64>,
    /// Whether a solid stylet is in it.
    #[serde(default = "yes")]
    stylet: bool,
    /// Young's modulus, GPa. Default: 200, steel.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 1000.0), extend("x-unit" = "GPa", "x-hint" = "steel has 200 GPa, nitinol 50 to 75"))]
    young_gpa: Option<f64>,
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum HeldBy {
    /// A guide that stays where it is, with play.
    Guide,
    /// The hub, in a hand that moves on with it.
    Hub,
    /// A clamp that lets the needle slide.
    Clamp,
}

/// What holds the needle.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct HeldSection {
    /// `guide`, `hub` or `clamp`.
    by: HeldBy,
    /// Length of the guide's bore, mm.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 1000.0))]
    guide_length_mm: Option<f64>,
    /// Diameter of the guide's bore, mm.
    #[serde(default)]
    #[schemars(range(min = 0.1, max = 10.0))]
    bore_mm: Option<f64>,
    /// From the exit of guide or clamp to the skin, mm.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    standoff_mm: Option<f64>,
    /// Length of the needle from hub to tip, mm.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 2000.0))]
    needle_length_mm: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum TipPoint {
    /// One face.
    Bevel,
    /// Pencil, diamond, trocar.
    Symmetric,
    /// A bevel that is rolled between the fingers all the way.
    Rolled,
}

/// The tip.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TipSection {
    /// `bevel`, `symmetric` or `rolled`.
    #[serde(default = "bevelled")]
    point: TipPoint,
    /// Angle between face and axis, deg.
    #[serde(default = "chiba")]
    #[schemars(range(min = 5.0, max = 90.0))]
    bevel_deg: f64,
    /// Where the tip is pushed, away from the bevel's face: deg from the y axis towards the z axis.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0))]
    towards_deg: f64,
    /// Depth at which the needle is turned by 180 deg, mm.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2000.0))]
    turn_at_mm: Option<f64>,
}

impl Default for TipSection {
    fn default() -> Self {
        Self {
            point: TipPoint::Bevel,
            bevel_deg: BEVEL_DEG,
            towards_deg: 0.0,
            turn_at_mm: None,
        }
    }
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum TissueName {
    Fat,
    Wall,
    Lung,
    Lesion,
    Gas,
    Fluid,
}

/// A layer.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LayerSection {
    /// Tissue, whose medians are used for what is not given.
    #[serde(default)]
    tissue: Option<TissueName>,
    /// Length along the needle, mm.
    #[schemars(range(min = 0.001, max = 1000.0))]
    length_mm: f64,
    /// Force per length per displacement, kN/m2.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "kN/m2", "x-hint" = STIFFNESS_HINT))]
    stiffness_kn_m2: Option<f64>,
    /// Force across a bevelled tip, N.
    #[serde(default)]
    #[schemars(range(min = -5.0, max = 5.0), extend("x-unit" = "N"))]
    force_n: Option<f64>,
}

/// Tissue that moves after the insertion.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SlipSection {
    /// From this depth on, mm.
    #[schemars(range(min = 0.0, max = 2000.0))]
    from_mm: f64,
    /// By this lateral to the needle, along y and z, mm.
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    by_mm: [f64; 2],
}

fn yes() -> bool {
    true
}

fn chiba() -> f64 {
    BEVEL_DEG
}

fn bevelled() -> TipPoint {
    TipPoint::Bevel
}

/// The JSON schema (draft-07) of such files, for editors.
pub fn needle_case_schema() -> serde_json::Value {
    FileSchema::of::<CaseFile>().published()
}

/// Where a coefficient is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum From {
    /// The file.
    Given,
    /// Published for needles in such tissue.
    Published,
    /// Nobody measured it.
    Assumed,
    /// Gas and fluid have none.
    Nothing,
}

/// A layer with where its coefficients are from.
#[derive(Debug)]
pub(super) struct CaseLayer {
    pub tissue: Option<Tissue>,
    pub stiffness_from: From,
    pub force_from: From,
}

/// What is to be inserted.
#[derive(Debug)]
pub(super) struct Case {
    pub gauge: Option<u8>,
    /// The inner diameter is known.
    pub has_inner: bool,
    pub needle: Needle,
    pub holder: Holder,
    pub standoff_m: f64,
    pub bore_mm: Option<f64>,
    pub point: Point,
    pub bevel: Bevel,
    pub towards_deg: f64,
    pub layers: Layers,
    pub of_layers: Vec<CaseLayer>,
    pub slip: Option<Slip>,
}

impl Case {
    /// Reads a file.
    pub fn load(path: &Path) -> Result<Self, Vec<Finding>> {
        let file = path.display().to_string();
        let text = read_text(path).map_err(|error| {
            let hint = error.hint("a TOML file with needle, holder and layers; the guide has one");
            vec![Finding::new(&file, format!("cannot read the case: {error}")).hint(hint)]
        })?;
        Self::parse(&file, &text)
    }

    fn parse(file: &str, text: &str) -> Result<Self, Vec<Finding>> {
        let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
        let read: CaseFile = toml.read(&FileSchema::of::<CaseFile>())?;
        Self::of(&toml, &read).map_err(|finding| vec![finding])
    }

    fn of(toml: &TomlText<'_>, file: &CaseFile) -> Result<Self, Finding> {
        let at = |section: &str, wrong: Wrong| {
            let key = format!("{section}.{}", wrong.key);
            toml.finding(&key, wrong.message).hint(wrong.hint)
        };
        let sizes = Sizes {
            gauge: file.needle.gauge,
            outer_mm: file.needle.outer_mm,
            inner_mm: file.needle.inner_mm,
            has_stylet: file.needle.stylet,
            young_gpa: file.needle.young_gpa,
        };
        let needle = sizes.needle().map_err(|wrong| at("needle", wrong))?;
        let (mut all, mut of_layers) = (Vec::new(), Vec::new());
        for (index, section) in file.layers.iter().enumerate() {
            let (layer, of_layer) = section.layer(toml, index, &needle)?;
            all.push(layer);
            of_layers.push(of_layer);
        }
        let layers = Layers::new(all).map_err(|error| toml.finding("layers", error.to_string()))?;
        let depth_mm = 1e3 * layers.depth_m();
        let end_mm = in_mm(layers.depth_m());
        let hold = Hold {
            by: match file.held.by {
                HeldBy::Guide => By::Guide,
                HeldBy::Hub => By::Hub,
                HeldBy::Clamp => By::Clamp,
            },
            guide_length_mm: file.held.guide_length_mm,
            bore_mm: file.held.bore_mm,
            standoff_mm: file.held.standoff_mm,
            needle_length_mm: file.held.needle_length_mm,
        };
        let (holder, standoff_m) = hold
            .holder(&needle, layers.depth_m())
            .map_err(|wrong| at("held", wrong))?;
        let beyond = |key: &str, at_mm: f64, what: &str| {
            let message = format!("{what} {at_mm} mm, and the layers end at {end_mm} mm");
            toml.finding(key, message)
                .hint("depths are of the tip, from the skin")
        };
        let tip = &file.tip;
        let point = match tip.point {
            TipPoint::Bevel => Point::Bevel,
            TipPoint::Symmetric => Point::Symmetric,
            TipPoint::Rolled => Point::Rolled,
        };
        if let Some(turn_at_mm) = tip.turn_at_mm {
            if point != Point::Bevel {
                let message =
                    "a needle is turned for its bevel, and this tip acts as if it had none";
                return Err(toml
                    .finding("tip.turn_at_mm", message)
                    .hint("remove it, or write point = \"bevel\""));
            }
            if turn_at_mm > depth_mm + ROUNDING_MM {
                return Err(beyond(
                    "tip.turn_at_mm",
                    turn_at_mm,
                    "the needle is turned at",
                ));
            }
        }
        let slip = file.slip.as_ref();
        if let Some(slip) = slip.filter(|slip| slip.from_mm >= depth_mm) {
            return Err(beyond("slip.from_mm", slip.from_mm, "tissue moves from"));
        }
        let (sine, cosine) = libm::sincos(tip.towards_deg.to_radians());
        Ok(Self {
            gauge: file.needle.gauge,
            has_inner: file.needle.gauge.is_some() || file.needle.inner_mm.is_some(),
            needle,
            holder,
            standoff_m,
            bore_mm: file.held.bore_mm,
            point,
            bevel: Bevel {
                towards: [cosine, sine].map(|along| point.share() * along),
                angle_rad: tip.bevel_deg.to_radians(),
                turn_at_m: (tip.turn_at_mm).map(|at_mm| (1e-3 * at_mm).min(layers.depth_m())),
            },
            towards_deg: tip.towards_deg,
            layers,
            of_layers,
            slip: slip.map(|slip| Slip {
                from_m: 1e-3 * slip.from_mm,
                by_m: slip.by_mm.map(|by_mm| 1e-3 * by_mm),
            }),
        })
    }
}

impl LayerSection {
    fn layer(
        &self,
        toml: &TomlText<'_>,
        index: usize,
        needle: &Needle,
    ) -> Result<(Layer, CaseLayer), Finding> {
        let tissue = self.tissue.map(|name| match name {
            TissueName::Fat => Tissue::Fat,
            TissueName::Wall => Tissue::Wall,
            TissueName::Lung => Tissue::Lung,
            TissueName::Lesion => Tissue::Lesion,
            TissueName::Gas => Tissue::Gas,
            TissueName::Fluid => Tissue::Fluid,
        });
        let needed = |key: &str, given: Option<f64>| match given {
            None if tissue.is_none() => {
                let key = format!("layers[{index}].{key}");
                let hint =
                    "give both stiffness_kn_m2 and force_n, or a tissue with medians of them";
                Err(toml
                    .finding(&key, "a layer without a tissue has no median of it")
                    .hint(hint))
            }
            given => Ok(given),
        };
        let stiffness_kn_m2 = needed("stiffness_kn_m2", self.stiffness_kn_m2)?;
        let force_n = needed("force_n", self.force_n)?;
        let length_m = 1e-3 * self.length_mm;
        let given_n_m2 = stiffness_kn_m2.map(|stiffness| 1e3 * stiffness);
        let mut layer = match tissue {
            Some(tissue) => tissue.layer_of(
                length_m,
                needle.outer_m,
                given_n_m2.unwrap_or(tissue.stiffness_n_m2().median),
                WALL_FORCE_N.median,
                tissue.force_share().median,
            ),
            None => Layer {
                length_m,
                stiffness_n_m2: given_n_m2.unwrap_or(0.0),
                force_n: 0.0,
            },
        };
        if let Some(force_n) = force_n {
            layer.force_n = force_n;
        }
        let of = CaseLayer {
            tissue,
            stiffness_from: match (given_n_m2, tissue) {
                (None, Some(Tissue::Wall)) => From::Published,
                (None, Some(Tissue::Gas | Tissue::Fluid)) => From::Nothing,
                (None, _) => From::Assumed,
                (Some(_), _) => From::Given,
            },
            force_from: match (force_n, tissue) {
                (Some(_), _) => From::Given,
                (None, Some(Tissue::Gas | Tissue::Fluid)) => From::Nothing,
                (None, _) => From::Assumed,
            },
        };
        Ok((layer, of))
    }
}
