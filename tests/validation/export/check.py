"""Exports of cells in the tools that they are for, against what needlebench says of the same cells.

    cargo build --release
    python3 -m venv env && env/bin/pip install -r tests/validation/requirements.txt
    env/bin/python tests/validation/export/check.py --program target/release/needlebench

MuJoCo opens the MJCF models, Pinocchio and Coal the URDF and SRDF files, Khronos's validator the
glTF files. Compared are pairs, distances, frames, masses, and the motion under recorded torques.
Exit status 1 where anything is beyond its limit.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import check_gltf
import check_mjcf
import check_urdf
import numpy as np
from common import ROOT, Cell, Failed, Tally

# Cells with people and a gantry; hanging among obstacles; another arm; every shape there is; a patient of surfaces.
SCENARIOS = [
    "scenarios/table3.toml",
    "scenarios/supine_suite.toml",
    "scenarios/hanging.toml",
    "scenarios/ur5e.toml",
    "tests/validation/cell/cells/every_shape.toml",
    "tests/validation/cell/cells/hanging_chest.toml",
]
# Its recordings are stepped again.
RECORDED = "table3"
POSTURES = 6


def postures(start: np.ndarray, named: dict[str, np.ndarray]) -> list[np.ndarray]:
    """The start posture, some that serve goals, and some at random."""
    random = np.random.default_rng(7)
    served = [q for name, q in sorted(named.items()) if name != "start"][: POSTURES // 2]
    return [start, *served, *random.uniform(-np.pi, np.pi, (POSTURES // 2, 6))]


def main() -> int:
    """Check all scenarios, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", type=Path, default=ROOT / "target/release/needlebench")
    parser.add_argument("scenarios", nargs="*", type=Path)
    arguments = parser.parse_args()
    scenarios = [path.resolve() for path in arguments.scenarios]
    tallies = {
        "mjcf": Tally("MuJoCo: distances", check_mjcf.DISTANCE_M, "m"),
        "mjcf frames": Tally("MuJoCo: frames", check_mjcf.FRAME_M, "m"),
        "step": Tally("MuJoCo: positions after a step", check_mjcf.STEP_RAD, "rad"),
        "speed": Tally("MuJoCo: speeds after a step", check_mjcf.STEP_RAD_S, "rad/s"),
        "stretch": Tally("MuJoCo: positions after 200 steps", check_mjcf.STRETCH_RAD, "rad"),
        "urdf": Tally("Coal: distances", check_urdf.DISTANCE_M, "m"),
        "urdf frames": Tally("Pinocchio: frames and states", check_urdf.FRAME_M, "m"),
        "dynamics": Tally("Pinocchio: masses", check_urdf.DYNAMICS, "kg, kg m2, N m"),
        "gltf": Tally("glTF: nodes", check_gltf.FRAME_M, "m"),
    }
    deep: list[tuple[float, str]] = []
    pieces: list[tuple[float, str]] = []
    pictures: list[Path] = []
    try:
        with tempfile.TemporaryDirectory() as folder:
            for path in scenarios or [ROOT / each for each in SCENARIOS]:
                check(Cell(arguments.program.resolve(), path, Path(folder)), tallies, [deep, pieces], pictures)
            lines = [check_gltf.validate(pictures)]
        recorded = any(path.stem == RECORDED for path in scenarios) or not scenarios
        lines += [
            tally.line()
            for key, tally in tallies.items()
            if recorded or key not in ("step", "speed", "stretch")
        ]
    except Failed as failed:
        print(f"FAILED: {failed}")
        return 1
    print("\n".join(lines))
    print("\n".join(tally.figure() for tally in tallies.values() if tally.count))
    if deep:
        size = [abs(difference) for difference, _ in deep]
        print(
            f"  MuJoCo, within each other: {len(deep)} pairs touch in both; depths differ by "
            f"{np.median(size):.1e} m in the middle, {max(size):.1e} m at most: {max(deep)[1]}"
        )
    if pieces:
        print(
            f"  MuJoCo, surfaces as convex pieces: {len(pieces)} pairs, nearer than the surface by "
            f"{-min(pieces)[0]:.1e} m at most, farther by {max(max(pieces)[0], 0.0):.1e} m"
        )
    return 0


def check(cell: Cell, tallies: dict[str, Tally], apart: list[list], pictures: list[Path]) -> None:
    """Everything of one scenario."""
    name = cell.name
    mjcf = cell.export("mjcf", f"{name}.xml")
    urdf = cell.export("urdf", f"{name}.urdf")
    model, _ = check_mjcf.load(mjcf)
    named = {model.key(i).name: model.key(i).qpos.copy() for i in range(model.nkey)}
    cell.start = named["start"]
    at = postures(cell.start, named)
    check_mjcf.check_distances(cell, mjcf, at, tallies["mjcf"], *apart)
    check_mjcf.check_frames(cell, mjcf, at, tallies["mjcf frames"])
    if name == RECORDED:
        motion = (tallies[key] for key in ("step", "speed", "stretch"))
        check_mjcf.check_motion(cell, mjcf, *motion)
    check_urdf.check_distances(cell, urdf, at, tallies["urdf"])
    check_urdf.check_frames(cell, urdf, at, tallies["urdf frames"])
    check_urdf.check_dynamics(cell, urdf, at, tallies["dynamics"])

    pictures.append(cell.export("gltf", f"{name}.glb"))
    check_gltf.check_frames(cell, pictures[-1], cell.start, tallies["gltf"])
    joints = ",".join(repr(float(value)) for value in at[-1])
    pictures.append(cell.export("gltf", f"{name}_joints.glb", "--joints", joints))
    check_gltf.check_frames(cell, pictures[-1], at[-1], tallies["gltf"])
    goal = next((each for each in sorted(named) if each != "start"), None)
    if goal is not None:
        goal, configuration = goal.rsplit("/", 1)
        words = ("--goal", goal, "--configuration", configuration)
        pictures.append(cell.export("gltf", f"{name}_goal.glb", *words))
        q = check_gltf.check_animation(cell, pictures[-1], tallies["gltf"])
        check_gltf.check_frames(cell, pictures[-1], q, tallies["gltf"])
    print(f"{name}: {len(at)} postures")


if __name__ == "__main__":
    sys.exit(main())
