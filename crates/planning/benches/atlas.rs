//! Atlas of one goal: eight configurations at 360 rolls, edges and best rolls included, one thread.
//!
//! `cargo bench -p needlebench-planning --bench atlas`

#![expect(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::ik::Configuration;
use needlebench_planning::{Member, Planner};
use needlebench_scenario::{Overrides, load_scenario};

fn atlas(c: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/supine_suite.toml");
    let resolved = load_scenario(&path, &Overrides::default()).expect("the scenario is sound");
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).expect("the UR3 is a UR arm");
    let mut group = c.benchmark_group("atlas, 8 x 360, one thread");
    group.sample_size(10);
    for goal in &resolved.goals {
        group.bench_function(&goal.name, |b| {
            b.iter(|| {
                let mut grids: [Vec<Member>; 8] = Default::default();
                for roll_rad in planner.rolls(goal, 360) {
                    let members = planner.members_at(goal, roll_rad);
                    for (grid, member) in grids.iter_mut().zip(members) {
                        grid.push(member);
                    }
                }
                for configuration in Configuration::ALL {
                    let grid = &grids[configuration.index()];
                    black_box(planner.family(goal, configuration, grid));
                }
            });
        });
    }
    group.finish();
}

criterion_group!(benches, atlas);
criterion_main!(benches);
