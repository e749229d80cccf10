#!/usr/bin/env python3
"""What a recorded run says of the UR3e, by Pinocchio and NumPy, beside what `needlebench replay` says.

Masses and centres are those of the maker's page, the lengths its DH parameters: nothing is read from our models
or our code but `replay.json`, whose figures are checked:

- what masses, load, gravity and rotors leave of `target_moment`, per joint, with replay's rotors and gravity;
- rotors and gravity by a least-squares fit of our own;
- lag, standing and moving errors at a tip;
- poses by the calibration that was written.
"""

import argparse
import csv
import json
import math
import pathlib
import sys

import numpy as np
import pinocchio as pin

# Universal Robots, "DH parameters for calculations of kinematics and dynamics", UR3e.
A = [0.0, -0.24355, -0.2132, 0.0, 0.0, 0.0]
D = [0.15185, 0.0, 0.0, 0.13105, 0.08535, 0.0921]
ALPHA = [math.pi / 2, 0.0, 0.0, math.pi / 2, -math.pi / 2, 0.0]
MASS = [1.98, 3.4445, 1.437, 0.871, 0.805, 0.261]
CENTRE = [[0, -0.02, 0], [0.13, 0, 0.1157], [0.05, 0, 0.0238], [0, 0, 0.01], [0, 0, 0.01], [0, 0, -0.02]]
TIP_M = 0.2

# The sums are the same but for rounding and for how the two fits weigh joints.
MOMENT_NM = 1e-5
ROTOR_KGM2 = 1e-4
GRAVITY_M_S2 = 5e-4
LAG_S = 5e-6
TIP_SAME_M = 1e-7
CALIBRATION_M = 5e-9


def model_with(load_kg, load_centre, gravity):
    """The arm as points at their centres, in DH frames, with a load at the flange."""
    model = pin.Model()
    parent = 0
    placement = pin.SE3.Identity()
    for joint in range(6):
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint_{joint}")
        rotation = pin.utils.rotate("x", ALPHA[joint])
        # From the joint's frame to the DH frame behind it.
        behind = pin.SE3(rotation, np.array([A[joint], 0.0, D[joint]]))
        centre = behind.act(np.array(CENTRE[joint], dtype=float))
        model.appendBodyToJoint(parent, pin.Inertia(MASS[joint], centre, np.zeros((3, 3))), pin.SE3.Identity())
        placement = behind
    centre = placement.act(np.array(load_centre))
    model.appendBodyToJoint(parent, pin.Inertia(load_kg, centre, np.zeros((3, 3))), pin.SE3.Identity())
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    return model, placement


def columns(rows, name):
    return np.array([[float(row[f"{name}_{joint}"]) for joint in range(6)] for row in rows])


def calibrated(text):
    """Joint origins of ROS's `ur_calibration`, in `base`."""
    origins, entry = [], None
    for line in text.splitlines():
        line = line.rstrip()
        if line.startswith("#") or line == "kinematics:" or not line:
            continue
        key, value = [part.strip() for part in line.split(":", 1)]
        if not value:
            entry = {}
            origins.append(entry)
        else:
            entry[key] = float(value)
    return [
        pin.SE3(pin.rpy.rpyToMatrix(o["roll"], o["pitch"], o["yaw"]), np.array([o["x"], o["y"], o["z"]]))
        for o in origins
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--log", type=pathlib.Path, required=True)
    parser.add_argument("--results", type=pathlib.Path, required=True, help="folder of the replay")
    arguments = parser.parse_args()
    report = json.loads((arguments.results / "replay.json").read_text())
    with arguments.log.open(newline="") as file:
        rows = list(csv.DictReader(file))
    q, qd, qdd = (columns(rows, name) for name in ("target_q", "target_qd", "target_qdd"))
    moment, actual = columns(rows, "target_moment"), columns(rows, "actual_q")
    load_kg = float(rows[0]["payload"])
    load_centre = [float(rows[0][f"payload_cog_{axis}"]) for axis in range(3)]
    wrong = []

    def check(what, ours, theirs, tolerance, figure):
        off = float(np.max(np.abs(np.asarray(ours) - np.asarray(theirs))))
        print(f"{what}: off by {off:.2e}, allowed {tolerance:.0e}")
        print(f"figure {figure} {off:.3e}")
        if not off <= tolerance:
            wrong.append(what)

    def torques(gravity):
        model, _ = model_with(load_kg, load_centre, gravity)
        data = model.createData()
        return np.array([pin.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])

    controller = report["identification"]["controller"]
    rotors = np.array([rotor["value"] for rotor in controller["rotor_inertia_kgm2"]])
    gravity = controller["gravity_m_s2"]["value"]
    left = moment - torques(gravity) - rotors * qdd
    check("what is left of target_moment, rms (N m)", controller["rms_nm"], np.sqrt(np.mean(left**2, axis=0)), MOMENT_NM, "moment_nm")

    # Linear in gravity and rotors: each joint weighted by what is left of it.
    scale = 1.0 / np.sqrt(np.mean(left**2, axis=0)).clip(1e-4)
    none, one = torques(0.0), torques(1.0)
    matrix, right = [], []
    for joint in range(6):
        block = np.zeros((len(q), 7))
        block[:, joint] = qdd[:, joint]
        block[:, 6] = one[:, joint] - none[:, joint]
        matrix.append(block * scale[joint])
        right.append((moment[:, joint] - none[:, joint]) * scale[joint])
    fit = np.linalg.lstsq(np.vstack(matrix), np.concatenate(right), rcond=None)[0]
    check("rotors (kg m^2)", rotors, fit[:6], ROTOR_KGM2, "rotors_kgm2")
    check("gravity (m/s^2)", gravity, fit[6], GRAVITY_M_S2, "gravity_m_s2")

    off = actual - q
    slopes, weights = 0.0, 0.0
    for joint in range(6):
        moves = np.abs(qd[:, joint]) > 0.05
        v, e = qd[moves, joint], off[moves, joint]
        slopes -= np.sum((v - v.mean()) * (e - e.mean()))
        weights += np.sum((v - v.mean()) ** 2)
    check("lag (s)", report["real"]["lag_of_all_s"]["value"], slopes / weights, LAG_S, "lag_s")

    model, flange = model_with(0.0, [0.0, 0.0, 0.0], 9.81)
    data = model.createData()

    def tip(joints):
        pin.forwardKinematics(model, data, joints)
        return (data.oMi[6] * flange).act(np.array([0.0, 0.0, TIP_M]))

    distance = np.array([np.linalg.norm(tip(a) - tip(b)) for a, b in zip(actual, q, strict=True)])
    rms = math.sqrt(np.mean(distance**2))
    check("tip, rms and largest (m)", [report["real"][key] for key in ("tip_rms_m", "tip_largest_m")], [rms, distance.max()], TIP_SAME_M, "tip_m")

    origins = calibrated((arguments.results / "calibration.yaml").read_text())
    tool = pin.SE3(pin.exp3(np.array(report["calibration"]["tool_rotation_rad"])), np.array(report["calibration"]["tool_position_m"]))
    poses = columns(rows, "actual_TCP_pose")
    # `base_link_inertia`, whose frame the file is in, is the controller's `base`.
    worst = 0.0
    for joints, pose in zip(actual, poses, strict=True):
        at = pin.SE3.Identity()
        for origin, angle in zip(origins, joints, strict=True):
            at = at * origin * pin.SE3(pin.utils.rotate("z", angle), np.zeros(3))
        worst = max(worst, float(np.linalg.norm((at * tool).translation - pose[:3])))
    check("poses by the calibration (m)", worst, 0.0, CALIBRATION_M, "calibration_m")
    print(f"figure held_out_nm {max(controller['held_out_rms_nm']):.5f}")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
