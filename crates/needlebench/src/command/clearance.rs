//! `needlebench clearance`.

use crate::arguments::{RobotArguments, Six};
use clap::Args;
use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::Result;
use needlebench_cell::{Cell, part_in_words};
use needlebench_clearance::{ClearanceModel, PairClearance};
use needlebench_kinematics::Joints;
use serde::Serialize;

use super::{load, overrides, print_json, print_text};

use crate::exit::ExitStatus;
use crate::failure::Failure;

#[derive(Debug, Args)]
pub(crate) struct ClearanceArguments {
    /// Scenario with the cell.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// Joint positions, shoulder pan to wrist 3, rad.
    #[arg(long, value_name = "q1,..,q6", allow_hyphen_values = true)]
    pub joints: Six,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

#[derive(Serialize)]
struct ClearanceAnswer {
    schema_version: u32,
    classes: BTreeMap<&'static str, ClassAnswer>,
    pairs: Vec<PairAnswer>,
}

#[derive(Serialize)]
struct ClassAnswer {
    minimum_m: f64,
    pair: [String; 2],
    witness_points_m: [[f64; 3]; 2],
}

#[derive(Serialize)]
struct PairAnswer {
    pair: [String; 2],
    class: &'static str,
    distance_m: f64,
    solids: [String; 2],
    witness_points_m: [[f64; 3]; 2],
}

fn witnesses(pair: &PairClearance) -> [[f64; 3]; 2] {
    [
        pair.separation.point_on_a.coords.into(),
        pair.separation.point_on_b.coords.into(),
    ]
}

fn solids(cell: &Cell, pair: &PairClearance) -> [String; 2] {
    let (a, b) = pair.solid_names(cell);
    [a.to_owned(), b.to_owned()]
}

/// Prints the clearance of one posture.
pub(crate) fn clearance(arguments: &ClearanceArguments) -> Result<ExitStatus, Failure> {
    let overrides = overrides(&arguments.robot)?;
    let resolved = load(&arguments.scenario, &overrides)?;
    let cell = &resolved.cell;
    let model = ClearanceModel::new(cell);
    let q = Joints::from_column_slice(&arguments.joints.0);
    arguments.joints.doubt_degrees();
    let classes: BTreeMap<&'static str, ClassAnswer> = model
        .minimum_per_class(&q)
        .iter()
        .map(|pair| {
            let answer = ClassAnswer {
                minimum_m: pair.separation.distance_m,
                pair: solids(cell, pair),
                witness_points_m: witnesses(pair),
            };
            (pair.class.name(), answer)
        })
        .collect();
    let pairs: Vec<PairAnswer> = model
        .all_pairs(&q)
        .iter()
        .map(|found| {
            let bodies = cell.pairs[found.pair];
            PairAnswer {
                pair: [bodies.a, bodies.b].map(|body| cell.bodies[body].name.clone()),
                class: found.class.name(),
                distance_m: found.separation.distance_m,
                solids: solids(cell, found),
                witness_points_m: witnesses(found),
            }
        })
        .collect();
    if arguments.json {
        print_json(&ClearanceAnswer {
            schema_version: 1,
            classes,
            pairs,
        })?;
        return Ok(ExitStatus::Success);
    }
    let mut table = needlebench_show::plain_table(&["class", "clearance (mm)", "between", "and"]);
    // In ascending order.
    let mut sorted: Vec<_> = classes.iter().collect();
    sorted.sort_by(|(_, a), (_, b)| a.minimum_m.total_cmp(&b.minimum_m));
    for (class, answer) in sorted {
        table.add_row([
            (*class).to_owned(),
            format!("{:.3}", answer.minimum_m * 1e3),
            part_in_words(&answer.pair[0]).into_owned(),
            part_in_words(&answer.pair[1]).into_owned(),
        ]);
    }
    print_text(&table.to_string())?;
    Ok(ExitStatus::Success)
}
