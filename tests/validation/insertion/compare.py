"""`needlebench needle` against a solver of its own: `compare.py --program PROGRAM`.

60 random layered cases (16 to 22 G, gas, turns, two planes; guide with play, clamp or hub) and three slips against
`reference.py`, then 200 recorded insertions of a hub and of a guide that are made up with it and fitted by
`needle fit`. Exits with 1 beyond the marks.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from reference import OUTER_M, Case, inserted

CASES, SLIPS = 60, 3
# Marks of the difference of the tip; its worst is a share of how far it is off.
MEDIAN_M, NINE_TENTHS_M, WORST = 1e-6, 5e-6, 0.015
# Two grids of the reference, before they are extrapolated: the error left is well below their difference.
GRIDS_M = 5e-6
# Intervals of 95 % of so many fits: 190 are expected, fewer than 183 have a chance of 1 %.
FITS, WITHIN = 200, 183
NOISE_M = 0.3e-3
DEPTHS_MM = np.arange(10, 81, 10)


def random_case(random: np.random.Generator, number: int) -> tuple[int, Case, float]:
    """Gauge, case, and the direction across, deg."""
    gauge = int(random.integers(16, 23))
    layers = []
    for _ in range(int(random.integers(2, 6))):
        length = round(random.uniform(5e-3, 30e-3), 5)
        k = 500 * 320 ** random.uniform()
        layers.append((length, k, round(0.02 * 7 ** random.uniform(), 4)))
    if number % 4 == 0:
        # Gas behind the first layer: the lung has collapsed.
        length, _, _ = layers[1]
        layers[1] = (length, 0.0, 0.0)
    case = Case(OUTER_M[gauge], layers, bevel_rad=math.radians(round(random.uniform(20, 45), 1)))
    if number % 2:
        case.turn_m = round(random.uniform(0.2, 0.8) * case.depth_m, 4)
    if number % 6 == 5:
        case.hub_m = round(case.depth_m + random.uniform(5e-3, 60e-3), 4)
    else:
        case.standoff_m = round(random.uniform(0, 0.03), 4)
        if number % 3:
            play = random.uniform(0.03e-3, 0.2e-3)
            bore_mm = round(1e3 * (case.outer_m + 2 * play), 4)
            case.guide = (round(random.uniform(0.03, 0.06), 4), 0.5e-3 * bore_mm - 0.5 * case.outer_m)
    return gauge, case, round(random.uniform(-180, 180), 2)


def written(gauge: int, case: Case, towards_deg: float) -> str:
    lines = [f"[needle]\ngauge = {gauge}\n", "[held]"]
    if case.hub_m is not None:
        lines += ['by = "hub"', f"needle_length_mm = {1e3 * case.hub_m!r}"]
    else:
        lines.append(f"standoff_mm = {1e3 * case.standoff_m!r}")
        if case.guide:
            length_m, play_m = case.guide
            lines += [
                'by = "guide"',
                f"guide_length_mm = {1e3 * length_m!r}",
                f"bore_mm = {1e3 * (case.outer_m + 2 * play_m)!r}",
            ]
        else:
            lines.append('by = "clamp"')
    lines += ["\n[tip]", f"bevel_deg = {math.degrees(case.bevel_rad)!r}", f"towards_deg = {towards_deg!r}"]
    if case.turn_m is not None:
        lines.append(f"turn_at_mm = {1e3 * case.turn_m!r}")
    for length_m, k_n_m2, force_n in case.layers:
        lines += [
            "\n[[layers]]",
            f"length_mm = {1e3 * length_m!r}",
            f"stiffness_kn_m2 = {float(1e-3 * k_n_m2)!r}",
            f"force_n = {force_n!r}",
        ]
    if case.slip:
        from_m, by_m = case.slip
        lines += ["\n[slip]", f"from_mm = {1e3 * from_m!r}", f"by_mm = {[1e3 * each for each in by_m]!r}"]
    return "\n".join(lines) + "\n"


def ours(program: str, folder: Path, name: str, text: str) -> dict:
    file = folder / f"{name}.toml"
    file.write_text(text)
    done = subprocess.run([program, "needle", "insert", file, "--json"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{text}\n{done.stderr}")
    return json.loads(done.stdout)


def turned(across: np.ndarray, towards_deg: float) -> np.ndarray:
    """From the plane in which the tip is pushed to y and z."""
    sine, cosine = math.sin(math.radians(towards_deg)), math.cos(math.radians(towards_deg))
    return np.array([[cosine, -sine], [sine, cosine]]) @ across


def compare_cases(program: str, folder: Path, pool) -> bool:
    random = np.random.default_rng(20261130)
    cases = [random_case(random, number) for number in range(CASES)]
    plain = [written(*each) for each in cases]
    for number in range(SLIPS):
        gauge, case, towards_deg = random_case(random, [1, 3, 5][number])
        by = [round(float(each), 5) for each in random.uniform(-5e-3, 5e-3, 2)]
        # Tissue from the end of the first layer on, in the frame of the tip's plane.
        angle = -math.radians(towards_deg)
        rotated = (
            math.cos(angle) * by[0] - math.sin(angle) * by[1],
            math.sin(angle) * by[0] + math.cos(angle) * by[1],
        )
        case.slip = (case.layers[0][0], (by[0], by[1]))
        plain.append(written(gauge, case, towards_deg))
        case.slip = (case.layers[0][0], rotated)
        cases.append((gauge, case, towards_deg))
    differences, shares, grids = [], [], 0.0
    references = pool.map(inserted, [case for _, case, _ in cases], chunksize=1)
    for number, ((gauge, case, towards_deg), (done, apart)) in enumerate(zip(cases, references, strict=True)):
        answer = ours(program, folder, str(number), plain[number])
        wanted = turned(done.tip, towards_deg)
        off = float(np.hypot(*(np.array(answer["tip_m"]) - wanted)))
        size = float(np.hypot(*wanted))
        differences.append(off)
        shares.append(off / size)
        grids = max(grids, apart)
        held = "hub" if case.hub_m is not None else "guide" if case.guide else "clamp"
        print(
            f"{number:2} {gauge} G {held:5} {1e3 * case.depth_m:5.1f} mm: tip {1e3 * size:7.4f} mm, "
            f"off {1e6 * off:7.3f} um ({100 * off / size:.3f} %), grids {1e6 * apart:.3f} um"
            f"{', slip' if case.slip else ''}"
        )
    usual, slips = np.array(differences[:CASES]), np.array(differences[CASES:])
    median, most = float(np.median(usual)), float(np.quantile(usual, 0.9))
    worst = max(shares)
    print(
        f"layered cases: median {1e6 * median:.3f} um, 90 % {1e6 * most:.3f} um, worst {100 * worst:.3f} % of the tip "
        f"(and {1e6 * usual.max():.1f} um)"
    )
    print(f"slips within {1e6 * slips.max():.2f} um")
    print(f"grids of the reference: within {1e6 * grids:.3f} um")
    return median <= MEDIAN_M and most <= NINE_TENTHS_M and worst <= WORST and grids <= GRIDS_M


def bends_of(case: Case) -> np.ndarray:
    done, _ = inserted(case)
    return np.interp(1e-3 * DEPTHS_MM, done.nodes, done.path)


def compare_fits(program: str, folder: Path, pool) -> bool:
    random = np.random.default_rng(7)
    fewest = FITS
    hub = ["--held", "hub", "--gauge", "22", "--needle-length-mm", "120"]
    guide = ["--held", "guide", "--gauge", "20", "--guide-length-mm", "50", "--bore-mm", "1.1", "--standoff-mm", "10"]
    forces = np.linspace(0.03, 0.12, 10)
    for name, options, more in (
        ("hub", hub, {"outer_m": OUTER_M[22], "hub_m": 0.12}),
        ("guide", guide, {"outer_m": OUTER_M[20], "guide": (0.05, 0.55e-3 - 0.5 * OUTER_M[20]), "standoff_m": 0.01}),
    ):
        cases = [Case(layers=[(0.08, 2e4, force)], **more) for force in forces]
        bends = pool.map(bends_of, cases, chunksize=1)
        within, off = 0, []
        for number in range(FITS):
            force, bend = forces[number % len(forces)], bends[number % len(forces)]
            recorded = bend + NOISE_M * random.standard_normal(len(bend))
            file = folder / f"{name}.csv"
            rows = [f"{depth},{1e3 * each:.4f}" for depth, each in zip(DEPTHS_MM, recorded, strict=True)]
            file.write_text("\n".join(["depth_mm,bend_mm", *rows]) + "\n")
            command = [program, "needle", "fit", file, *options, "--stiffness-kn-m2", "20", "--json"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode not in (0, 1):
                raise SystemExit(done.stderr)
            answer = json.loads(done.stdout)
            if answer["force_n"] is None:
                continue
            low, high = answer["force_interval_95_n"]
            within += low <= force <= high
            off.append(answer["force_n"] / force - 1)
        print(f"held by {name}: {within} of {FITS} intervals hold the force, mean {100 * np.mean(off):+.2f} %")
        fewest = min(fewest, within)
    print(f"fewest intervals that hold the force: {fewest}")
    return fewest >= WITHIN


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True)
    program = parser.parse_args().program
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder, multiprocessing.Pool() as pool:
        good = compare_cases(program, Path(folder), pool)
        good &= compare_fits(program, Path(folder), pool)
    print(f"{time.monotonic() - begin:.0f} s")
    if not good:
        sys.exit("beyond the marks")


if __name__ == "__main__":
    main()
