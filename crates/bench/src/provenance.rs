//! Where a result's numbers come from.

use needlebench_engine::EngineIdentity;
use needlebench_evaluation::report::{InputFile, Provenance};
use needlebench_input::{ModelSource, sha256_hex};
use needlebench_scenario::ResolvedScenario;

/// Lock file of the build; empty where it was not built in its workspace.
const CARGO_LOCK: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/Cargo.lock"));

/// Version of the program with its git revision.
pub const PROGRAM_VERSION: &str = concat!(
    env!("CARGO_PKG_VERSION"),
    " (",
    env!("NEEDLEBENCH_GIT_REVISION"),
    ")"
);

/// Git revision of the build, with `-dirty` where it was changed; `unknown` outside git. For people: what tells programs
/// apart is `SOURCE_SHA256`.
pub const GIT_REVISION: &str = env!("NEEDLEBENCH_GIT_REVISION");

/// SHA-256 of all sources that results depend on, with the versions of all libraries and the compiler. Programs of the
/// same hash compute the same bytes, whatever revision they were built from.
pub(crate) const SOURCE_SHA256: &str = env!("NEEDLEBENCH_SOURCE_SHA256");

/// How numbers are rounded: what the bytes of results depend on beside the program. No instruction of one CPU and not of
/// another does anything else: elementary functions are those of `libm`, products are fused where vectors of any width
/// fuse them, and on machines that cannot, the same is computed in software.
pub fn arithmetic() -> String {
    format!(
        "{}, binary64, libm {}",
        std::env::consts::ARCH,
        env!("NEEDLEBENCH_LIBM")
    )
}

/// Everything that went into a result: the program, its engines, all files.
pub fn provenance(resolved: &ResolvedScenario, engines: Vec<EngineIdentity>) -> Provenance {
    let input = |role: &'static str, source: &ModelSource| InputFile {
        role,
        file: source.file.clone(),
        sha256: source.sha256.clone(),
    };
    let mut inputs = vec![
        input("scenario", &resolved.source),
        input("robot", &resolved.robot_description.source),
        input("tool", &resolved.tool_source),
    ];
    let arm = resolved.robot_description.arm.as_ref();
    inputs.extend(arm.map(|used| input("arm data", &used.arm.source)));
    let calibration = resolved.robot_description.calibration.as_ref();
    inputs.extend(calibration.map(|applied| input("calibration", &applied.source)));
    let meshes = &resolved.robot_description.meshes;
    inputs.extend(meshes.iter().map(|source| input("robot mesh", source)));
    inputs.extend(
        resolved
            .phantom_source
            .iter()
            .map(|source| input("phantom", source)),
    );
    let parts = &resolved.phantom_parts;
    inputs.extend(parts.iter().map(|source| input("phantom part", source)));
    let obstacles = &resolved.obstacle_files;
    inputs.extend(obstacles.iter().map(|source| input("obstacle", source)));
    let arms = resolved.imperfections.iter().flat_map(|each| &each.sources);
    inputs.extend(arms.map(|source| input("real arm", source)));
    Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        git_revision: GIT_REVISION.to_owned(),
        source_sha256: SOURCE_SHA256.to_owned(),
        arithmetic: arithmetic(),
        cargo_lock_sha256: if CARGO_LOCK.is_empty() {
            "unknown".to_owned()
        } else {
            sha256_hex(CARGO_LOCK)
        },
        engines,
        inputs,
        seed: resolved.scenario.seed,
        truth: if resolved.scenario.imperfections.is_none() && resolved.imperfections.is_some() {
            "nominal robot whose controller assumes another gravity: errors of that assumption, \
             inverse kinematics, control and simulation"
        } else if resolved.imperfections.is_some() {
            "imperfect robot and phantom, sampled by the seed: errors of the scenario's \
             imperfections, control and simulation"
        } else if calibration.is_some() {
            "factory-calibrated robot: errors of inverse kinematics, control and simulation"
        } else {
            "nominal robot: errors of inverse kinematics, control and simulation"
        },
    }
}
