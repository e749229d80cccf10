"""Statistics of breath, a second time: NumPy and SciPy on traces that are made here, beside `needlebench breath`.

Ends of expiration are peaks with a prominence (`scipy.signal.find_peaks`), the axis is by singular values, samples at
10 Hz by `numpy.interp`, the drift by generalised least squares with whole matrices, quantiles of Student's and the
chi-square distribution by `scipy.stats`. Nothing here is taken from `crates/breath` but the definitions, which its
documentation has. `--recording` compares further files: `Frame;Timestamp;x;y;z`, ms and mm, with decimal commas.
"""

import argparse
import itertools
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import chi2
from scipy.stats import t as student

STEP_S = 0.1
AFTER_S = (5, 15, 30, 60, 120)
TRACES = 24

# Relative. Values differ by rounding alone. Bounds of intervals also by the quantiles, to 1e-10.
VALUES = 1e-9
INTERVALS = 1e-7


def make_trace(seed: int) -> tuple[np.ndarray, np.ndarray, str]:
    """Times in s, positions in mm (lost ones are zero), and the form of the file."""
    rng = np.random.default_rng(seed)
    rate_hz = [10.0, 12.5, 30.0, 60.0][seed % 4]
    length_s = rng.uniform(90.0, 320.0)
    amplitude_mm, cv = rng.uniform(4.0, 18.0), rng.uniform(0.05, 0.5)
    period_s, period_cv = rng.uniform(3.5, 8.0), rng.uniform(0.05, 0.35)
    drift_mm_per_s = rng.normal(0.0, 0.01)
    walk_mm, alone_mm = rng.uniform(0.0, 0.3), rng.uniform(0.05, 0.6)
    times_s = np.cumsum(rng.normal(1.0 / rate_hz, 0.05 / rate_hz, int(length_s * rate_hz)).clip(0.2 / rate_hz))
    ends_s, ends_mm, amplitudes_mm = [-rng.uniform(0.0, period_s)], [0.0], []
    level_mm = 0.0
    while ends_s[-1] < times_s[-1]:
        ends_s.append(ends_s[-1] + period_s * math.exp(rng.normal(0.0, period_cv)))
        level_mm += walk_mm * math.sqrt(ends_s[-1] - ends_s[-2]) * rng.normal()
        ends_mm.append(level_mm + alone_mm * rng.normal() + drift_mm_per_s * ends_s[-1])
        amplitudes_mm.append(amplitude_mm * math.exp(rng.normal(0.0, cv)))
    ends_s, ends_mm, amplitudes_mm = map(np.array, (ends_s, ends_mm, amplitudes_mm))
    breath = np.searchsorted(ends_s, times_s, side="right") - 1
    phase = (times_s - ends_s[breath]) / np.diff(ends_s)[breath]
    along_mm = np.interp(times_s, ends_s, ends_mm) + amplitudes_mm[breath] * np.sin(np.pi * phase) ** 4
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    noise_mm = rng.normal(0.0, 0.1, (len(times_s), 3))
    positions_mm = rng.uniform(-500.0, 500.0, 3) + np.outer(along_mm, axis) + noise_mm
    # Lost samples here and there, and a gap of two seconds in every other trace.
    positions_mm[rng.random(len(times_s)) < 0.002] = 0.0
    if seed % 2:
        from_s = rng.uniform(0.3, 0.7) * length_s
        positions_mm[(times_s > from_s) & (times_s < from_s + 2.0)] = 0.0
    return times_s, positions_mm, ["comma", "semicolon"][seed % 3 == 0]


def write_trace(path: Path, times_s: np.ndarray, positions_mm: np.ndarray, form: str) -> tuple[np.ndarray, np.ndarray]:
    """Writes a table; what stands in it, as numbers, is returned: times in s, positions in m."""
    if form == "comma":
        lines = ["time_s,x_mm,y_mm,z_mm"]
        lines += [f"{t:.4f}," + ",".join(f"{c:.4f}" for c in p) for t, p in zip(times_s, positions_mm, strict=True)]
        path.write_text("\n".join(lines) + "\n")
        rows = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
        return rows[:, 0], rows[:, 1:] * 1e-3
    lines = ['"Frame";"Timestamp";"x";"y";"z"']
    for number, (t, p) in enumerate(zip(times_s, positions_mm, strict=True)):
        cells = [str(number), f"{1e3 * t:.1f}", *(f"{c:.3f}" for c in p)]
        lines.append(";".join(cells).replace(".", ","))
    path.write_text("\r\n".join(lines) + "\r\n")
    return read_recording(path)


def read_recording(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times in s and positions in m of a table of frames."""
    lines = path.read_text(encoding="utf-8-sig").split("\n")[1:]
    rows = [line.strip().replace(",", ".").split(";") for line in lines if line.strip()]
    table = np.array(rows, dtype=float)
    return table[:, 1] * 1e-3, table[:, 2:5] * 1e-3


def resample(times_s: np.ndarray, positions_m: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Start and samples at 10 Hz of what is between gaps."""
    step_s = np.sort(np.diff(times_s))[(len(times_s) - 1) // 2]
    parts = np.split(np.arange(len(times_s)), np.flatnonzero(np.diff(times_s) > 0.5) + 1)
    found = []
    for part in parts:
        time_s, position_m = times_s[part], positions_m[part]
        if step_s < 0.05:
            bins = np.floor((time_s - time_s[0]) / STEP_S)
            groups = np.split(np.arange(len(part)), np.flatnonzero(np.diff(bins)) + 1)
            time_s, position_m = (np.array([v[g].mean(axis=0) for g in groups]) for v in (time_s, position_m))
        grid_s = time_s[0] + STEP_S * np.arange(int((time_s[-1] - time_s[0] + 1e-6) / STEP_S) + 1)
        if len(grid_s) >= 2:
            found.append((time_s[0], np.stack([np.interp(grid_s, time_s, c) for c in position_m.T], axis=1)))
    return found


def remove_lost(times_s: np.ndarray, positions_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, int, int]:
    zero = (positions_m == 0.0).all(axis=1)
    times_s, positions_m = times_s[~zero], positions_m[~zero]
    # A time below the largest before it is astray (`--recording`: those files have single ones, all of them early).
    astray = times_s <= np.concatenate(([-np.inf], np.maximum.accumulate(times_s)[:-1]))
    return times_s[~astray], positions_m[~astray], int(zero.sum()), int(astray.sum())


class Trace:
    """A recording turned towards inspiration, its ends of expiration and its breaths."""

    def __init__(self, segments: list[tuple[float, np.ndarray]]):
        points = np.vstack([samples for _, samples in segments])
        mean = points.mean(axis=0)
        _, sizes, axes = np.linalg.svd(points - mean, full_matrices=False)
        self.share = sizes[0] ** 2 / (sizes**2).sum()
        best = None
        for sign in (1.0, -1.0):
            self.segments = [(start_s, (samples - mean) @ axes[0] * sign) for start_s, samples in segments]
            self.find_breaths()
            dwell = sum(b["near"] for b in self.breaths) / max(1, sum(b["samples"] for b in self.breaths))
            if best is None or dwell > best[0]:
                best = (dwell, sign)
        self.axis = axes[0] * best[1]
        self.segments = [(start_s, (samples - mean) @ self.axis) for start_s, samples in segments]
        self.find_breaths()

    def find_breaths(self) -> None:
        ranges = []
        for _, u in self.segments:
            count = max(1, len(u) // 100)
            ranges += [np.ptp(u[100 * i : 100 * (i + 1)]) for i in range(count)]
        rise_m = 0.3 * np.sort(ranges)[len(ranges) // 2]
        self.ends, self.breaths = [], []
        for number, (start_s, u) in enumerate(self.segments):
            # Of equal samples the first is the lowest: digits of a tracker repeat, and each would be a peak of its own.
            lows, _ = find_peaks(-u - 1e-12 * np.arange(len(u)), prominence=rise_m)
            lows = [low + (np.argmax(np.append(np.abs(u[low:] - u[low]) >= 1e-9, True)) - 1) // 2 for low in lows]
            for low in lows:
                known = low + np.argmax(u[low:] - u[low] >= rise_m)
                self.ends.append((start_s + STEP_S * low, u[low], start_s + STEP_S * known))
            for a, b in itertools.pairwise(lows):
                line = np.interp(np.arange(a, b), [a, b], [u[a], u[b]])
                amplitude_m = u[a : b + 1].max() - 0.5 * (u[a] + u[b])
                near = int((u[a:b] - line <= 0.2 * amplitude_m).sum())
                self.breaths.append(
                    {
                        "at": (number, a, b),
                        "amplitude": amplitude_m,
                        "period": STEP_S * (b - a),
                        "near": near,
                        "samples": b - a,
                    }
                )


def independent(values: np.ndarray) -> tuple[float, float]:
    """Number of independent values, and their correlation."""
    off = values - values.mean()
    rho = 0.0
    if len(values) >= 8 and (off**2).sum() > 0.0:
        rho = (off[1:] * off[:-1]).sum() / (off**2).sum()
        rho = float(np.clip((len(values) * rho + 1.0) / (len(values) - 4.0), 0.0, 0.9))
    return len(values) * (1.0 - rho) / (1.0 + rho), rho


def half(residuals: np.ndarray, over: float) -> float:
    count, _ = independent(residuals)
    deviation = residuals.std(ddof=1) * len(residuals) / math.sqrt(count) / over
    return student.ppf(0.975, max(1.0, count - 1.0)) * deviation


def mean_of(values: np.ndarray) -> tuple[float, list[float]]:
    value, width = values.mean(), half(values, len(values))
    return value, [max(0.0, value - width), value + width]


def variation(values: np.ndarray) -> tuple[float, list[float]]:
    n, value = len(values), values.std(ddof=1) / values.mean()
    off = values - values.mean()
    excess = max(0.0, (off**4).mean() / (off**2).mean() ** 2 - 3.0)
    count, rho = independent(values)
    degrees = 2.0 / ((1.0 + rho**2) / (1.0 - rho**2) * (excess / n + 2.0 / (n - 1.0)))
    width = student.ppf(0.975, max(1.0, degrees)) * math.sqrt(0.5 / degrees + value**2 / count)
    return value, [value / math.exp(width), value * math.exp(width)]


def ratio(above: np.ndarray, below: np.ndarray) -> tuple[float, float]:
    value = above.sum() / below.sum()
    return value, half(above - value * below, below.sum())


def share(above: np.ndarray, below: np.ndarray) -> tuple[float, list[float]]:
    value, width = ratio(above, below)
    return value, [max(0.0, value - width), min(1.0, value + width)]


def drift(trace: Trace, period_s: float) -> tuple[float, list[float]]:
    """By whole covariance matrices of ends whose level walks."""
    time_s, level_m = (np.array([end[k] for end in trace.ends]) for k in (0, 1))
    time_s = time_s - time_s[0]
    design = np.stack([np.ones_like(time_s), time_s], axis=1)
    n = len(time_s)
    slopes, variances, likelihoods = [], [], []
    for ratio_ in 1e-4 * 10.0 ** (0.5 * np.arange(17)):
        covariance = np.eye(n) + ratio_ / period_s * np.minimum.outer(time_s, time_s)
        inverse = np.linalg.inv(covariance)
        normal = design.T @ inverse @ design
        coefficients = np.linalg.solve(normal, design.T @ inverse @ level_m)
        residuals = level_m - design @ coefficients
        scale = residuals @ inverse @ residuals / (n - 2)
        slopes.append(coefficients[1])
        variances.append(scale * np.linalg.inv(normal)[1, 1])
        logs = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(normal)[1]
        likelihoods.append(-0.5 * ((n - 2) * math.log(scale) + logs))
    slopes, variances, likelihoods = map(np.array, (slopes, variances, likelihoods))
    weights = np.exp(likelihoods - likelihoods.max())
    weights /= weights.sum()
    slope = weights @ slopes
    width = student.ppf(0.975, n - 2) * math.sqrt(weights @ (variances + (slopes - slope) ** 2))
    return slope, [slope - width, slope + width]


def level(trace: Trace, after_s: float, period_s: float, length_s: float):
    times_s, levels_m = (np.array([end[k] for end in trace.ends]) for k in (0, 1))
    changes = []
    for i in range(1, len(times_s)):
        off_s = np.abs(times_s[:i] - (times_s[i] - after_s))
        # Of two that are as near, the later one, as differences of tenths are not exact.
        nearest = i - 1 - int(np.argmin(off_s[::-1]))
        if off_s[nearest] <= 0.5 * period_s:
            changes.append(levels_m[i] - levels_m[nearest])
    if not changes:
        return None
    changes = np.array(changes)
    n, k = len(changes), max(1.0, after_s / period_s)
    j = np.arange(1, max(1, math.ceil(min(n, k))))
    free = n / (1.5 + 2.0 * ((1.0 - j / n) * (1.0 - j / k) ** 2).sum())
    rms_m = math.sqrt((changes**2).mean())
    interval = None
    if length_s >= 2.0 * after_s and free >= 1.0:
        interval = [rms_m * math.sqrt(free / chi2.ppf(p, free)) for p in (0.975, 0.025)]
    return n, (rms_m, interval), np.abs(changes).max()


def window(trace: Trace, half_width_m: float):
    known_s = np.array([end[2] for end in trace.ends])
    levels_m = np.array([end[1] for end in trace.ends])
    parts, stays_s = {}, []
    for number, (start_s, u) in enumerate(trace.segments):
        times_s = start_s + STEP_S * np.arange(len(u))
        known = np.searchsorted(known_s, times_s, side="right")
        starts = np.array([b["at"][1] for b in trace.breaths if b["at"][0] == number], dtype=int)
        breath = np.searchsorted(starts, np.arange(len(u)), side="right")
        inside = np.zeros(len(u), dtype=bool)
        for i in np.flatnonzero(known >= 3):
            off_m = u[i] - levels_m[known[i] - 3 : known[i]].mean()
            inside[i] = abs(off_m) <= half_width_m
            parts.setdefault((number, breath[i]), []).append((inside[i], off_m))
        edges = np.flatnonzero(np.diff(np.concatenate(([0], inside.astype(int), [0]))))
        stays_s += list(STEP_S * (edges[1::2] - edges[::2]))
    groups = [np.array(part) for part in parts.values()]
    counts = np.array([len(group) for group in groups], dtype=float)
    insides = np.array([group[:, 0].sum() for group in groups])
    all_off = np.concatenate([group[group[:, 0] == 1, 1] for group in groups])
    squares = np.array([((group[group[:, 0] == 1, 1] - all_off.mean()) ** 2).sum() for group in groups])
    variance, width = ratio(squares, insides)
    width *= 0.5 / variance
    spread = math.sqrt(variance)
    return {
        "share": share(insides, counts),
        "stay_s": mean_of(np.array(stays_s)),
        "inside_sd_m": (spread, [spread / math.exp(width), spread * math.exp(width)]),
    }


class Comparison:
    """The largest differences."""

    def __init__(self):
        self.value, self.interval, self.count, self.failed = 0.0, 0.0, 0, []

    def same(self, where: str, found: float, expected: float, scale: float | None = None) -> None:
        self.count += 1
        off = abs(found - expected) / (scale or abs(expected) or 1.0)
        self.value = max(self.value, off)
        if not off <= VALUES:
            self.failed.append(f"{where}: {found!r}, expected {expected!r}")

    def estimate(self, where: str, found: dict, expected: tuple[float, list[float] | None]) -> None:
        value, interval = expected
        # A drift may be nearly zero, its interval is not.
        scale = max(abs(value), interval[1] - interval[0]) if interval else abs(value)
        self.same(where, found["value"], value, scale)
        if (found["interval_95"] is None) != (interval is None):
            self.failed.append(f"{where}: interval {found['interval_95']}, expected {interval}")
        elif interval:
            off = max(abs(a - b) for a, b in zip(found["interval_95"], interval, strict=True)) / scale
            self.interval = max(self.interval, off)
            if not off <= INTERVALS:
                self.failed.append(f"{where}: interval {found['interval_95']}, expected {interval}")


def compare(name: str, answer: dict, times_s: np.ndarray, positions_m: np.ndarray, seen: Comparison) -> None:
    times_s, positions_m, zero, astray = remove_lost(times_s, positions_m)
    trace = Trace(resample(times_s, positions_m))
    seen.same(f"{name} lost", answer["lost"]["zero"], zero)
    seen.same(f"{name} astray", answer["lost"]["out_of_order"], astray)
    seen.same(f"{name} axis", 1.0 - float(np.dot(answer["axis"]["direction"], trace.axis)), 0.0)
    seen.same(f"{name} share", answer["axis"]["share"], trace.share)
    seen.same(f"{name} breaths", answer["breaths"], len(trace.breaths))
    if seen.failed:
        return
    amplitudes, periods, near, samples = (
        np.array([b[key] for b in trace.breaths]) for key in ("amplitude", "period", "near", "samples")
    )
    period_s = periods.mean()
    seen.estimate(f"{name} amplitude", answer["amplitude_m"], mean_of(amplitudes))
    seen.estimate(f"{name} amplitude cv", answer["amplitude_cv"], variation(amplitudes))
    seen.estimate(f"{name} period", answer["period_s"], mean_of(periods))
    seen.estimate(f"{name} period cv", answer["period_cv"], variation(periods))
    seen.estimate(f"{name} drift", answer["drift_m_per_s"], drift(trace, period_s))
    seen.estimate(f"{name} near", answer["near_expiration"], share(near, samples))
    levels = {each["after_s"]: each for each in answer["level"]}
    for after_s in AFTER_S:
        expected = level(trace, after_s, period_s, answer["duration_s"])
        if (expected is None) != (after_s not in levels):
            seen.failed.append(f"{name}: level after {after_s} s is on one side alone")
        elif expected:
            pairs, estimate, worst_m = expected
            seen.same(f"{name} pairs {after_s}", levels[after_s]["pairs"], pairs)
            seen.estimate(f"{name} level {after_s}", levels[after_s]["rms_m"], estimate)
            seen.same(f"{name} worst {after_s}", levels[after_s]["worst_m"], worst_m)
    for found in answer["windows"]:
        expected = window(trace, found["of_amplitude"] * amplitudes.mean())
        for key, estimate in expected.items():
            seen.estimate(f"{name} window {found['of_amplitude']} {key}", found[key], estimate)


def run(program: str, path: Path, unit: list[str]) -> dict:
    done = subprocess.run([program, "breath", str(path), *unit, "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{path}: exit status {done.returncode}\n{done.stderr}")
    return json.loads(done.stdout)["recordings"][0]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True)
    parser.add_argument("--recording", nargs="*", default=[], type=Path)
    arguments = parser.parse_args()
    seen = Comparison()
    breaths, found = 0, 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(TRACES):
            *trace, form = make_trace(seed)
            path = Path(folder) / f"trace_{seed}.csv"
            times_s, positions_m = write_trace(path, *trace, form)
            answer = run(arguments.program, path, [] if form == "comma" else ["--unit", "mm"])
            compare(path.stem, answer, times_s, positions_m, seen)
            breaths += answer["breaths"]
            # A trace that is a thousandth of a per cent larger is another one.
            other = Comparison()
            compare(path.stem, answer, times_s, 1.00001 * positions_m, other)
            found += bool(other.failed)
    for path in arguments.recording:
        answer = run(arguments.program, path, ["--unit", "mm"])
        compare(path.stem, answer, *read_recording(path), seen)
    for line in seen.failed[:20]:
        print(line)
    print(
        f"{TRACES + len(arguments.recording)} traces, {breaths} breaths, {seen.count} values: "
        f"off by at most {seen.value:.1e}, their intervals by {seen.interval:.1e} (relative)"
    )
    if seen.failed:
        sys.exit(f"{len(seen.failed)} differ")
    if found < TRACES:
        sys.exit(f"of {TRACES} traces that were changed {TRACES - found} were not found")


if __name__ == "__main__":
    main()
