"""Evaluations that pycma needs on three functions: the figures of crates/study/src/search/cma.rs.

pip install cma==4.5.0 numpy==2.4.6; python3 pycma.py prints a table: medians of 21 seeds of the evaluations until a
function is below 1e-9, from the same start with the same deviation, population and positive weights alone.
"""

import statistics

import cma
import numpy as np


def sphere(x):
    return float(np.dot(x, x))


def rosenbrock(x):
    return float(np.sum(100.0 * (x[1:] - x[:-1] ** 2) ** 2 + (1.0 - x[:-1]) ** 2))


def ellipsoid(x):
    n = len(x)
    normal = np.arange(1.0, n + 1.0)
    y = x - 2.0 * normal * np.dot(normal, x) / np.dot(normal, normal)
    return float(np.sum(10.0 ** (6.0 * np.arange(n) / (n - 1)) * y * y))


def evaluations(f, n, start, seed):
    options = {
        "CMA_active": False,
        "seed": seed + 1,
        "verbose": -9,
        "tolfun": 0,
        "tolx": 0,
        "tolfunhist": 0,
        "tolflatfitness": 10**9,
        "maxfevals": 100_000,
        "CMA_diagonal": 0,
    }
    es = cma.CMAEvolutionStrategy([start] * n, 0.5, options)
    count = 0
    while count < 100_000:
        points = es.ask()
        values = []
        for point in points:
            count += 1
            value = f(np.asarray(point))
            if value < 1e-9:
                return count
            values.append(value)
        es.tell(points, values)
    return count


for name, f, start in [("sphere", sphere, 1.0), ("rosenbrock", rosenbrock, 0.0), ("ellipsoid", ellipsoid, 1.0)]:
    for n in (4, 8):
        counts = [evaluations(f, n, start, seed) for seed in range(21)]
        print(f"{name} {n}: {statistics.median(counts)} (mean {statistics.mean(counts):.0f})", flush=True)
