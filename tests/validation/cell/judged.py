"""Motions of other planners, judged by needlebench, against Coal, Pinocchio and the planners' own figures.

    cargo build --release -p needlebench -p needlebench-programs-cell
    env/bin/python tests/validation/cell/judged.py --program target/release/needlebench \
        --exporter target/release/cell_export

For cells of arms of several sizes, with and without obstacles, to the configurations of a goal and to random postures:

- **straight lines** of the joints between way points, **cubics** through the points of a time-optimal motion, and what
  **Ruckig** plans at the controller's period. Every certified clearance is held against Coal's distances along the
  course as NumPy evaluates it, densely and refined at the least of them: it lies below all of them, and no farther than
  the scenario's tolerance below what is attained. Largest speeds and accelerations are those of the course.
- motions that pass **through the skin by 0.3 mm between two way points** that are clear of it, and the same just above:
  the first fail by the name of the class, the others are told their clearance.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from cell import JOINTS, ROOT, Cell, build_cell
from ruckig import InputParameter, Result, Ruckig, Trajectory

Array = np.ndarray
Course = Callable[[float], Array]

SCENARIOS = ["table3", "hanging", "ur5e", "ur10", "ur20"]
# To so many random postures besides the configurations of the scenario's first goal.
RANDOM = 2
# Between two looks of Coal's, s.
LOOK_S = 0.02
# Golden section, 1 / phi.
GOLDEN = 0.6180339887498949
REFINEMENTS = 16
# Coal's error while bodies are apart, as `compare.py` measures it, m; and below this it is no judge of depths.
COAL_M = 1e-6
# The certificate's bound is at most so far below what is attained, m: `planning.certificate_tolerance_mm`'s default, 0.1.
TIGHT_M = 1.05e-4
# Peaks are looked for every 2 ms, and between way points.
PEAK = 1e-3
# Half the way between two points beside the skin, and how deep it passes between them, m.
HALF_M = 0.04
THROUGH_M = 3e-4
# Of controllers of the CB3 series and of the e-Series, s.
PERIOD_S, E_PERIOD_S = 0.008, 0.002
# Of scenarios that give none.
START_DEG = [0.0, -90.0, -60.0, -90.0, 90.0, 0.0]
# Limits of motions: speed, acceleration, jerk, as scenarios have them by default.
LIMITS = [math.radians(each) for each in (60.0, 80.0, 570.0)]
SKIN = ("guide_standoff", "tool_phantom", "robot_phantom")

worst: dict[str, float] = {}
counts: dict[str, int] = {}


def hold(name: str, value: float, limit: float, where: str) -> None:
    worst[name] = max(worst.get(name, -math.inf), float(value))
    assert value <= limit, f"{where}: {name}: {value} is more than {limit}"


@dataclass
class Motion:
    """Points with times, and what joins them, evaluated here."""

    name: str
    times: Array
    positions: Array
    velocities: Array | None = None
    accelerations: Array | None = None

    def write(self, path: Path) -> None:
        columns = [("", self.positions), ("_velocity", self.velocities), ("_acceleration", self.accelerations)]
        given = [(suffix, values) for suffix, values in columns if values is not None]
        with path.open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["time_s", *(f"{joint}{suffix}" for suffix, _ in given for joint in JOINTS)])
            for k, time in enumerate(self.times):
                rows.writerow([repr(float(time)), *(repr(float(x)) for _, values in given for x in values[k])])

    def at(self, time: float) -> Array:
        """Positions: straight, cubic by Hermite's basis, or the quintic of both ends."""
        k = int(np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self.times) - 2))
        whole = self.times[k + 1] - self.times[k]
        s = (time - self.times[k]) / whole
        p, q = self.positions[k], self.positions[k + 1]
        if self.velocities is None:
            return p + s * (q - p)
        v, w = whole * self.velocities[k], whole * self.velocities[k + 1]
        if self.accelerations is None:
            return (
                (2 * s**3 - 3 * s**2 + 1) * p + (s**3 - 2 * s**2 + s) * v
                + (3 * s**2 - 2 * s**3) * q + (s**3 - s**2) * w
            )  # fmt: skip
        a, b = whole**2 * self.accelerations[k], whole**2 * self.accelerations[k + 1]
        return (
            (1 - 10 * s**3 + 15 * s**4 - 6 * s**5) * p + (s - 6 * s**3 + 8 * s**4 - 3 * s**5) * v
            + (s**2 - 3 * s**3 + 3 * s**4 - s**5) / 2 * a + (10 * s**3 - 15 * s**4 + 6 * s**5) * q
            + (7 * s**4 - 4 * s**3 - 3 * s**5) * w + (s**3 - 2 * s**4 + s**5) / 2 * b
        )  # fmt: skip


class Distances:
    """Signed distances by class, by Coal."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self.data = cell.model.createData()
        self.geometry_data = cell.geometry.createData()
        for request in self.geometry_data.distanceRequests:
            request.enable_signed_distance = True
            request.gjk_tolerance = request.epa_tolerance = 1e-10
            request.gjk_max_iterations = request.epa_max_iterations = 1000
        classes = [pair["class"] for pair in cell.header["pairs"]]
        self.names = list(dict.fromkeys(classes))
        of_pair = np.array([self.names.index(name) for name in classes])
        self.class_of = of_pair[cell.pair_of]

    def at(self, q: Array) -> Array:
        """The least of each class, m."""
        pin.computeDistances(self.cell.model, self.data, self.cell.geometry, self.geometry_data, q)
        found = np.array([result.min_distance for result in self.geometry_data.distanceResults])
        # Where Coal gives up.
        found[found < -1e6] = np.inf
        least = np.full(len(self.names), np.inf)
        np.minimum.at(least, self.class_of, found)
        return least

    def least(self, course: Course, begin_s: float, end_s: float) -> dict[str, tuple[float, float]]:
        """The least of each class along a course and when: on a grid, and by golden section about its lowest place."""
        times = np.linspace(begin_s, end_s, max(3, math.ceil((end_s - begin_s) / LOOK_S)))
        rows = np.array([self.at(course(time)) for time in times])
        found = {}
        for index, name in enumerate(self.names):
            k = int(rows[:, index].argmin())
            value, when = float(rows[k, index]), float(times[k])
            if not np.isfinite(value):
                continue
            low, high = times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)]
            if value > 0.0:
                for _ in range(REFINEMENTS):
                    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
                    fa, fb = (self.at(course(x))[index] for x in (a, b))
                    low, high = (low, b) if fa < fb else (a, high)
                    if min(fa, fb) < value:
                        value, when = float(min(fa, fb)), float(a if fa < fb else b)
            found[name] = (value, when)
        return found


def judged(program: Path, scenario: Path, motion: Motion, folder: Path) -> dict:
    """What `judge --free` says of a motion."""
    path = folder / f"{motion.name}.csv"
    motion.write(path)
    command = [program, "judge", scenario, "--motion", path, "--free", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), f"{motion.name}: {done.stderr}"
    return json.loads(done.stdout)


def check(program: Path, scenario: Path, distances: Distances, motion: Motion, folder: Path) -> dict:
    """Holds what needlebench says of a motion against Coal along its course."""
    answer = judged(program, scenario, motion, folder)
    where = f"{scenario.stem} {motion.name}"
    counts["motions"] = counts.get("motions", 0) + 1
    assert abs(answer["duration_s"] - (motion.times[-1] - motion.times[0])) < 1e-9, where
    theirs = distances.least(motion.at, motion.times[0], motion.times[-1])
    for name, ours in answer["clearance"].items():
        if name not in theirs or not isinstance(ours, dict):
            continue
        counts["certified clearances"] = counts.get("certified clearances", 0) + 1
        attained, bound, (value, _) = ours["minimum_m"], ours["certified_lower_bound_m"], theirs[name]
        at_ours = distances.at(motion.at(ours["time_s"]))[distances.names.index(name)]
        if min(attained, value, at_ours) <= COAL_M:
            # Of depths Coal says little, of the sign all that counts.
            assert attained <= COAL_M and bound <= COAL_M, f"{where} {name}: {attained}, {bound}, Coal {value}"
            counts["of them penetrating"] = counts.get("of them penetrating", 0) + 1
            continue
        hold("certified bound above Coal's least (m)", bound - value, COAL_M, f"{where} {name}")
        hold("certified bound below what is attained (m)", attained - bound, TIGHT_M, f"{where} {name}")
        hold("attained against Coal there (m)", abs(attained - at_ours), COAL_M, f"{where} {name}")
        hold("attained above Coal's least (m)", attained - value, TIGHT_M, f"{where} {name}")
    return answer


def ruckig(start: Array, end: Array) -> Trajectory:
    """A time-optimal motion within the limits, from rest to rest."""
    asked = InputParameter(6)
    asked.current_position, asked.target_position = list(start), list(end)
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = ([each] * 6 for each in LIMITS)
    motion = Trajectory(6)
    assert Ruckig(6).calculate(asked, motion) in (Result.Working, Result.Finished)
    return motion


def ruckig_motions(start: Array, end: Array, period_s: float, name: str) -> list[Motion]:
    """The same motion with accelerations at every set-point, and with velocities at each tenth."""
    planned = ruckig(start, end)
    found = []
    for step, kind in ((1, "quintics"), (10, "cubics")):
        count = max(2, math.ceil(planned.duration / (step * period_s)))
        times = np.append(np.arange(count) * step * period_s, planned.duration)
        times = times[np.append(np.diff(times) > 1e-4, True)]
        rows = [np.array(each) for each in zip(*(planned.at_time(time) for time in times), strict=True)]
        accelerations = rows[2] if step == 1 else None
        found.append(Motion(f"{name}-ruckig-{kind}", times, rows[0], rows[1], accelerations))
    return found


def straight(start: Array, end: Array, speed: float, name: str) -> Motion:
    times = np.linspace(0.0, np.abs(end - start).max() / speed, 13)
    return Motion(f"{name}-lines", times, np.linspace(start, end, 13))


def check_peaks(cell: Cell, answer: dict, motion: Motion, gravity: float, rotors: Array, where: str) -> None:
    """Largest speed and torque, and where its accelerations are continuous the largest of these, by differences along
    the course, the URDF's limits and Pinocchio's dynamics."""
    peaks = {each["criterion"]: each for each in answer["peaks"]}
    limits = {"joint_speed": cell.model.velocityLimit, "joint_torque": cell.model.effortLimit}
    step = 1e-4
    times = np.arange(motion.times[0] + step, motion.times[-1] - step, 1e-3)
    # Not across a way point, where a straight line has a corner.
    times = times[np.abs(times[:, None] - motion.times[None]).min(axis=1) > 1.5 * step]
    before, at, after = (np.array([motion.at(time + off) for time in times]) for off in (-step, 0.0, step))
    speeds, accelerations = (after - before) / (2 * step), (after - 2 * at + before) / step**2
    cell.model.gravity.linear = np.array([0.0, 0.0, -gravity])
    data = cell.model.createData()
    torques = np.array(
        [pin.rnea(cell.model, data, *row).copy() for row in zip(at, speeds, accelerations, strict=True)]
    )
    # Rotors turn with their joints: their inertia, as reflected to these, is no link's.
    torques += rotors * accelerations
    quantities = {"joint_speed": np.abs(speeds) / limits["joint_speed"], "joint_torque": np.abs(torques) / limits["joint_torque"]}
    if motion.accelerations is not None:
        quantities["joint_acceleration"] = np.abs(accelerations) / peaks["joint_acceleration"]["limit"]
    for criterion, shares in quantities.items():
        stated = peaks[criterion]
        ours, theirs = abs(stated["value"]) / stated["limit"], shares.max()
        hold(f"{criterion} against differences and Pinocchio, share of the limit", abs(ours - theirs), PEAK, where)


def through_skin(cell: Cell, distances: Distances, q: Array, depth_m: float) -> Motion:
    """Two way points beside a held posture, clear of the skin, between which the joints' straight line passes through it
    by `depth_m` (above it where that is negative)."""
    model, data = cell.model, cell.model.createData()
    pin.framesForwardKinematics(model, data, q)
    exit_frame = model.getFrameId("guide_exit")
    inverse = np.linalg.inv(pin.computeFrameJacobian(model, data, q, exit_frame, pin.LOCAL_WORLD_ALIGNED))
    sideways, other, axis = data.oMf[exit_frame].rotation.T
    skin = [index for index, name in enumerate(distances.names) if name in SKIN]

    def ways(across: Array, depth: float) -> tuple[Array, Array]:
        moved = [np.append(side * HALF_M * across + depth * axis, np.zeros(3)) for side in (-1.0, 1.0)]
        return q + inverse @ moved[0], q + inverse @ moved[1]

    def least(a: Array, b: Array, count: int) -> float:
        return min(distances.at(a + share * (b - a))[skin].min() for share in np.linspace(0.0, 1.0, count))

    def clear(across: Array) -> float:
        """By how much nearer the middle comes than the ends."""
        a, b = ways(across, 0.0)
        return min(distances.at(each)[skin].min() for each in (a, b)) - least(a, b, 9)

    angles = np.linspace(0.0, math.pi, 12, endpoint=False)
    across = max((math.cos(angle) * sideways + math.sin(angle) * other for angle in angles), key=clear)
    # The guide's axis points into the body.
    low, high = 0.0, 0.06
    assert least(*ways(across, low), 9) > -depth_m > least(*ways(across, high), 9)
    for _ in range(24):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if least(*ways(across, middle), 41) > -depth_m else (low, middle)
    a, b = ways(across, low)
    ends = min(distances.at(each)[skin].min() for each in (a, b))
    assert ends > 5e-4, f"the way points are {ends} m from the skin"
    return Motion("through-skin" if depth_m > 0.0 else "above-skin", np.array([0.0, 1.0]), np.array([a, b]))


def exported(exporter: Path, scenario: Path, folder: Path) -> Cell:
    command = [exporter, "--out", folder, "--seed", "3", "--postures", "20", str(scenario.relative_to(ROOT))]
    subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    return build_cell(folder / f"{scenario.stem}.json")


def check_scenario(program: Path, exporter: Path, name: str, folder: Path) -> None:
    """All motions of a scenario."""
    path = ROOT / "scenarios" / f"{name}.toml"
    settings = tomllib.loads(path.read_text())
    cell = exported(exporter, path, folder)
    distances = Distances(cell)
    command = [program, "run", path, "--engine", "rapier", "--no-page", "--no-pictures", "--quiet", "--json"]
    done = subprocess.run([*command, "--out", folder / "run"], capture_output=True, text=True, check=False)
    report = json.loads(done.stdout)
    start = np.radians(settings.get("start", {}).get("joints_deg", START_DEG))
    configurations = report["goals"][0]["configurations"][::2]
    ends = {each["label"]: np.array(each["joints_rad"]) for each in configurations}
    random = np.random.default_rng(5)
    ends |= {f"random-{k}": random.uniform(-math.pi, math.pi, 6) for k in range(RANDOM)}
    arm = settings.get("robot", {}).get("urdf", "ur3")
    rotors = np.array(tomllib.loads((ROOT / "models" / arm / "arm.toml").read_text())["rotors"]["inertia_kgm2"])
    gravity = report["gravity"]["world_m_s2"]
    period_s = E_PERIOD_S if arm.endswith(("e", "20", "30")) else PERIOD_S
    motions = []
    for label, end in ends.items():
        motions.append(straight(start, end, 0.2, label))
        motions += ruckig_motions(start, end, period_s, label)
    verdicts = []
    for motion in motions:
        answer = check(program, path, distances, motion, folder)
        check_peaks(cell, answer, motion, gravity, rotors, f"{name} {motion.name}")
        verdicts.append(answer["verdict"])
    held = next(each for each in report["goals"][0]["configurations"] if each["status"] == "ok")
    for depth_m in (THROUGH_M, -THROUGH_M):
        motion = through_skin(cell, distances, np.array(held["joints_rad"]), depth_m)
        answer = check(program, path, distances, motion, folder)
        least = min(found["minimum_m"] for key, found in answer["clearance"].items() if key in SKIN)
        hold("motions through and above the skin (m)", abs(least + depth_m), TIGHT_M, f"{name} {motion.name}")
        failed = {each["criterion"] for each in answer["criteria"] if not each["pass"]}
        assert answer["verdict"] == "fail" and failed & {f"min_clearance_mm.{each}" for each in SKIN}, failed
    print(f"{name}: {len(motions)} motions, {verdicts.count('pass')} pass, and two beside the skin", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--exporter", type=Path, required=True, help="the built `cell_export`")
    parser.add_argument("--only", help="one scenario")
    arguments = parser.parse_args()
    program, exporter = arguments.program.resolve(), arguments.exporter.resolve()
    for name in SCENARIOS:
        if arguments.only in (None, name):
            with tempfile.TemporaryDirectory() as folder:
                check_scenario(program, exporter, name, Path(folder))
    for name, value in {**counts, **worst}.items():
        print(f"  {name}: {value:.2g}" if isinstance(value, float) else f"  {name}: {value}")
    print(f"figure motions {counts['motions']}\nfigure clearances {counts['certified clearances']}")
    for name, key, scale in [
        ("attained_nm", "attained against Coal there (m)", 1e9),
        ("slack_um", "certified bound below what is attained (m)", 1e6),
        ("torque_percent", "joint_torque against differences and Pinocchio, share of the limit", 1e2),
    ]:
        print(f"figure {name} {worst[key] * scale:.3g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
