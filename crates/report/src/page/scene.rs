//! The cell as surfaces, and the arm's chain.

use needlebench_cell::{Robot, Tool};
use needlebench_export::{MovesWith, Surfaces, surfaces_of_cell};
use needlebench_kinematics::{Chain, Pose};
use needlebench_phantom::PhantomPart;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::fixtures::Fixture;
use serde_json::{Value, json};

use super::mesh::{MOST_TRIANGLES, surface, thinned};
use super::pack::Pack;

/// A pose as `[x, y, z, qx, qy, qz, qw]`, m.
pub(super) fn pose(pose: &Pose) -> Value {
    let (t, q) = (pose.translation.vector, pose.rotation);
    json!([t.x, t.y, t.z, q.i, q.j, q.k, q.w])
}

/// The chain that poses the links: `world_from_link = base * product of joint * turn(axis, q)`.
pub(super) fn chain(world_from_base_link: &Pose, chain: &Chain) -> Value {
    let joints: Vec<Value> = chain
        .joints
        .iter()
        .map(|joint| {
            let axis = joint.axis.into_inner();
            json!({"pose": pose(&joint.parent_from_joint), "axis": [axis.x, axis.y, axis.z]})
        })
        .collect();
    json!({
        "base": pose(world_from_base_link),
        "joints": joints,
        "flange": pose(&chain.wrist_3_from_flange),
    })
}

/// The surfaces, each with at most so many triangles.
fn finish(surfaces: Surfaces, pack: &mut Pack, most: usize) -> Vec<Value> {
    let parts = surfaces.0.into_iter().map(|each| {
        let mesh = thinned(&each.mesh, most);
        let frame = match each.frame {
            MovesWith::Base => -2,
            MovesWith::World => -1,
            MovesWith::Link(link) => i64::try_from(link).expect("six links"),
            MovesWith::Flange => 6,
        };
        json!({
            "group": each.group,
            "frame": frame,
            "color": each.color_rgba,
            "surface": surface(pack, &mesh),
        })
    });
    parts.collect()
}

/// The document's part on what a cell looks like.
pub(super) fn surroundings(resolved: &ResolvedScenario, pack: &mut Pack) -> Value {
    let cell = &resolved.cell;
    let (robot, tool) = (&cell.robot, &cell.tool);
    let parts = finish(surfaces_of_cell(resolved), pack, MOST_TRIANGLES);
    json!({
        "chain": chain(&robot.world_from_base_link, &robot.chain),
        "guide": [pose(&tool.flange_from_guide_entry), pose(&tool.flange_from_guide_exit)],
        "needleLength": tool.needle.length_m,
        "parts": parts,
    })
}

/// The arm of a scenario alone: its chain and the links that move.
pub(super) fn arm(robot: &Robot, pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    surfaces.add_links(robot);
    json!({
        "chain": chain(&robot.world_from_base_link, &robot.chain),
        "parts": finish(surfaces, pack, MOST_TRIANGLES),
    })
}

/// Triangles of a surface of which there may be many kinds on a page.
const MOST_TRIANGLES_OF_A_KIND: usize = 3000;

/// A tool, in the flange's frame.
pub(super) fn tool(tool: &Tool, pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    surfaces.add_tool(tool);
    json!({
        "guide": [pose(&tool.flange_from_guide_entry), pose(&tool.flange_from_guide_exit)],
        "parts": finish(surfaces, pack, MOST_TRIANGLES_OF_A_KIND),
    })
}

/// The link of an arm that does not move, in its own frame.
pub(super) fn base(robot: &Robot, pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    let (link, here) = (&robot.base, Pose::identity());
    surfaces.add_body(
        "robot",
        MovesWith::World,
        &link.visuals,
        &link.solids,
        &here,
    );
    Value::Array(finish(surfaces, pack, MOST_TRIANGLES))
}

/// Parts of a patient, in the frame that they are in.
pub(super) fn tissues(parts: &[PhantomPart], pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    for part in parts {
        surfaces.add_tissue(part, &Pose::identity());
    }
    Value::Array(finish(surfaces, pack, MOST_TRIANGLES_OF_A_KIND))
}

/// Something that stands in the room, in the frame that it is in.
pub(super) fn fixture(fixture: &Fixture, pack: &mut Pack) -> Value {
    let mut surfaces = Surfaces::default();
    surfaces.add_fixture(fixture, MovesWith::World, &Pose::identity());
    Value::Array(finish(surfaces, pack, MOST_TRIANGLES))
}
