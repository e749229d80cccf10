//! The needles as markups of 3D Slicer, over the scan that the patient was built from.

use nalgebra::Point3;
use needlebench_patient::ct::{ScanNeedle, ScanNeedles};
use needlebench_scenario::ResolvedScenario;
use serde_json::{Value, json};

use crate::ExportedFile;
use crate::head::head_in;

/// Schema of the document, by which 3D Slicer decides whether it reads it.
const SCHEMA: &str = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/\
     markups-schema-v1.0.3.json#";

/// Longest distance of tip and target that is rounding, m.
const AT_TARGET_M: f64 = 1e-7;

/// The needles of a scenario as markups of 3D Slicer: a line from entry to target for each goal, then all entries and
/// all targets as two lists of points with the goals' names. Positions are in mm, in the patient coordinates of the scan
/// (LPS), rounded to a nanometre. Markups are locked: a plan is not changed by a slip of the mouse.
pub fn markups(resolved: &ResolvedScenario, scan: &ScanNeedles, stem: &str) -> Vec<ExportedFile> {
    let lines = scan.needles.iter().map(line);
    let name = &resolved.scenario.name;
    let entries = scan.needles.iter().map(|needle| {
        let what = format!("entry into the skin, goal {}", needle.goal);
        point(&needle.goal, &what, &needle.entry_m)
    });
    let targets = scan
        .needles
        .iter()
        .map(|needle| point(&needle.goal, &target_words(needle), &needle.target_m));
    let lists = [
        list(&format!("{name} entries"), entries.collect()),
        list(&format!("{name} targets"), targets.collect()),
    ];
    let markups: Vec<Value> = lines.chain(lists).collect();
    let document = json!({
        "@schema": SCHEMA,
        "description": description(resolved, scan),
        "markups": markups,
    });
    let text = format!("{document:#}\n");
    vec![ExportedFile::text(format!("{stem}.mrk.json"), text)]
}

/// What 3D Slicer does not show, for who reads the file.
fn description(resolved: &ResolvedScenario, scan: &ScanNeedles) -> Vec<String> {
    let [columns, rows, slices] = scan.size;
    let [x, y, z] = scan.spacing_m.map(|metres| metres * 1e3);
    let mut lines = head_in(
        resolved,
        "Planned needles",
        "units: mm; patient coordinates of the scan, LPS (x to the left, y to the back, z to the head)",
    );
    lines.push(format!(
        "scan: {columns} x {rows} x {slices} voxels of {x:.3} x {y:.3} x {z:.3} mm"
    ));
    lines.push(format!(
        "patient: report.json of `ct build`, sha256 {}",
        scan.report_sha256
    ));
    lines
}

/// From entry to target.
fn line(needle: &ScanNeedle) -> Value {
    let points = vec![
        point("entry", "entry into the skin", &needle.entry_m),
        point("target", &target_words(needle), &needle.target_m),
    ];
    let display = json!({ "propertiesLabelVisibility": true, "pointLabelsVisibility": false });
    let mut markup = markup("Line", &needle.goal, points, &display);
    markup["fixedNumberOfControlPoints"] = json!(true);
    markup
}

fn list(name: &str, points: Vec<Value>) -> Value {
    let display = json!({ "propertiesLabelVisibility": false, "pointLabelsVisibility": true });
    markup("Fiducial", name, points, &display)
}

fn markup(kind: &str, name: &str, mut points: Vec<Value>, display: &Value) -> Value {
    for (index, point) in points.iter_mut().enumerate() {
        point["id"] = json!((index + 1).to_string());
    }
    json!({
        "type": kind,
        "name": name,
        "coordinateSystem": "LPS",
        "coordinateUnits": "mm",
        "locked": true,
        "controlPoints": points,
        "display": display,
    })
}

fn point(label: &str, description: &str, place_m: &Point3<f64>) -> Value {
    json!({
        "label": label,
        "description": description,
        "position": in_mm(place_m),
        "locked": true,
        "positionStatus": "defined",
    })
}

fn in_mm(place_m: &Point3<f64>) -> [f64; 3] {
    // Not -0, which reads as if it meant something.
    let rounded = |metres: f64| (metres * 1e9).round() / 1e6 + 0.0;
    place_m.coords.map(rounded).into()
}

/// The target, and where the needle ends if that is elsewhere.
fn target_words(needle: &ScanNeedle) -> String {
    let depth_m = (needle.target_m - needle.entry_m).norm();
    let beyond_m = (needle.tip_m - needle.entry_m).norm() - depth_m;
    let depth = format!(
        "target of goal {}, {:.1} mm from the entry",
        needle.goal,
        depth_m * 1e3
    );
    if beyond_m.abs() <= AT_TARGET_M {
        return depth;
    }
    let side = if beyond_m > 0.0 { "beyond" } else { "before" };
    format!(
        "{depth}; the planned needle tip ends {:.1} mm {side} it",
        beyond_m.abs() * 1e3
    )
}
