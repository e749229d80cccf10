"""Probabilities of the crate `needlebench-probability` against SciPy: `compare.py CELLS`.

CELLS is what `cargo test -p needlebench-probability --test probability -- --ignored --nocapture cells_are_printed`
prints: 40 half-spaces, 40 balls, 10 mixtures of bends and failed holds, each with the law of its needle, the estimate,
the bound, and the probability by the tests' own quadrature. Half-spaces are bivariate normal probabilities here, balls
Imhof's inversion (Biometrika 48 (1961) 419); nothing is shared with the tests. Exits with 1 beyond the marks.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np
from scipy.stats import multivariate_normal, norm

DEPTH_M, NEEDED_M = 0.09, 0.635e-3 + 0.5e-3
# Bends at the tip, straight from the entry; the spread of their known direction; how many holds fail.
SIZES_M, SPREAD_RAD, FAILED = (0.4e-3, 0.8e-3, 1.1e-3, 2.0e-3), 0.3, 0.05
# Of the quadrature: relative, and absolute for the inversion, whose integrals are cut at 1e-11.
RELATIVE, ABSOLUTE = 1e-5, 1e-9
# Intervals of 95 % of 90 cells: fewer than 79 hold the probability in 1 % of all runs.
FEWEST = 79


def either_above(mean: np.ndarray, covariance: np.ndarray, limit: float) -> np.ndarray:
    """Either of two normal variables is above a limit, for means row by row: the tails less that of both at once."""
    tails = norm.sf(limit, mean, np.sqrt(np.diag(covariance)))
    both = multivariate_normal([0, 0], covariance, allow_singular=True).cdf(mean - limit)
    return tails.sum(axis=-1) - both


def imhof(mean: np.ndarray, sd: np.ndarray, radius: float) -> float:
    """Normal variables are within a ball about the origin."""
    if radius <= 0:
        return 0.0
    scale, share = ((sd / radius) ** 2)[:, None], ((mean / sd) ** 2)[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(40)

    def pieces(ends: np.ndarray) -> np.ndarray:
        """Integrals from each end to the next."""
        half = 0.5 * np.diff(ends)
        u = (0.5 * (ends[1:] + ends[:-1]) + np.outer(nodes, half)).ravel()
        each = (scale * u) ** 2
        angle = 0.5 * np.sum(np.arctan(scale * u) + share * scale * u / (1 + each), axis=0) - 0.5 * u
        size = np.prod((1 + each) ** 0.25, axis=0) * np.exp(0.5 * np.sum(share * each / (1 + each), axis=0))
        return weights @ (np.sin(angle) / (u * size)).reshape(len(nodes), -1) * half

    # A quarter of a period after the other, until they are nothing.
    total, first = 0.0, 0
    while True:
        found = pieces(math.pi * np.arange(first, first + 65))
        total += found.sum()
        first += 64
        if np.abs(found[-8:]).max() < 1e-12 or first > 100_000:
            return 0.5 - total / math.pi


def in_ball(mean: np.ndarray, sd: np.ndarray, radius: float, boundary: float) -> float:
    if boundary == 0:
        return imhof(mean, sd, radius)
    nodes, weights = np.polynomial.hermite_e.hermegauss(20)
    values = [imhof(mean, sd, radius + boundary * z) for z in nodes]
    return float(weights @ values / math.sqrt(2 * math.pi))


def half_space(cell: dict) -> float:
    normal, limit = np.array(cell["at_m"]), cell["size_m"] - NEEDED_M
    covariance = np.array(cell["covariance_m2"]).reshape(6, 6)
    level, full = np.array(cell["breath_m"]) @ normal
    at = np.zeros((2, 6))
    at[0, :3] = at[1, 3:] = normal
    both = at @ covariance @ at.T + cell["boundary_sd_m"] ** 2 + level**2
    mean = at @ np.array(cell["mean_m"])

    def beyond(tip: float) -> float:
        held = either_above(mean + [0, tip], both, limit)
        if full == 0:
            return float(held)
        # Means of periodic functions: equal steps.
        phases = (np.arange(48) + 0.5) / 96
        by = -full * np.sin(np.pi * phases) ** 4
        means = np.stack([mean[0] + by, mean[1] + by + tip], axis=1)
        failed = np.mean(either_above(means, both, limit))
        return float((1 - FAILED) * held + FAILED * failed)

    angle = math.atan2(normal[2], normal[1])
    if cell["bend"] == "none":
        return beyond(0.0)
    if cell["bend"] == "unknown":
        turns, weights = np.arange(20) * math.tau / 20, np.full(20, 1 / 20)
    else:
        nodes, weights = np.polynomial.hermite_e.hermegauss(14)
        turns, weights = SPREAD_RAD * nodes, weights / math.sqrt(2 * math.pi)
    each = [[beyond(size * math.cos(turn - angle)) for size in SIZES_M] for turn in turns]
    return float(weights @ np.mean(each, axis=1))


def ball(cell: dict) -> float:
    mean, covariance = np.array(cell["mean_m"][:3]), np.array(cell["covariance_m2"]).reshape(6, 6)
    sd, centre = np.sqrt(np.diag(covariance)[:3]), np.array(cell["at_m"])
    if cell["wanted"]:
        return in_ball(mean - centre + [DEPTH_M, 0, 0], sd, cell["size_m"], cell["boundary_sd_m"])
    return in_ball((mean - centre)[1:], sd[1:], cell["size_m"] + NEEDED_M, 0.0)


def main() -> int:
    lines = Path(sys.argv[1]).read_text().splitlines()
    cells = [json.loads(line) for line in lines if line.startswith("{")]
    off, held, lowest, wrong = 0.0, 0, math.inf, 0
    for number, cell in enumerate(cells):
        exact = half_space(cell) if cell["shape"] == "half-space" else ball(cell)
        held += cell["low"] <= exact <= cell["high"]
        if not cell["wanted"]:
            lowest = min(lowest, cell["at_most"] / exact)
        difference = abs(cell["exact"] - exact)
        off = max(off, difference / exact)
        if difference > RELATIVE * exact + ABSOLUTE:
            print(f"cell {number}: {cell['exact']:.8e} by the tests, {exact:.8e} here")
            wrong += 1
    print(f"{len(cells)} cells: quadrature off {off:.1e} of the probability at most")
    print(f"{held} intervals hold the probability; least bound {lowest:.6f} times it")
    return 0 if len(cells) == 90 and not wrong and held >= FEWEST and lowest >= 1 - RELATIVE else 1


if __name__ == "__main__":
    sys.exit(main())
