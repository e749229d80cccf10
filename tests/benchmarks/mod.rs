//! Engines and referee against motion whose answer is known in closed form.
//!
//! Every test prints what it saw: run it with `-- --nocapture`. Bounds are derived from the method:
//! both engines advance by semi-implicit Euler, `v += h a(q, v, torque)`, `q += h v`.

mod contact;
mod deviations;
mod elliptic;
mod free_motion;
mod mechanism;
mod servo_step;

use std::path::Path;
use std::time::Duration;

use needlebench_cell::Cell;
use needlebench_engine::mujoco::{HarnessProcess, ensure};
use needlebench_engine::{
    MujocoPlant, MujocoSettings, Plant, RapierPlant, RapierSettings, RefereePlant, RefereeSettings,
    TorqueHold,
};
use needlebench_scenario::{Overrides, resolve_scenario};

/// The shipped UR3 with its tool and nothing around it that it could touch.
fn ur3() -> Cell {
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios");
    let text = r#"
        name = "benchmark"
        [[goals]]
        name = "any"
        insertion_length_mm = 50
        flange_pose = { position_mm = [0, 300, 300], rotation_vector_rad = [0, 0, 0] }
        "#;
    resolve_scenario("benchmark.toml", text, &base, &Overrides::default())
        .unwrap()
        .cell
}

fn harness() -> HarnessProcess {
    let environment = ensure(&mut |stage| println!("{stage}")).unwrap();
    HarnessProcess::start(&environment, Duration::from_mins(1)).unwrap()
}

fn referee(cell: &Cell, timestep_s: f64) -> RefereePlant {
    let settings = RefereeSettings {
        hold: TorqueHold::FromSample,
        ..RefereeSettings::default()
    };
    RefereePlant::new(cell, timestep_s, &settings).unwrap()
}

/// Applies `each` to both engines.
fn with_engines(
    cell: &Cell,
    timestep_s: f64,
    friction: f64,
    mut each: impl FnMut(&str, &mut dyn Plant),
) {
    let rapier = RapierSettings {
        friction,
        ..RapierSettings::default()
    };
    each(
        "rapier",
        &mut RapierPlant::new(cell, timestep_s, &rapier).unwrap(),
    );
    let mut harness = harness();
    let mujoco = MujocoSettings {
        friction,
        ..MujocoSettings::default()
    };
    each(
        "mujoco",
        &mut MujocoPlant::new(&mut harness, cell, timestep_s, &mujoco).unwrap(),
    );
}
