//! Writes what needlebench says about the cells of scenarios, for `compare.py` to check.
//!
//! `cargo run --release -p needlebench-programs-cell --bin cell_export -- --out DIR SCENARIO...`
//!
//! With `--surfaces` every scenario a second time with a tenth of the postures, the phantom's skin
//! given as a triangle mesh instead of a convex piece, as `NAME_surface`.
//!
//! For every scenario `NAME.json` (bodies, shapes, pairs, timings) and `NAME.f64`: little-endian
//! doubles, per posture six joint positions (rad) and then per pair of the cell
//! [`NUMBERS_PER_PAIR`] numbers. Lengths in metres. The same arguments give the same bytes, but for
//! the timings. `NAME.ik.f64`: all solutions of the flange's pose at the first [`SOLVED`] postures, each as the number of
//! the posture and six joint positions. Besides, `mesh.json`: single pairs against a triangle mesh that is not convex.

mod mesh_bench;

use std::error::Error;
use std::f64::consts::PI;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use needlebench_cell::{BodyKind, Cell, Frame};
use needlebench_clearance::ClearanceModel;
use needlebench_geometry::{ConvexMesh, Shape, SolidMesh, TriangleMesh};
use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{Joints, Pose};
use needlebench_numerics::random::SplitMix64;
use needlebench_planning::Planner;
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};
use serde_json::{Value, json};

/// Per pair: distance, witness points on A and B, normal, indices of the two closest solids.
const NUMBERS_PER_PAIR: usize = 12;

/// Postures whose flange pose is solved.
const SOLVED: usize = 1000;

/// Half of the postures lie within this of the start posture or of one that serves a goal, rad:
/// where clearances are small and matter, which most random postures do not reach.
const NEIGHBOURHOOD_RAD: f64 = 0.4;

/// Passes over the postures of which the quickest is kept.
const PASSES: usize = 5;

struct Arguments {
    out: PathBuf,
    postures: usize,
    timed: usize,
    seed: u64,
    surfaces: bool,
    scenarios: Vec<PathBuf>,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let mut parsed = Arguments {
        out: PathBuf::from("target/validation-cell"),
        postures: 2000,
        timed: 500,
        seed: 1,
        surfaces: false,
        scenarios: Vec::new(),
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(format!("{word} needs a value"));
        match word.as_str() {
            "--out" => parsed.out = PathBuf::from(value()?),
            "--postures" => parsed.postures = value()?.parse()?,
            "--timed" => parsed.timed = value()?.parse()?,
            "--surfaces" => parsed.surfaces = true,
            "--seed" => parsed.seed = value()?.parse()?,
            _ if word.starts_with('-') => return Err(format!("unknown option {word}").into()),
            _ => parsed.scenarios.push(PathBuf::from(word)),
        }
    }
    Ok(parsed)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = arguments()?;
    std::fs::create_dir_all(&arguments.out)?;
    for path in &arguments.scenarios {
        let mut resolved = load_scenario(path, &Overrides::default()).map_err(|findings| {
            let lines: Vec<String> = findings.iter().map(ToString::to_string).collect();
            lines.join("\n")
        })?;
        export(path, &resolved, &arguments, arguments.postures)?;
        if arguments.surfaces {
            resolved.scenario.name += "_surface";
            skin_as_surface(&mut resolved.cell);
            export(path, &resolved, &arguments, arguments.postures / 10)?;
        }
    }
    let mesh = mesh_bench::export(arguments.seed);
    std::fs::write(arguments.out.join("mesh.json"), mesh.to_string())?;
    Ok(())
}

fn export(
    path: &Path,
    resolved: &ResolvedScenario,
    arguments: &Arguments,
    count: usize,
) -> Result<(), Box<dyn Error>> {
    let cell = &resolved.cell;
    let model = ClearanceModel::new(cell);
    let postures = postures(resolved, &model, arguments.seed, count)?;
    let mut bytes = Vec::new();
    let mut push = |number: f64| bytes.extend_from_slice(&number.to_le_bytes());
    for q in &postures {
        q.iter().copied().for_each(&mut push);
        for found in model.all_pairs(q) {
            let separation = &found.separation;
            push(separation.distance_m);
            separation.point_on_a.iter().copied().for_each(&mut push);
            separation.point_on_b.iter().copied().for_each(&mut push);
            separation.normal.iter().copied().for_each(&mut push);
            push(found.solid_a as f64);
            push(found.solid_b as f64);
        }
    }
    let timed = &postures[..arguments.timed.min(postures.len())];
    let minima_s = quickest_s(timed, |q| {
        black_box(model.minimum_per_class(black_box(q)));
    });
    let all_pairs_s = quickest_s(timed, |q| {
        black_box(model.all_pairs(black_box(q)));
    });
    let name = &resolved.scenario.name;
    let header = json!({
        "name": name,
        "scenario": path,
        "seed": arguments.seed,
        "postures": postures.len(),
        "numbers_per_pair": NUMBERS_PER_PAIR,
        "timed_postures": timed.len(),
        "minimum_per_class_s": minima_s,
        "all_pairs_s": all_pairs_s,
        "world_from_base_link": pose(&cell.robot.world_from_base_link),
        "bodies": bodies(cell),
        "pairs": cell.pairs.iter().map(|pair| json!({
            "a": pair.a,
            "b": pair.b,
            "class": pair.class.name(),
        })).collect::<Vec<Value>>(),
    });
    std::fs::write(
        arguments.out.join(format!("{name}.json")),
        header.to_string(),
    )?;
    std::fs::write(arguments.out.join(format!("{name}.f64")), bytes)?;
    let solved = solutions(cell, &postures[..SOLVED.min(postures.len())])?;
    std::fs::write(arguments.out.join(format!("{name}.ik.f64")), solved)?;
    Ok(())
}

/// What inverse kinematics makes of the flange's pose at postures.
fn solutions(cell: &Cell, postures: &[Joints]) -> Result<Vec<u8>, Box<dyn Error>> {
    let kinematics = Kinematics::new(cell.robot.chain)?;
    let mut bytes = Vec::new();
    for (number, q) in postures.iter().enumerate() {
        let pose = kinematics.base_link_from_flange(q);
        for solution in kinematics.solve(&pose, None).solutions {
            bytes.extend_from_slice(&(number as f64).to_le_bytes());
            for angle in &solution.joints {
                bytes.extend_from_slice(&angle.to_le_bytes());
            }
        }
    }
    Ok(bytes)
}

/// Gives the phantom's skin as the same surface without its being known to be convex.
fn skin_as_surface(cell: &mut Cell) {
    let phantoms = cell
        .bodies
        .iter_mut()
        .filter(|body| body.kind == BodyKind::Phantom);
    for solid in phantoms.flat_map(|body| &mut body.solids) {
        if let Shape::Convex(mesh) = &solid.shape {
            let pieces = vec![ConvexMesh::clone(mesh)];
            solid.shape = Shape::Mesh(Arc::new(SolidMesh::with_pieces(mesh.0.clone(), pieces)));
        }
    }
}

/// Every other posture uniform over the joint limits (one turn where there are more), every other
/// near one that the scenario has to do with.
fn postures(
    resolved: &ResolvedScenario,
    model: &ClearanceModel,
    seed: u64,
    count: usize,
) -> Result<Vec<Joints>, Box<dyn Error>> {
    let planner = Planner::new(resolved, model)?;
    let mut places = vec![resolved.start];
    for goal in &resolved.goals {
        for plan in planner.plan(goal).configurations {
            places.extend(plan.candidate.map(|candidate| candidate.joints));
        }
    }
    let limits = &resolved.cell.robot.limits.0;
    let mut random = SplitMix64::new(seed);
    Ok((0..count)
        .map(|i| {
            if i % 2 == 0 {
                Joints::from_fn(|joint, _| {
                    let limit = &limits[joint];
                    random.uniform(limit.lower_rad.max(-PI), limit.upper_rad.min(PI))
                })
            } else {
                let place = places[(i / 2) % places.len()];
                place.map(|q| q + random.uniform(-NEIGHBOURHOOD_RAD, NEIGHBOURHOOD_RAD))
            }
        })
        .collect())
}

/// Mean time per posture of the quickest pass, s.
fn quickest_s(postures: &[Joints], mut query: impl FnMut(&Joints)) -> f64 {
    (0..PASSES)
        .map(|_| {
            let start = Instant::now();
            postures.iter().for_each(&mut query);
            start.elapsed().as_secs_f64() / postures.len().max(1) as f64
        })
        .fold(f64::INFINITY, f64::min)
}

fn bodies(cell: &Cell) -> Vec<Value> {
    cell.bodies
        .iter()
        .map(|body| {
            let solids: Vec<Value> = body
                .solids
                .iter()
                .map(|solid| {
                    json!({
                        "name": solid.name,
                        "shape": shape(&solid.shape),
                        "parent_from_shape": pose(&solid.parent_from_shape),
                    })
                })
                .collect();
            json!({
                "name": body.name,
                "kind": body.kind,
                "link": match body.frame {
                    Frame::World => None,
                    Frame::Link(i) => Some(i),
                },
                "solids": solids,
            })
        })
        .collect()
}

/// Position (m) and quaternion (x, y, z, w).
fn pose(pose: &Pose) -> Value {
    let quaternion: [f64; 4] = pose.rotation.coords.into();
    json!({
        "position_m": <[f64; 3]>::from(pose.translation.vector),
        "quat_xyzw": quaternion,
    })
}

fn shape(shape: &Shape) -> Value {
    match shape {
        Shape::Sphere { radius_m } => json!({"kind": "sphere", "radius_m": radius_m}),
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => json!({"kind": "cylinder", "radius_m": radius_m, "half_length_m": half_length_m}),
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => json!({"kind": "capsule", "radius_m": radius_m, "half_length_m": half_length_m}),
        Shape::Cuboid { half_extents_m } => {
            json!({"kind": "cuboid", "half_extents_m": <[f64; 3]>::from(*half_extents_m)})
        }
        Shape::Convex(mesh) => triangles("convex", &mesh.0),
        Shape::Mesh(mesh) => triangles("mesh", mesh.surface()),
    }
}

fn triangles(kind: &str, mesh: &TriangleMesh) -> Value {
    let vertices: Vec<[f64; 3]> = mesh.vertices_m.iter().map(|v| v.coords.into()).collect();
    json!({"kind": kind, "vertices_m": vertices, "triangles": mesh.triangles})
}
