#!/usr/bin/env python3
"""Exported motions, read back by what others read them with.

For motions of shipped scenarios:

- **MCAP**: read by `mcap-ros2-support`, by the definitions in the file, and by `rosbags`, by definitions of its own
  (ROS 2 Humble). Joint states, torques, contact forces and clearances are those of the CSV recording of the same
  run, times to the nanosecond; frames of `/tf` and `/tf_static` give the flange of the CSV and of the maker's DH lengths.
- **joint trajectory**: JSON, YAML and CSV say the same; splines of SciPy through its points stay as near to the planned motion
  (`/joint_states_planned`) as the file says, within the limits of speed and acceleration.
- **URScript**: a stand-in carries the program out; the guide's exit passes where the program says and where the plan does.
- **rerun**: the recording that `motion_to_rerun.py` makes passes `rerun rrd verify`, the MCAP file `rerun mcap check`.
- the same bytes each time, from `run --record mcap` and from `export`.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np
import yaml
from common import JOINTS, LINKS, ROOT
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from motion_to_rerun import convert
from rosbags.typesys import Stores, get_typestore
from scipy.interpolate import BPoly, CubicHermiteSpline
from urscript_standin import Controller, forward, transform

# Beside the interpreter that runs this.
RERUN = pathlib.Path(sys.executable).parent / "rerun"

# Scenario, goal (None: its only one), configuration (None: the recommended one). The arm that is parked low goes
# around the patient.
MOTIONS = [
    ("table3", None, None),
    ("hanging", None, None),
    ("ur5e", "left_upper_anterior", None),
    ("imperfect", "left_upper_anterior", None),
    ("parked_low", "right_pleural_lateral", None),
]

# The CSV recording has 12 decimals of positions, 9 of torques and clearances, 6 of forces.
POSITION = 1e-9
CSV_NINE = 1e-9
CSV_FORCE = 1e-6
# Products of six unit quaternions against products of matrices.
FRAME = 1e-9
PATH_M = 1e-6
# What is measured between other places than the file's, at most twice as much.
BETWEEN = 2.0

LABELS = [each.removesuffix("_joint") for each in JOINTS]

worst: dict[str, float] = {}


def hold(name: str, value: float, limit: float) -> None:
    worst[name] = max(worst.get(name, 0.0), float(value))
    assert value <= limit, f"{name}: {value} is more than {limit}"


def quat_matrix(q) -> np.ndarray:
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def matrix(of) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3] = quat_matrix(of.rotation)
    made[:3, 3] = [of.translation.x, of.translation.y, of.translation.z]
    return made


def stamp_ns(stamp) -> int:
    return stamp.sec * 1_000_000_000 + stamp.nanosec


class Recording:
    """An MCAP file, read by two readers."""

    def __init__(self, data: bytes) -> None:
        reader = make_reader(io.BytesIO(data), decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        assert "needlebench" in reader.get_header().library
        self.metadata = {each.name: each.metadata for each in reader.iter_metadata()}["needlebench"]
        humble = get_typestore(Stores.ROS2_HUMBLE)
        self.topics: dict[str, list] = {}
        self.types: dict[str, str] = {}
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema.encoding == "ros2msg" and channel.message_encoding == "cdr"
            assert message.log_time == message.publish_time
            self.types[channel.topic] = schema.name
            # By definitions that are not ours, and back to the same bytes.
            other = humble.deserialize_cdr(message.data, schema.name)
            assert bytes(humble.serialize_cdr(other, schema.name)) == message.data, channel.topic
            self.topics.setdefault(channel.topic, []).append((message.log_time, decoded))

    def states(self, topic: str):
        times, rows = [], []
        for time, state in self.topics[topic]:
            assert list(state.name) == JOINTS and stamp_ns(state.header.stamp) == time
            times.append(time)
            rows.append([*state.position, *state.velocity, *state.effort])
        return np.array(times), np.array(rows)

    def flange(self, row: int, from_frame: str, to_frame: str) -> np.ndarray:
        """Pose of a frame in one above it, by `/tf` and `/tf_static`."""
        parents = {}
        for each in (*self.topics["/tf_static"][0][1].transforms, *self.topics["/tf"][row][1].transforms):
            parents[each.child_frame_id] = (each.header.frame_id, matrix(each.transform))
        pose, frame = np.eye(4), to_frame
        while frame != from_frame:
            frame, step = parents[frame]
            pose = step @ pose
        return pose


def check_recording(mcap: Recording, rows: list[dict], nominal: bool) -> None:
    assert mcap.types["/joint_states"] == "sensor_msgs/msg/JointState"
    assert mcap.types["/tf"] == mcap.types["/tf_static"] == "tf2_msgs/msg/TFMessage"
    assert mcap.types["/cell"] == "visualization_msgs/msg/MarkerArray"
    times, actual = mcap.states("/joint_states")
    planned_times, planned = mcap.states("/joint_states_planned")
    assert len(rows) == len(times)
    csv_ns = np.array([round(float(row["time_s"]) * 1e9) for row in rows])
    assert (times == csv_ns).all() and (planned_times == csv_ns).all(), "times to the nanosecond"

    def column(quantity: str) -> np.ndarray:
        return np.array([[float(row[f"{label}_{quantity}"]) for label in LABELS] for row in rows])

    hold("positions (rad)", np.abs(actual[:, :6] - column("position_rad")).max(), POSITION)
    hold("velocities (rad/s)", np.abs(actual[:, 6:12] - column("velocity_rad_s")).max(), POSITION)
    hold("efforts (N m)", np.abs(actual[:, 12:] - column("torque_nm")).max(), CSV_NINE)
    hold("planned positions (rad)", np.abs(planned[:, :6] - column("reference_rad")).max(), POSITION)
    force = [each.data for _, each in mcap.topics["/contact/normal_force"]]
    hold("contact (N)", np.abs(np.array(force) - [float(r["rigid_contact_force_n"]) for r in rows]).max(), CSV_FORCE)
    classes = [topic for topic in mcap.topics if topic.startswith("/clearance/")]
    assert classes
    for topic in classes:
        ours = np.array([each.data for _, each in mcap.topics[topic]])
        theirs = np.array([float(row[f"{topic.rsplit('/', 1)[1]}_m"]) for row in rows])
        hold("clearances (m)", np.abs(ours - theirs).max(), CSV_NINE)
    phases = [(time, each.data) for time, each in mcap.topics["/phase"]]
    assert [name for _, name in phases] == list(dict.fromkeys(row["phase"] for row in rows))
    arm = mcap.metadata["arm"]
    for row in range(0, len(rows), max(1, len(rows) // 60)):
        world = mcap.flange(row, "world", "tool0")
        csv_place = [float(rows[row][f"flange_{axis}_m"]) for axis in "xyz"]
        hold("flange by /tf against the engine's (m)", np.abs(world[:3, 3] - csv_place).max(), FRAME)
        if nominal:
            base = np.linalg.inv(mcap.flange(row, "world", "base")) @ world
            by_dh = forward(arm, actual[row, :6])
            hold("flange by /tf against DH (m, 1)", np.abs(base - by_dh).max(), FRAME)
    if nominal:
        # What the guide is for: planned entry and target on its axis at the end, the tip where the target is.
        end = np.linalg.inv(mcap.flange(len(rows) - 1, "world", "guide_exit"))
        target = end @ mcap.flange(0, "world", "planned_target")
        tip = mcap.flange(0, "guide_exit", "needle_tip")
        hold("needle tip at the end against the target (m)", np.abs((target - tip)[:3, 3]).max(), 1e-4)
    names = {each.ns for each in mcap.topics["/cell"][0][1].markers}
    assert {"planned_needle", "forearm", "tool", "guide_tube", "mount"} <= names, names
    assert {each.child_frame_id for each in mcap.topics["/tf"][0][1].transforms} == set(LINKS)


def check_trajectory(folder: pathlib.Path, mcap: Recording):
    (of_json,) = folder.glob("*.trajectory.json")
    stem = str(of_json).removesuffix(".json")
    document = json.loads(of_json.read_text())
    about, message = document["about"], document["joint_trajectory"]
    as_yaml = yaml.safe_load(pathlib.Path(stem + ".yaml").read_text())
    assert about["scenario_sha256"] == mcap.metadata["scenario_sha256"]
    for text in (pathlib.Path(stem + ".yaml").read_text(), pathlib.Path(stem + ".csv").read_text()):
        assert "NEVER RUN ON A ROBOT" in text and about["scenario_sha256"] in text
    assert message["joint_names"] == as_yaml["joint_names"] == JOINTS
    for point in message["points"]:
        point.pop("effort")
    assert message["points"] == as_yaml["points"], "YAML says what JSON does"
    lines = [line for line in pathlib.Path(stem + ".csv").read_text().splitlines() if line[0] != "#"]
    rows = [[float(cell) for cell in row] for row in csv.reader(lines[1:])]
    points = message["points"]
    flat = [
        [p["time_from_start"]["sec"], p["time_from_start"]["nanosec"], *p["positions"], *p["velocities"], *p["accelerations"]]
        for p in points
    ]
    assert rows == flat, "CSV says what JSON does"
    ns = np.array([row[0] * 10**9 + row[1] for row in flat])
    assert ns[0] == 0 and (np.diff(ns) > 0).all()
    q, qd, qdd = (np.array([row[2 + 6 * k : 8 + 6 * k] for row in flat]) for k in range(3))
    assert not qd[[0, -1]].any() and not qdd[[0, -1]].any(), "at rest at both ends"
    t = ns * 1e-9
    quintic = BPoly.from_derivatives(t, np.stack([q, qd, qdd], axis=1))
    cubic = CubicHermiteSpline(t, q, qd)
    times, planned = mcap.states("/joint_states_planned")
    inside = times <= ns[-1]
    at = times[inside] * 1e-9
    stated = about["interpolation"]
    hold("quintics against the plan (rad)", np.abs(quintic(at) - planned[inside, :6]).max(), BETWEEN * stated["quintic"]["joint_rad"])
    hold("cubics against the plan (rad)", np.abs(cubic(at) - planned[inside, :6]).max(), BETWEEN * stated["cubic"]["joint_rad"])
    assert stated["quintic"]["joint_rad"] <= 1e-6
    hold("planned speeds (rad/s)", np.abs(quintic(at, 1) - planned[inside, 6:]).max(), 1e-3)
    # Limits hold between points too.
    fine = np.linspace(0.0, t[-1], 50_001)
    for order, key in ((1, "velocity_rad_s"), (2, "acceleration_rad_s2")):
        used = np.abs(quintic(fine, order)).max(axis=0) / np.array(about["limits"][key])
        hold(f"share of the limit of {key.split('_')[0]}", used.max(), 1.0 + 1e-3)
    # Integrated by itself: positions are what velocities add up to.
    hold("speeds against positions (rad)", np.abs(quintic.derivative().integrate(0.0, t[-1]) - (q[-1] - q[0])).max(), 1e-9)
    assert about["clearance"], "what works is certified"
    return about, quintic


def check_script(folder: pathlib.Path, about: dict, quintic, nominal_arm: str) -> None:
    (path,) = folder.glob("*.script")
    text = path.read_text()
    assert text.isascii() and "NEVER RUN ON A ROBOT" in text and about["scenario_sha256"] in text
    start = quintic(0.0)
    controller = Controller(start)
    controller.run(text)
    assert controller.halted and not any(error for _, error in controller.popups)
    # From elsewhere it does not move at all.
    for joint in range(6):
        off = np.array(start)
        off[joint] += math.radians(2.0)
        elsewhere = Controller(off)
        elsewhere.run(text)
        assert elsewhere.halted and not elsewhere.moves and elsewhere.popups[-1][1]
    mass, centre = controller.payload
    hold("payload (kg)", abs(mass - about["payload"]["mass_kg"]), 5.1e-5)
    hold("centre of the payload (m)", np.abs(np.array(centre) - about["payload"]["com_in_flange_m"]).max(), 5.1e-6)
    tcp = transform([*about["tcp"]["position_in_flange_m"], *about["tcp"]["rotvec_in_flange_rad"]])
    hold("TCP (m, 1)", np.abs(controller.tcp - tcp).max(), 1e-8)
    # The first move goes to the start posture itself.
    assert controller.moves[0].kind == "movej" and np.abs(controller.moves[0].end - start).max() < 1e-9
    moves = controller.moves[1:]
    rows = re.findall(r"^  # path (\d+) (\S+) (\S+) (\S+) (\S+)$", text, re.MULTILINE)
    assert {int(row[0]) for row in rows} == set(range(1, len(moves) + 1))

    def guide(q) -> np.ndarray:
        return (forward(nominal_arm, q) @ controller.tcp)[:3, 3]

    for number, at, *place in rows:
        move = moves[int(number) - 1]
        share = float(at)
        q = move.at_share(share) if move.kind == "movej" else move.at_time(share * move.period_s)
        hold("path against what the program states (m)", np.abs(guide(q) - [float(x) for x in place]).max(), PATH_M)
    # The planned motion, by splines through the exported trajectory.
    period = 0.002 if "e" in nominal_arm else 0.008
    clock = 0.0
    limits = np.array(about["limits"]["velocity_rad_s"])
    # What the program says that it strays between set-points, a proven bound; the set-points themselves do not.
    (stray,) = re.findall(r"^  # (\d+\.\d+) um that the program strays", text, re.MULTILINE)
    stray_m = float(stray) * 1e-6
    said = [float(s) for s in re.findall(r"; (?:about )?(\d+\.\d+) s\.$", text, re.MULTILINE)]
    assert len(said) == len(moves)
    boundaries = [p for p in about["phases"] if p["phase"] != "hold"]
    for move, said_s in zip(moves, said, strict=True):
        hold("durations (s)", abs(move.duration_s - said_s), 5.1e-4)
        way = move.end - move.start
        if move.kind == "movej":
            assert move.speed_rad_s <= limits.min() + 1e-6 or move.speed_rad_s <= limits.max() + 1e-6
            lead = int(np.argmax(np.abs(way)))
            # When the plan passes the same postures.
            last = next(p for p in boundaries if np.abs(quintic(p["end_s"]) - move.end).max() < 1e-6)
            for time in np.linspace(clock, last["end_s"], 400):
                planned = quintic(time)
                share = (planned[lead] - move.start[lead]) / way[lead]
                apart = guide(move.at_share(share)) - guide(planned)
                hold("movej against the planned path (m)", np.abs(apart).max(), PATH_M)
            trace = np.array([move.at_time(s) for s in np.linspace(0.0, move.duration_s, 2001)])
            speed = np.abs(np.diff(trace, axis=0)).max() / (move.duration_s / 2000)
            hold("movej: speed over its v", speed / move.speed_rad_s, 1.0 + 1e-9)
            clock = last["end_s"]
        else:
            assert move.period_s == period, "the controller's own period"
            assert move.settle_s == 0.5, "the arm catches up"
            end = clock + move.duration_s
            for time in np.linspace(clock, end, 1201):
                apart = guide(move.at_time(time - clock)) - guide(quintic(time))
                hold("servoj against the planned motion, at each time (m)", np.abs(apart).max(), 2e-5)
            for k, q in enumerate(move.set_points, 1):
                apart = guide(q) - guide(quintic(min(clock + k * period, quintic.x[-1])))
                hold("servoj set-points against the planned motion (m)", np.abs(apart).max(), PATH_M)
            # As a path: whatever the time, the guide is on the planned path.
            dense = np.array([guide(quintic(s)) for s in np.linspace(clock, end, 4001)])
            for time in np.linspace(clock, end, 301):
                here = guide(move.at_time(time - clock))
                off = off_path(here, dense)
                hold("servoj straight between set-points against the planned path (m)", off, stray_m)
                hold("the same over what the program says of it", off / stray_m, 1.0)
            clock = next(p["end_s"] for p in boundaries if p["end_s"] > clock + 1e-9)


def off_path(point: np.ndarray, polygon: np.ndarray) -> float:
    """Distance of a point from a polygon."""
    a, b = polygon[:-1], polygon[1:]
    way = b - a
    length = (way * way).sum(axis=1)
    share = np.clip(((point - a) * way).sum(axis=1) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    return float(np.linalg.norm(a + share[:, None] * way - point, axis=1).min())


def call(program: pathlib.Path, *arguments: str, cwd: pathlib.Path) -> str:
    done = subprocess.run([program, *arguments], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), f"{arguments}: {done.stderr}"
    return done.stdout


def check(program: pathlib.Path, scenario: str, goal: str | None, configuration: str | None) -> None:
    file = ROOT / "scenarios" / f"{scenario}.toml"
    which = [*(["--goal", goal] if goal else []), *(["--configuration", configuration] if configuration else [])]
    with tempfile.TemporaryDirectory() as temporary:
        folders = [pathlib.Path(temporary) / each for each in ("one", "two")]
        made = []
        for folder in folders:
            folder.mkdir()
            # The second time MCAP alone: the others are made of the same plan.
            for form in ("mcap", "trajectory", "urscript")[: 3 if folder is folders[0] else 1]:
                call(program, "export", str(file), "--as", form, *which, cwd=folder)
            made.append({p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()})
        assert all(made[0][name] == data for name, data in made[1].items()), "the same bytes each time"
        (mcap_path,) = [p for p in made[0] if p.suffix == ".mcap"]
        folder = folders[0] / mcap_path.parent
        call(
            program, "run", str(file), "--engine", "rapier", "--record", "mcap", "--no-page", "--no-pictures", "--quiet", "--json",
            "--out", str(folders[0] / "run"), cwd=folders[0],
        )
        beside = folders[0] / "run" / scenario / mcap_path.parent.name / mcap_path.name
        assert beside.read_bytes() == made[0][mcap_path], "the same bytes of run and export"
        rows = list(csv.DictReader(beside.with_suffix(".csv").open()))
        mcap = Recording(made[0][mcap_path])
        assert mcap.metadata["scenario"] == scenario and len(mcap.metadata["scenario_sha256"]) == 64
        nominal = scenario != "imperfect"
        check_recording(mcap, rows, nominal)
        about, quintic = check_trajectory(folder, mcap)
        check_script(folder, about, quintic, about["arm"])
        rrd = folders[0] / "motion.rrd"
        convert(str(folders[0] / mcap_path), str(rrd))
        for command in (["rrd", "verify", str(rrd)], ["mcap", "check", str(folders[0] / mcap_path)]):
            done = subprocess.run([RERUN, *command], capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stdout + done.stderr
        replay = call(program, "replay", str(mcap_path), "--effort", "torque", "--arm", about["arm"], "--json", cwd=folders[0]) if nominal else ""
        assert not replay or json.loads(replay)
    print(f"{scenario}: {mcap_path.name}, {len(made[0][mcap_path]) // 1000} kB, {len(rows)} rows, {len(about['phases'])} phases")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, required=True)
    parser.add_argument("--only", help="one scenario")
    arguments = parser.parse_args()
    for scenario, goal, configuration in MOTIONS:
        if arguments.only in (None, scenario):
            check(arguments.program.resolve(), scenario, goal, configuration)
    for name, value in sorted(worst.items()):
        print(f"  {name}: {value:.2g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
