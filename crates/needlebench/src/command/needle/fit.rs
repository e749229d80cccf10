//! `needlebench needle fit`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use needlebench_input::{Finding, printable_line, read_data, sha256_hex};
use needlebench_insertion::{
    Bend, Bevel, DIAMETER_POWER, FitError, FittedForce, Holder, Layer, Layers, Needle,
    REFERENCE_DIAMETER_M, STIFFNESS_POWER, Tissue, WALL_FORCE_N, WARNED_SLOPE, fit_force, insert,
};
use needlebench_report::write_atomically;
use serde::Serialize;

use super::bends::read_bends;
use super::case::BEVEL_DEG;
use super::setup::{By, Hold, Sizes, Wrong, in_mm};
use crate::command::results_folder::probe_file;
use crate::command::{print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::shown;

pub(super) const FIT_HELP: &str = "\
The table has a header and a row for each depth of one insertion; lines that begin with # are comments:

  depth_mm,bend_mm
  10,0.12

depth_mm is that of the tip behind the skin, bend_mm how far the tip was off the needle's axis then, towards the
bevel's long side. The medium is one and the same all the way, such as gel or muscle.

F0 is the force across the tip of a needle of 1.27 mm (18 G) in a medium of 20 kN/m2; --output writes it for
[imperfections.needle.measured] of scenarios. Bends alone do not tell the stiffness of the medium: without
--stiffness-kn-m2 it is assumed.

Example: needlebench needle fit guide/examples/bends.csv --held hub --gauge 22 --needle-length-mm 89 --output tip.toml";

/// The medium where none is given, kN/m2: the median of the chest wall.
const STIFFNESS_KN_M2: f64 = 20.0;

/// The largest force across a tip, N.
const MOST_N: f64 = 5.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum HeldArgument {
    /// At its hub, by a hand that moves on with it.
    Hub,
    /// By a guide that stays where it is.
    Guide,
}

#[derive(Debug, Args)]
pub(crate) struct FitArguments {
    /// Recorded bends: a table with the columns `depth_mm` and `bend_mm`.
    #[arg(value_name = "CSV")]
    pub csv: PathBuf,
    /// What held the needle; required, as the same force bends a needle several times as far from its hub.
    #[arg(long, value_enum, value_name = "WHAT")]
    pub held: Option<HeldArgument>,
    /// Gauge of the needle, with the diameters of a regular wall.
    #[arg(long, value_name = "16..22", value_parser = clap::value_parser!(u8).range(16..=22))]
    pub gauge: Option<u8>,
    /// Outer diameter, mm, instead of the gauge.
    #[arg(long, value_name = "MM", value_parser = |text: &str| within(text, 0.1, 5.0))]
    pub outer_mm: Option<f64>,
    /// Inner diameter, mm; it counts without the stylet [default: that of the gauge].
    #[arg(long, value_name = "MM", value_parser = |text: &str| within(text, 0.0, 5.0))]
    pub inner_mm: Option<f64>,
    /// The stylet was out.
    #[arg(long)]
    pub stylet_out: bool,
    /// Young's modulus, GPa [default: 200, steel].
    #[arg(long, value_name = "GPA", value_parser = |text: &str| within(text, 1.0, 1000.0))]
    pub young_gpa: Option<f64>,
    /// Length from hub to tip, mm, of a needle held at its hub.
    #[arg(long, value_name = "MM", value_parser = |text: &str| within(text, 1.0, 2000.0))]
    pub needle_length_mm: Option<f64>,
    /// Length of the guide's bore, mm.
    #[arg(long, value_name = "MM", value_parser = |text: &str| within(text, 1.0, 1000.0))]
    pub guide_length_mm: Option<f64>,
    /// Diameter of the guide's bore, mm.
    #[arg(long, value_name = "MM", value_parser = |text: &str| within(text, 0.1, 10.0))]
    pub bore_mm: Option<f64>,
    /// From the guide's exit to the medium, mm.
    #[arg(long, value_name = "MM", value_parser = |text: &str| within(text, 0.0, 1000.0))]
    pub standoff_mm: Option<f64>,
    /// Angle between the bevel's face and the axis, deg.
    #[arg(long, value_name = "DEG", default_value_t = BEVEL_DEG, value_parser = |text: &str| within(text, 5.0, 90.0))]
    pub bevel_deg: f64,
    /// Stiffness of the medium: force per length per displacement, kN/m2 [default: 20, assumed].
    #[arg(long, value_name = "KN_M2", value_parser = |text: &str| within(text, 0.01, 1000.0))]
    pub stiffness_kn_m2: Option<f64>,
    /// Write the result for scenarios to this file.
    #[arg(long, value_name = "FILE.toml")]
    pub output: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
}

/// A number of the command line.
fn within(text: &str, least: f64, most: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (least..=most).contains(&value) => Ok(value),
        Ok(_) => Err(format!("outside {least} to {most}")),
        Err(_) => Err("not a number, with a decimal point".to_owned()),
    }
}

/// The answer.
#[derive(Debug, Serialize)]
struct FitAnswer {
    schema_version: u32,
    bends_file: String,
    bends_sha256: String,
    bends: usize,
    held: &'static str,
    gauge: Option<u8>,
    outer_m: f64,
    bending_stiffness_nm2: f64,
    bevel_rad: f64,
    stiffness_n_m2: f64,
    stiffness_is: &'static str,
    identifiable: bool,
    /// Why not.
    reason: Option<String>,
    /// In this medium, across the tip of this needle.
    force_n: Option<f64>,
    force_interval_95_n: Option<[f64; 2]>,
    /// Of a needle of 1.27 mm in 20 kN/m2.
    tip_force_n: Option<f64>,
    interval_95_n: Option<[f64; 2]>,
    /// The same, if the medium is softer and stiffer than it was taken to be.
    if_softer: Option<OtherMedium>,
    if_stiffer: Option<OtherMedium>,
    residual_m: Option<f64>,
    largest_slope: Option<f64>,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct OtherMedium {
    stiffness_n_m2: f64,
    tip_force_n: f64,
}

/// A recorded insertion.
struct Recorded {
    needle: Needle,
    holder: Holder,
    standoff_m: f64,
    bevel: Bevel,
    depth_m: f64,
    bends: Vec<Bend>,
}

/// Finds the force across the tip.
pub(super) fn fit(arguments: &FitArguments) -> Result<ExitStatus, Failure> {
    if let Some(path) = &arguments.output {
        probe_file(path, "--output")?;
    }
    let (recorded, sha256) = recorded(arguments)?;
    let answer = answer(arguments, &recorded, sha256)?;
    if let (Some(path), Some(text)) = (&arguments.output, toml(&arguments.csv, &answer)) {
        write_atomically(path, text.as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if arguments.json {
        print_json(&answer)?;
    } else {
        let mut text = text(&answer);
        if let Some(path) = &arguments.output {
            let written = if answer.identifiable {
                "for scenarios"
            } else {
                "not written"
            };
            // Writing to a String cannot fail.
            let _ = write!(text, "\n{written}: {}", shown(path));
        }
        print_text(&text)?;
    }
    Ok(if answer.identifiable {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    })
}

fn recorded(arguments: &FitArguments) -> Result<(Recorded, String), Vec<Finding>> {
    const COMMAND_LINE: &str = "the command line";
    let at_option = |wrong: Wrong| {
        let option = format!("--{}", wrong.key.replace('_', "-"));
        Finding::new(COMMAND_LINE, wrong.message)
            .key(option)
            .hint(wrong.hint)
    };
    let by = match arguments.held {
        Some(HeldArgument::Hub) => By::Hub,
        Some(HeldArgument::Guide) => By::Guide,
        None => {
            let message = "nothing says how the needle was held";
            let hint = "--held hub with --needle-length-mm, or --held guide with --guide-length-mm, --bore-mm and \
                        --standoff-mm: the same force bends a needle several times as far from its hub";
            let finding = Finding::new(COMMAND_LINE, message).key("--held");
            return Err(vec![finding.hint(hint)]);
        }
    };
    let sizes = Sizes {
        gauge: arguments.gauge,
        outer_mm: arguments.outer_mm,
        inner_mm: arguments.inner_mm,
        has_stylet: !arguments.stylet_out,
        young_gpa: arguments.young_gpa,
    };
    let needle = sizes.needle().map_err(|wrong| vec![at_option(wrong)])?;
    let file = arguments.csv.display().to_string();
    let unread = |message: String, hint: &str| {
        let message = format!("cannot read the bends: {message}");
        vec![Finding::new(&file, message).hint(hint)]
    };
    let bytes = read_data(&arguments.csv).map_err(|error| {
        let hint = error.hint("a table with the columns depth_mm and bend_mm; the guide has one");
        unread(error.to_string(), hint)
    })?;
    let sha256 = sha256_hex(&bytes);
    let text = String::from_utf8(bytes)
        .map_err(|error| unread(error.to_string(), "save the file as UTF-8 text"))?;
    let bends = read_bends(&file, &text)?;
    let depth_m = bends.last().map_or(0.0, |bend| bend.depth_m);
    let hold = Hold {
        by,
        guide_length_mm: arguments.guide_length_mm,
        bore_mm: arguments.bore_mm,
        standoff_mm: arguments.standoff_mm,
        needle_length_mm: arguments.needle_length_mm,
    };
    let held = hold.holder(&needle, depth_m);
    let (holder, standoff_m) = held.map_err(|wrong| vec![at_option(wrong)])?;
    let recorded = Recorded {
        needle,
        holder,
        standoff_m,
        bevel: Bevel {
            towards: [1.0, 0.0],
            angle_rad: arguments.bevel_deg.to_radians(),
            turn_at_m: None,
        },
        depth_m,
        bends,
    };
    Ok((recorded, sha256))
}

impl Recorded {
    /// The medium with a force across the tip that F0 of 1 N gives.
    fn medium(&self, stiffness_n_m2: f64) -> Layer {
        Tissue::Wall.layer_of(self.depth_m, self.needle.outer_m, stiffness_n_m2, 1.0, 1.0)
    }

    /// F0 and what is left, in a medium of this stiffness.
    fn fitted(&self, stiffness_n_m2: f64) -> Result<FittedForce, FitError> {
        // It begins with what is usual.
        let mut layer = self.medium(stiffness_n_m2);
        layer.force_n *= WALL_FORCE_N.median;
        let layers = Layers::new(vec![layer]).map_err(|_| FitError::NotIdentifiable)?;
        let found = fit_force(
            &self.needle,
            &self.holder,
            self.standoff_m,
            &layers,
            &self.bevel,
            &self.bends,
        )?;
        Ok(FittedForce {
            factor: found.factor * WALL_FORCE_N.median,
            interval: found.interval.map(|each| each * WALL_FORCE_N.median),
            ..found
        })
    }

    /// The largest slope with this force.
    fn largest_slope(&self, layer: Layer) -> Option<f64> {
        let layers = Layers::new(vec![layer]).ok()?;
        let done = insert(
            &self.needle,
            &self.holder,
            self.standoff_m,
            &layers,
            &self.bevel,
        );
        Some(done.ok()?.largest_slope())
    }
}

fn answer(
    arguments: &FitArguments,
    recorded: &Recorded,
    sha256: String,
) -> Result<FitAnswer, Finding> {
    let stiffness_n_m2 = 1e3 * arguments.stiffness_kn_m2.unwrap_or(STIFFNESS_KN_M2);
    let mut answer = FitAnswer {
        schema_version: 1,
        bends_file: arguments.csv.display().to_string(),
        bends_sha256: sha256,
        bends: recorded.bends.len(),
        held: match recorded.holder {
            Holder::Hub(_) => "hub",
            Holder::Guide(_) | Holder::Clamp => "guide",
        },
        gauge: arguments.gauge,
        outer_m: recorded.needle.outer_m,
        bending_stiffness_nm2: recorded.needle.bending_stiffness_nm2(),
        bevel_rad: recorded.bevel.angle_rad,
        stiffness_n_m2,
        stiffness_is: match arguments.stiffness_kn_m2 {
            Some(_) => "given",
            None => "assumed",
        },
        identifiable: false,
        reason: None,
        force_n: None,
        force_interval_95_n: None,
        tip_force_n: None,
        interval_95_n: None,
        if_softer: None,
        if_stiffer: None,
        residual_m: None,
        largest_slope: None,
        warnings: Vec::new(),
    };
    let found = match recorded.fitted(stiffness_n_m2) {
        Ok(found) => found,
        Err(FitError::NotIdentifiable) => {
            answer.reason = Some("no force across the tip meets these bends".to_owned());
            return Ok(answer);
        }
        Err(error) => return Err(Finding::new(&answer.bends_file, error.to_string())),
    };
    let unit = recorded.medium(stiffness_n_m2);
    let force_n = found.factor * unit.force_n;
    answer.residual_m = Some(found.residual_m);
    let [low_n, high_n] = found.interval.map(|each| each * unit.force_n);
    if force_n.abs() > MOST_N {
        let message =
            format!("the bends need a force of {force_n:.1} N across the tip, above {MOST_N} N");
        return Err(Finding::new(&answer.bends_file, message)
            .hint("depths and bends are in mm: check their units, and how the needle was held"));
    }
    answer.force_n = Some(force_n);
    answer.force_interval_95_n = Some([low_n, high_n]);
    let is_above_0 = low_n > 0.0;
    if !is_above_0 {
        answer.reason = Some(if high_n < 0.0 {
            "the bends are towards the bevel's face: give them towards its long side".to_owned()
        } else {
            "the interval of the force includes 0".to_owned()
        });
        return Ok(answer);
    }
    answer.identifiable = true;
    answer.tip_force_n = Some(found.factor);
    answer.interval_95_n = Some(found.interval);
    let spread = Tissue::Wall.stiffness_n_m2().spread;
    let other = |stiffness_n_m2: f64| {
        let found = recorded.fitted(stiffness_n_m2).ok()?;
        Some(OtherMedium {
            stiffness_n_m2,
            tip_force_n: found.factor,
        })
    };
    answer.if_softer = other(stiffness_n_m2 / spread);
    answer.if_stiffer = other(stiffness_n_m2 * spread);
    let slope = recorded.largest_slope(Layer { force_n, ..unit });
    answer.largest_slope = slope;
    if let Some(slope) = slope.filter(|slope| *slope > WARNED_SLOPE) {
        answer.warnings.push(format!(
            "the largest slope is {slope:.3}, above {WARNED_SLOPE}: the model has small slopes, and the force is off \
             by percents"
        ));
    }
    Ok(answer)
}

/// The file for scenarios.
fn toml(csv: &Path, answer: &FitAnswer) -> Option<String> {
    let (force_n, [low_n, high_n]) = (answer.tip_force_n?, answer.interval_95_n?);
    let name = csv.file_name().unwrap_or_default().to_string_lossy();
    let size = match answer.gauge {
        Some(gauge) => format!("gauge = {gauge}"),
        None => format!("outer_mm = {}", in_mm(answer.outer_m)),
    };
    Some(format!(
        "# Of {}, SHA-256 {}: force across a bevelled tip of 1.27 mm in 20 kN/m2.\n\
         tip_force_n = {force_n:.5}\n\
         interval_95_n = [{low_n:.5}, {high_n:.5}]\n\
         {size}\n\
         bends = {}\n\
         residual_mm = {:.4}\n\
         held = \"{}\"\n\
         stiffness_kn_m2 = {}\n",
        printable_line(&name),
        answer.bends_sha256,
        answer.bends,
        1e3 * answer.residual_m?,
        answer.held,
        1e-3 * answer.stiffness_n_m2
    ))
}

fn text(answer: &FitAnswer) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write_text(&mut out, answer);
    out.truncate(out.trim_end().len());
    out
}

fn write_text(out: &mut String, answer: &FitAnswer) -> std::fmt::Result {
    let gauge = match answer.gauge {
        Some(gauge) => format!("{gauge} G, "),
        None => String::new(),
    };
    let given = match answer.stiffness_is {
        "assumed" => ", assumed",
        _ => "",
    };
    let medium = format!("{} kN/m2{given}", 1e-3 * answer.stiffness_n_m2);
    if let (Some(force_n), Some([low_n, high_n])) = (answer.force_n, answer.force_interval_95_n) {
        writeln!(
            out,
            "force across the tip ({gauge}{} mm, held by its {}, in {medium}): {force_n:.4} N, 95 % CI {low_n:.4} to \
             {high_n:.4}",
            in_mm(answer.outer_m),
            answer.held,
        )?;
    }
    if let Some(residual_m) = answer.residual_m {
        writeln!(
            out,
            "residual: {:.3} mm (standard deviation, {} bends)",
            1e3 * residual_m,
            answer.bends
        )?;
    }
    if let Some(reason) = &answer.reason {
        writeln!(out, "not identifiable: {reason}")?;
    }
    if let (Some(force_n), Some([low_n, high_n])) = (answer.tip_force_n, answer.interval_95_n) {
        writeln!(
            out,
            "F0, of a needle of {} mm in {} kN/m2: {force_n:.4} N, 95 % CI {low_n:.4} to {high_n:.4}",
            in_mm(REFERENCE_DIAMETER_M),
            1e-3 * Tissue::Wall.stiffness_n_m2().median
        )?;
        writeln!(
            out,
            "  taken over in proportion to diameter^{DIAMETER_POWER} (assumed) and stiffness^{STIFFNESS_POWER}"
        )?;
    }
    if let (Some(softer), Some(stiffer)) = (&answer.if_softer, &answer.if_stiffer) {
        writeln!(
            out,
            "  {:.4} N if the medium is {} times softer, {:.4} N if stiffer: bends alone do not tell",
            softer.tip_force_n,
            Tissue::Wall.stiffness_n_m2().spread,
            stiffer.tip_force_n
        )?;
    }
    for warning in &answer.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    Ok(())
}
