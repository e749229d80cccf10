"""The MJCF model in MuJoCo alone, against what needlebench says of the cell and recorded in it."""

import csv
import subprocess

import mujoco
import numpy as np
from common import JOINTS, LINKS, Array, Cell, Failed, Tally

# MuJoCo keeps vertices in single precision and looks for distances by its own GJK.
DISTANCE_M = 1e-7
# Its search for the depth of a penetration ends at 1e-6 by default (`ccd_tolerance`).
DEPTH_M = 5e-6
# Convex pieces of a surface that is not convex hold all of it, to this, m.
COVERED_M = 2e-5
# Positions, velocities and torques of recordings are written to 1e-12 rad, 1e-12 rad/s and 1e-9 N m.
STEP_RAD, STEP_RAD_S = 2e-12, 1e-10
FRAME_M = 1e-12
# Steps without a look at the recording, and how far positions may be off by then.
STRETCH, STRETCH_RAD = 200, 1e-9
# Motions that are stepped again.
MOTIONS = 2
# Distances beyond this are not looked for, m.
FAR_M = 5.0


def body_of(geom: str) -> str:
    """The body of needlebench that a geom is of."""
    return geom.split("/")[0]


def load(path: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The model as anybody opens it, without a warning."""
    model = mujoco.MjModel.from_xml_path(str(path))
    return model, mujoco.MjData(model)


def check_structure(model: mujoco.MjModel) -> None:
    """Names, motors and keyframes."""
    joints = [model.joint(i).name for i in range(model.njnt)]
    links = [model.body(i).name for i in range(1, model.nbody)]
    if joints != JOINTS or links != LINKS or model.nu != 6 or model.key(0).name != "start":
        raise Failed(f"joints {joints}, links {links}, {model.nu} motors")


def enabled(model: mujoco.MjModel) -> set[frozenset[str]]:
    """Pairs of bodies that can touch."""
    found = set()
    for a in range(model.ngeom):
        mask = (model.geom_contype[a] & model.geom_conaffinity) | (
            model.geom_contype & model.geom_conaffinity[a]
        )
        for b in np.flatnonzero(mask):
            found.add(frozenset((body_of(model.geom(a).name), body_of(model.geom(int(b)).name))))
    return found


def check_distances(
    cell: Cell, path: str, postures: list[Array], far: Tally, deep: list, pieces: list
) -> None:
    """`mj_geomDistance` of every pair against `needlebench clearance`."""
    model, data = load(path)
    check_structure(model)
    geoms: dict[str, list[int]] = {}
    for geom in range(model.ngeom):
        geoms.setdefault(body_of(model.geom(geom).name), []).append(geom)
    for number, q in enumerate(postures):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        ours = cell.clearances(q)
        if number == 0:
            physical = {
                frozenset(pair)
                for pair, each in ours.items()
                if each["class"] != "needle_corridor"
            }
            if enabled(model) != physical:
                raise Failed(f"pairs that can touch: {enabled(model) ^ physical}")
        for (a, b), each in ours.items():
            wanted = each["distance_m"]
            theirs = min(
                mujoco.mj_geomDistance(model, data, first, second, FAR_M, None)
                for first in geoms[a]
                for second in geoms[b]
            )
            where = f"{cell.name}, {a} and {b}: {wanted} against {theirs}"
            # A surface that is not convex: `body/solid/number` by number of the piece.
            if any(model.geom(geom).name.count("/") == 2 for geom in geoms[a] + geoms[b]):
                pieces.append((theirs - wanted, where))
                if wanted > 0.0 and theirs - wanted > COVERED_M:
                    raise Failed(f"pieces leave something out: {where}")
            elif wanted > 0.0:
                far.add(theirs - wanted, where)
            else:
                deep.append((theirs - wanted, where))
                if not abs(theirs - wanted) <= DEPTH_M:
                    raise Failed(f"another depth: {where}")


def check_frames(cell: Cell, path: str, postures: list[Array], tally: Tally) -> None:
    """The flange against `fk`, at the scenario's place of the robot."""
    model, data = load(path)
    for q in postures:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        wanted = cell.world_from_base_link() @ cell.base_link_from_flange(q)
        site = data.site("tool0")
        tally.add(np.abs(site.xpos - wanted[:3, 3]).max(), f"{cell.name}: tool0")
        turn = np.abs(site.xmat.reshape(3, 3) - wanted[:3, :3]).max()
        tally.add(turn, f"{cell.name}: turn of tool0")


def recorded(cell: Cell, path: str) -> list[dict[str, Array]]:
    """Recordings of MuJoCo's motions with every step, of the scenario with that period alone changed."""
    folder = cell.folder / "recorded"
    text = cell.scenario.read_text()
    model, _ = load(path)
    period = f"period_ms = {1e3 * model.opt.timestep!r}"
    if "[recording]" in text:
        raise Failed(f"{cell.name} has a [recording] of its own")
    scenario = cell.folder / f"{cell.name}_every_step.toml"
    scenario.write_text(f"{text}\n[recording]\n{period}\n")
    command = [cell.program, "run", scenario, "--engine", "mujoco", "--out", folder]
    subprocess.run([*command, "--no-pictures", "--quiet"], check=False, capture_output=True)
    found = []
    for file in sorted(folder.glob("**/*.mujoco.csv"))[:MOTIONS]:
        with file.open() as lines:
            rows = list(csv.DictReader(lines))
        labels = [name.removesuffix("_joint") for name in JOINTS]

        def columns(quantity: str, rows: list[dict] = rows, labels: list[str] = labels) -> Array:
            return np.array([[float(row[f"{each}_{quantity}"]) for each in labels] for row in rows])

        found.append(
            {
                "q": columns("position_rad"),
                "qd": columns("velocity_rad_s"),
                "torque": columns("torque_nm"),
            }
        )
    if not found:
        raise Failed(f"{cell.name}: no recordings of MuJoCo in {folder}")
    return found


def check_motion(cell: Cell, path: str, position: Tally, velocity: Tally, stretch: Tally) -> None:
    """Each recorded state, one step on under the recorded torque, is the next one; and stretches of a motion."""
    model, data = load(path)
    for number, motion in enumerate(recorded(cell, path)):
        q, qd, torque = motion["q"], motion["qd"], motion["torque"]
        for k in range(len(q) - 1):
            data.qpos[:], data.qvel[:], data.ctrl[:] = q[k], qd[k], torque[k + 1]
            data.qacc_warmstart[:] = 0.0
            mujoco.mj_step(model, data)
            where = f"{cell.name}, motion {number}, step {k}"
            position.add(np.abs(data.qpos - q[k + 1]).max(), where)
            velocity.add(np.abs(data.qvel - qd[k + 1]).max(), where)
        # Without a servo an arm under gravity falls away from its motion as a pendulum on its head does: rounding grows.
        for first in range(0, len(q) - STRETCH, STRETCH):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = q[first], qd[first]
            for k in range(first, first + STRETCH):
                data.ctrl[:] = torque[k + 1]
                mujoco.mj_step(model, data)
            where = f"{cell.name}, motion {number}, from row {first}"
            stretch.add(np.abs(data.qpos - q[first + STRETCH]).max(), where)
