"""`needlebench needle insert` against a chain of hinged links in MuJoCo: `chain.py --program PROGRAM`.

Links of a clamped needle turn in hinges with the stiffness of the beam between them. MuJoCo has angles that are finite;
its forces of the springs and its Jacobians make Newton's method for the rest position, and its accelerations there say
that it is one. A cantilever in air, and a path that is cut through two layers: each step makes the chain longer by
one link, and the new link's end is the new point of the path. Links are off in proportion to their length: two
lengths are extrapolated. Exits with 1 beyond 0.1 % of the tip.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np

STEEL_PA = 200e9
OUTER_M = 1.27e-3
BEVEL_RAD = math.radians(25)
RELATIVE = 1e-3
# Of the chain's tip, at rest.
STILL_M_S2 = 1e-6
STANDOFF_M = 0.01
AIR = [(0.05, 0.0, 0.1)]
TISSUE = [(0.03, 5e3, 0.06), (0.04, 2e4, 0.1)]


def stiffness_nm2() -> float:
    return STEEL_PA * math.pi / 64 * OUTER_M**4


def chain(count: int, link_m: float) -> mujoco.MjModel:
    """From x = 0 on; hinges about z. Half a link of beam is before the first one."""
    hinge = stiffness_nm2() / link_m
    text = ""
    for number in range(count):
        stiffness = 2 * hinge if number == 0 else hinge
        place = 0.0 if number == 0 else link_m
        text += (
            f'<body pos="{place!r} 0 0"><joint type="hinge" axis="0 0 1" stiffness="{stiffness!r}"/>'
            f'<geom type="capsule" size="1e-3" fromto="0 0 0 {link_m!r} 0 0" mass="0.01" contype="0" conaffinity="0"/>'
        )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option gravity="0 0 0"/><compiler boundmass="1e-6" boundinertia="1e-9"/>'
        f"<worldbody>{text}{'</body>' * count}</worldbody></mujoco>"
    )


class Rest:
    """A chain under springs to a path and a force at its tip."""

    def __init__(self, count: int, link_m: float):
        self.model = chain(count, link_m)
        self.data = mujoco.MjData(self.model)
        self.count, self.link_m = count, link_m

    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Ends of the links, and how they move across by the hinges."""
        ends, jacobians = [], []
        jacobian = np.zeros((3, self.count))
        for body in range(1, self.count + 1):
            frame = self.data.xmat[body].reshape(3, 3)
            point = self.data.xpos[body] + frame @ [self.link_m, 0, 0]
            mujoco.mj_jac(self.model, self.data, jacobian, None, point, body)
            ends.append(point.copy())
            jacobians.append(jacobian.copy())
        return np.array(ends), np.array(jacobians)

    def found(self, begin: np.ndarray, springs: np.ndarray, rest, force: float) -> np.ndarray:
        """Ends of the links; `springs` N/m at each, to the path `rest`."""
        self.data.qpos[:] = begin
        stiff = np.zeros((self.count, self.count))
        hinges = self.model.jnt_stiffness
        # MuJoCo's angles are relative.
        np.fill_diagonal(stiff, hinges)
        for _ in range(50):
            mujoco.mj_forward(self.model, self.data)
            ends, jacobians = self.points()
            pull = -springs * (ends[:, 1] - rest(ends[:, 0]))
            pull[-1] += force
            across = jacobians[:, 1, :]
            torque = self.data.qfrc_passive + across.T @ pull
            step = np.linalg.solve(stiff + across.T @ (springs[:, None] * across), torque)
            self.data.qpos += step
            if np.abs(step).max() < 1e-14:
                break
        # Held against MuJoCo's own equations of motion.
        self.data.qfrc_applied[:] = across.T @ pull
        mujoco.mj_forward(self.model, self.data)
        worst = float(np.abs(across[-1] @ self.data.qacc))
        if worst > STILL_M_S2:
            raise SystemExit(f"the chain is not at rest: {worst} m/s2")
        return self.points()[0]


def bend(layers: list[tuple[float, float, float]], link_m: float) -> float:
    """The tip at the end of the layers."""
    depth_m = sum(length for length, _, _ in layers)
    if all(k == 0 for _, k, _ in layers):
        count = round((STANDOFF_M + depth_m) / link_m)
        force = mean_force(layers, depth_m)
        ends = Rest(count, link_m).found(np.zeros(count), np.zeros(count), lambda x: 0 * x, force)
        return float(ends[-1, 1])
    before = round(STANDOFF_M / link_m)
    places, path = [STANDOFF_M], [0.0]
    angles = np.zeros(before)
    for number in range(before + 1, before + round(depth_m / link_m) + 1):
        rest = Rest(number, link_m)
        tip_depth_m = (number - before) * link_m
        depths = np.arange(1, number + 1) * link_m - STANDOFF_M
        springs = np.array([weight(layers, depth, link_m) for depth in depths])
        # The tip rests on its own place.
        springs[-1] = 0.0
        known = list(zip(places, path, strict=True))
        xs, ys = [each[0] for each in known], [each[1] for each in known]
        angles = np.append(angles, 0.0)
        force = mean_force(layers, tip_depth_m)
        ends = rest.found(angles, springs, lambda x, xs=xs, ys=ys: np.interp(x, xs, ys), force)
        angles = rest.data.qpos.copy()
        places.append(ends[-1, 0])
        path.append(ends[-1, 1])
    return path[-1]


def weight(layers: list[tuple[float, float, float]], depth_m: float, link_m: float) -> float:
    """Stiffness of half a link to each side, N/m."""
    total, begin = 0.0, 0.0
    for length, k, _ in layers:
        a, b = max(begin, depth_m - link_m / 2), min(begin + length, depth_m + link_m / 2)
        total += k * max(0.0, b - a)
        begin += length
    return total


def mean_force(layers: list[tuple[float, float, float]], depth_m: float) -> float:
    face_m = OUTER_M / math.tan(BEVEL_RAD)
    total, begin = 0.0, 0.0
    for length, _, force in layers:
        a, b = max(begin, depth_m - face_m), min(begin + length, depth_m)
        total += force * max(0.0, b - a)
        begin += length
    return total / face_m


def ours(program: str, layers: list[tuple[float, float, float]]) -> float:
    text = f'[needle]\ngauge = 18\n[held]\nby = "clamp"\nstandoff_mm = {1e3 * STANDOFF_M}\n'
    for length_m, k_n_m2, force_n in layers:
        text += f"[[layers]]\nlength_mm = {1e3 * length_m}\nstiffness_kn_m2 = {1e-3 * k_n_m2}\nforce_n = {force_n}\n"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "case.toml"
        file.write_text(text)
        command = [program, "needle", "insert", file, "--json"]
        return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)["tip_m"][0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True)
    program = parser.parse_args().program
    good = True
    for name, layers in (("cantilever", AIR), ("cut path", TISSUE)):
        coarse, fine = (bend(layers, link_m) for link_m in (2e-3, 1e-3))
        # In air links are off by the square of their length, on a cut path in proportion to it.
        wanted = fine + (fine - coarse) / (3 if layers is AIR else 1)
        found = ours(program, layers)
        off = abs(found / wanted - 1)
        print(f"{name} in MuJoCo: {1e3 * wanted:.5f} mm, ours {1e3 * found:.5f} mm, off {100 * off:.4f} %")
        good &= off <= RELATIVE
    if not good:
        sys.exit("beyond the mark")


if __name__ == "__main__":
    main()
