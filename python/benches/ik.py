"""Batch inverse kinematics from Python compared with the same loops in Rust, alternating: time per pose.

cargo build --release -p needlebench-kinematics --example batch_time
python python/benches/ik.py --rust target/release/examples/batch_time
"""

import argparse
import subprocess
import tempfile
import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

import needlebench as nb


def best(work: Callable[[], object], repeats: int) -> float:
    """Shortest of several times, s."""
    times: list[float] = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def poses() -> npt.NDArray[np.float64]:
    """1024 poses of random postures."""
    rng = np.random.default_rng(1)
    return np.asarray(nb.fk(rng.uniform(-3, 3, (1024, 6))).flange_in_base)


def python_times(few: npt.NDArray[np.float64]) -> dict[str, float]:
    """Nanoseconds per pose."""
    many = np.tile(few, (977, 1))[:1_000_000]
    each = [pose.copy() for pose in few[:1000]]
    answers = nb.ik(few)
    answers.joints  # noqa: B018 - the memory is NumPy's from here on
    large = nb.ik(many)
    return {
        "1024 into memory that exists": best(lambda: nb.ik(few, out=answers), 2000) / 1024 * 1e9,
        "1024 into new memory": best(lambda: nb.ik(few), 2000) / 1024 * 1e9,
        "1000000 into memory that exists": best(lambda: nb.ik(many, out=large), 5) / 1e6 * 1e9,
        "1000000 into new memory": best(lambda: nb.ik(many), 5) / 1e6 * 1e9,
        "one": best(lambda: [nb.ik(pose) for pose in each], 50) / 1000 * 1e9,
    }


def rust_times(program: str, few: npt.NDArray[np.float64]) -> dict[str, float]:
    """The same for the Rust loops, with the same poses."""
    with tempfile.NamedTemporaryFile() as file:
        few.tofile(file.name)
        told = subprocess.run([program, file.name], capture_output=True, text=True, check=True).stdout
    rows = (line.split("\t") for line in told.splitlines())
    return {name: float(value) for name, value in rows}


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rust", required=True, help="the example batch_time of needlebench-kinematics")
    arguments = parser.parse_args()
    few = poses()
    rounds = [(rust_times(arguments.rust, few), python_times(few)) for _ in range(5)]
    print(f"{'ns per pose, best of 5 rounds':40} {'Rust':>8} {'Python':>8} {'ratio':>6}")
    for name in rounds[0][1]:
        rust = min(rust[name] for rust, _ in rounds)
        python = min(python[name] for _, python in rounds)
        print(f"{name:40} {rust:8.1f} {python:8.1f} {python / rust:6.2f}")


if __name__ == "__main__":
    main()
