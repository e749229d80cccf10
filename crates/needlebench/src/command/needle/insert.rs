//! `needlebench needle insert`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use needlebench_input::Finding;
use needlebench_insertion::{
    Holder, Insertion, InsertionError, Point, Slip, Tissue, WARNED_SLOPE, insert,
};
use needlebench_report::write_atomically;
use needlebench_show::{Cell, CellAlignment, plain_table};
use serde::Serialize;

use super::case::{Case, CaseLayer, From};
use super::setup::in_mm;
use crate::command::results_folder::probe_file;
use crate::command::{print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::shown;

pub(super) const INSERT_HELP: &str = "\
The case is a TOML file:

  [needle]     gauge (16 to 22), or outer_mm; inner_mm, stylet, young_gpa
  [held]       by = \"guide\" with guide_length_mm, bore_mm and standoff_mm,
               by = \"clamp\" with standoff_mm, or by = \"hub\" with
               needle_length_mm
  [tip]        point (bevel, symmetric or rolled), bevel_deg, towards_deg,
               turn_at_mm
  [[layers]]   length_mm, and a tissue (fat, wall, lung, lesion, gas, fluid) or
               stiffness_kn_m2 and force_n, which replace those of the tissue
  [slip]       from_mm, by_mm: tissue that moves sideways afterwards

x is the guide's axis, from its exit on, y and z are across; towards_deg 0 is y,
90 is z.

Example: needlebench needle insert guide/examples/needle.toml --csv path.csv";

#[derive(Debug, Args)]
pub(crate) struct InsertArguments {
    /// Needle, holder and layers.
    #[arg(value_name = "CASE")]
    pub case: PathBuf,
    /// Write the path and the needle's shape to this file.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
}

/// The answer, in SI.
#[derive(Debug, Serialize)]
struct InsertAnswer {
    schema_version: u32,
    case: String,
    needle: NeedleAnswer,
    held: HeldAnswer,
    tip: TipAnswer,
    layers: Vec<LayerAnswer>,
    slip: Option<SlipAnswer>,
    /// Across the axis, along y and z.
    tip_m: [f64; 2],
    tip_bend_m: f64,
    depths_m: Vec<f64>,
    path_m: Vec<[f64; 2]>,
    shape_m: Vec<[f64; 2]>,
    slopes: Vec<[f64; 2]>,
    exit: ExitAnswer,
    largest_slope: f64,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct NeedleAnswer {
    gauge: Option<u8>,
    outer_m: f64,
    inner_m: Option<f64>,
    stylet: bool,
    young_pa: f64,
    bending_stiffness_nm2: f64,
}

#[derive(Debug, Serialize)]
#[serde(tag = "by", rename_all = "snake_case")]
enum HeldAnswer {
    Guide {
        length_m: f64,
        play_m: f64,
        standoff_m: f64,
    },
    Clamp {
        standoff_m: f64,
    },
    Hub {
        needle_length_m: f64,
    },
}

#[derive(Debug, Serialize)]
struct TipAnswer {
    point: &'static str,
    force_share: f64,
    bevel_rad: f64,
    towards: [f64; 2],
    turn_at_m: Option<f64>,
}

#[derive(Debug, Serialize)]
struct LayerAnswer {
    tissue: Option<&'static str>,
    from_m: f64,
    to_m: f64,
    stiffness_n_m2: f64,
    stiffness_is: From,
    /// Across this tip.
    force_n: f64,
    force_is: From,
    /// At its end.
    path_m: [f64; 2],
}

#[derive(Debug, Serialize)]
#[expect(clippy::struct_field_names, reason = "names end in their unit")]
struct SlipAnswer {
    from_m: f64,
    by_m: [f64; 2],
    tip_before_m: [f64; 2],
}

#[derive(Debug, Serialize)]
struct ExitAnswer {
    displacement_m: [f64; 2],
    slope: [f64; 2],
}

/// Inserts the needle of a case.
pub(super) fn insert_case(arguments: &InsertArguments) -> Result<ExitStatus, Failure> {
    let case = Case::load(&arguments.case)?;
    if let Some(path) = &arguments.csv {
        probe_file(path, "--csv")?;
    }
    let answer = answer(&arguments.case, &case)
        .map_err(|error| Finding::new(arguments.case.display().to_string(), error.to_string()))?;
    if let Some(path) = &arguments.csv {
        write_atomically(path, csv(&answer).as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if arguments.json {
        print_json(&answer)?;
    } else {
        let mut text = text(&case, &answer);
        if let Some(path) = &arguments.csv {
            // Writing to a String cannot fail.
            let _ = write!(text, "\npath: {}", shown(path));
        }
        print_text(&text)?;
    }
    Ok(ExitStatus::Success)
}

fn answer(path: &Path, case: &Case) -> Result<InsertAnswer, InsertionError> {
    let Case {
        needle,
        holder,
        standoff_m,
        bevel,
        layers,
        ..
    } = case;
    let inserted = insert(needle, holder, *standoff_m, layers, bevel)?;
    let done = match case.slip {
        Some(slip) => inserted.slipped(needle, holder, *standoff_m, layers, bevel, slip)?,
        None => inserted.clone(),
    };
    let mut of_layers = Vec::new();
    let mut from_m = 0.0;
    let ends = layers.all().iter().zip(layers.ends_m());
    for (
        (layer, &to_m),
        CaseLayer {
            tissue,
            stiffness_from,
            force_from,
        },
    ) in ends.zip(&case.of_layers)
    {
        of_layers.push(LayerAnswer {
            tissue: tissue.map(Tissue::name),
            from_m,
            to_m,
            stiffness_n_m2: layer.stiffness_n_m2,
            stiffness_is: *stiffness_from,
            force_n: case.point.share() * layer.force_n,
            force_is: *force_from,
            path_m: path_at(&inserted, to_m),
        });
        from_m = to_m;
    }
    let tip_m = done.tip_m();
    Ok(InsertAnswer {
        schema_version: 1,
        case: path.display().to_string(),
        needle: NeedleAnswer {
            gauge: case.gauge,
            outer_m: needle.outer_m,
            inner_m: case.has_inner.then_some(needle.inner_m),
            stylet: needle.has_stylet,
            young_pa: needle.young_pa,
            bending_stiffness_nm2: needle.bending_stiffness_nm2(),
        },
        held: match *holder {
            Holder::Guide(guide) => HeldAnswer::Guide {
                length_m: guide.length_m,
                play_m: guide.play_m,
                standoff_m: *standoff_m,
            },
            Holder::Clamp => HeldAnswer::Clamp {
                standoff_m: *standoff_m,
            },
            Holder::Hub(needle_length_m) => HeldAnswer::Hub { needle_length_m },
        },
        tip: TipAnswer {
            point: word(case.point),
            force_share: case.point.share(),
            bevel_rad: bevel.angle_rad,
            towards: bevel.towards.map(|along| along / case.point.share()),
            turn_at_m: bevel.turn_at_m,
        },
        layers: of_layers,
        slip: case.slip.map(|Slip { from_m, by_m }| SlipAnswer {
            from_m,
            by_m,
            tip_before_m: inserted.tip_m(),
        }),
        tip_m,
        tip_bend_m: length(tip_m),
        exit: ExitAnswer {
            displacement_m: done.exit_m,
            slope: done.exit_slope,
        },
        largest_slope: done.largest_slope(),
        warnings: warnings(case, &done),
        depths_m: done.depths_m,
        path_m: done.path_m,
        shape_m: done.shape_m,
        slopes: done.slopes,
    })
}

fn word(point: Point) -> &'static str {
    match point {
        Point::Bevel => "bevel",
        Point::Symmetric => "symmetric",
        Point::Rolled => "rolled",
    }
}

/// What was cut at a depth, at the node that is there.
fn path_at(inserted: &Insertion, depth_m: f64) -> [f64; 2] {
    // Nodes are at the ends of layers, but for rounding.
    let next = inserted
        .depths_m
        .partition_point(|&each| each < depth_m - 1e-9);
    inserted.path_m.get(next).copied().unwrap_or([0.0; 2])
}

fn length([y, z]: [f64; 2]) -> f64 {
    libm::hypot(y, z)
}

fn warnings(case: &Case, done: &Insertion) -> Vec<String> {
    let mut found = Vec::new();
    let slope = done.largest_slope();
    if slope > WARNED_SLOPE {
        found.push(format!(
            "the largest slope is {slope:.3}, above {WARNED_SLOPE}: the model has small slopes, and bends are off by \
             percents"
        ));
    }
    let is_held = |stiffness_n_m2: f64| stiffness_n_m2 > 0.0;
    if !(case.layers.all().iter()).any(|layer| is_held(layer.stiffness_n_m2)) {
        found.push("no layer has any stiffness: the needle is bent as a beam in air".to_owned());
    }
    found
}

/// Depths, path, needle and slopes; micrometres are the third decimal.
fn csv(answer: &InsertAnswer) -> String {
    let mut text =
        "depth_mm,path_y_mm,path_z_mm,needle_y_mm,needle_z_mm,slope_y,slope_z\n".to_owned();
    let rows = answer.depths_m.iter().zip(&answer.path_m);
    let rows = rows.zip(answer.shape_m.iter().zip(&answer.slopes));
    for ((depth_m, path), (needle, slope)) in rows {
        let [path_y, path_z] = path.map(|each| 1e3 * each);
        let [needle_y, needle_z] = needle.map(|each| 1e3 * each);
        let [slope_y, slope_z] = slope;
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{:.6},{path_y:.6},{path_z:.6},{needle_y:.6},{needle_z:.6},{slope_y:.6},{slope_z:.6}",
            1e3 * depth_m
        );
    }
    text
}

fn text(case: &Case, answer: &InsertAnswer) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write_text(&mut out, case, answer);
    out.truncate(out.trim_end().len());
    out
}

/// How far, and where to: `1.123 mm towards 0 deg (y 1.123, z 0.000)`.
fn bend([y, z]: [f64; 2]) -> String {
    let bend_mm = 1e3 * length([y, z]);
    if bend_mm < 5e-4 {
        return "on the axis".to_owned();
    }
    let [y_mm, z_mm] = [y, z].map(|each| 1e3 * each + 0.0);
    let towards_deg = libm::atan2(z, y).to_degrees();
    format!("{bend_mm:.3} mm towards {towards_deg:.0} deg (y {y_mm:.3}, z {z_mm:.3})")
}

fn write_text(out: &mut String, case: &Case, answer: &InsertAnswer) -> std::fmt::Result {
    writeln!(out, "tip {}", bend(answer.tip_m))?;
    if let Some(slip) = &answer.slip {
        let [y_mm, z_mm] = slip.by_m.map(|each| 1e3 * each);
        writeln!(
            out,
            "before tissue from {} mm on moved by (y {y_mm}, z {z_mm}) mm: {}",
            in_mm(slip.from_m),
            bend(slip.tip_before_m)
        )?;
    }
    writeln!(
        out,
        "at {} mm behind the skin, largest slope {:.4}",
        in_mm(case.layers.depth_m()),
        answer.largest_slope
    )?;
    let NeedleAnswer {
        gauge,
        outer_m,
        stylet,
        bending_stiffness_nm2,
        ..
    } = answer.needle;
    let gauge = gauge.map_or(String::new(), |gauge| format!("{gauge} G, "));
    let stylet = if stylet { "with" } else { "without" };
    writeln!(
        out,
        "needle: {gauge}{} mm, {stylet} stylet, EI {bending_stiffness_nm2:.4} N m2",
        in_mm(outer_m)
    )?;
    match (&answer.held, case.bore_mm) {
        (
            HeldAnswer::Guide {
                length_m,
                play_m,
                standoff_m,
            },
            Some(bore_mm),
        ) => writeln!(
            out,
            "held: guide of {} mm with a bore of {bore_mm} mm (play {} mm to each side), {} mm from the skin",
            in_mm(*length_m),
            in_mm(*play_m),
            in_mm(*standoff_m)
        )?,
        (HeldAnswer::Hub { needle_length_m }, _) => writeln!(
            out,
            "held: at the hub, {} mm from the tip",
            in_mm(*needle_length_m)
        )?,
        (HeldAnswer::Clamp { standoff_m } | HeldAnswer::Guide { standoff_m, .. }, _) => {
            writeln!(out, "held: clamp, {} mm from the skin", in_mm(*standoff_m))?;
        }
    }
    let turned = match case.bevel.turn_at_m {
        Some(turn_at_m) => format!(", turned by 180 deg at {} mm", in_mm(turn_at_m)),
        None => String::new(),
    };
    let bevel_deg = case.bevel.angle_rad.to_degrees();
    let share = case.point.share();
    let point = match case.point {
        Point::Bevel => format!("bevel of {bevel_deg:.0} deg"),
        Point::Symmetric => format!("symmetric, {share} of the force across a bevel"),
        Point::Rolled => {
            format!("bevel of {bevel_deg:.0} deg, rolled: {share} of its force (assumed)")
        }
    };
    writeln!(
        out,
        "tip: {point}, pushed towards {} deg{turned}\n",
        case.towards_deg
    )?;
    let mut table = plain_table(&[
        "layer",
        "tissue",
        "to (mm)",
        "k (kN/m2)",
        "F (N)",
        "path y (mm)",
        "z (mm)",
        "assumed",
    ]);
    for (index, layer) in answer.layers.iter().enumerate() {
        let number = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
        let [y_mm, z_mm] = layer.path_m.map(|each| 1e3 * each);
        let assumed = match (layer.stiffness_is, layer.force_is) {
            (From::Assumed, From::Assumed) => "k, F",
            (From::Assumed, _) => "k",
            (_, From::Assumed) => "F",
            _ => "",
        };
        table.add_row([
            number((index + 1).to_string()),
            Cell::new(layer.tissue.unwrap_or("")),
            number(format!("{:.1}", 1e3 * layer.to_m)),
            number(format!("{}", 1e-3 * layer.stiffness_n_m2)),
            number(format!("{:.4}", layer.force_n)),
            number(format!("{y_mm:.3}")),
            number(format!("{z_mm:.3}")),
            Cell::new(assumed),
        ]);
    }
    writeln!(out, "{table}")?;
    for warning in &answer.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    Ok(())
}
