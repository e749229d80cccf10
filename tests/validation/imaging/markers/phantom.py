"""Markers of the synthetic chest: found, localised, registered, against the truth of `needlebench ct synth`.

    target/markers/bin/python tests/validation/imaging/markers/phantom.py --program target/release/needlebench \
        --finder target/release/scan_markers [--full]

Every marker has to be found and nothing else. Slices that are thicker than a sphere leave its place along them open,
which the covariance has to say: there the error counts in units of the covariance alone. Without --full some of the
scans are made.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

# Root mean square of errors in space, all presets but thick.
RMS_M = 5e-5
# The same where slices lean and voxels are interpolated.
RMS_INTERPOLATED_M = 1e-4
# Probability at which chi-square counts as inconsistent with the covariances.
UNLIKELY = 1e-4

SUBJECTS = ["scenarios/supine_suite.toml", "female-p5-supine", "male-p95-supine"]
PRESETS = ["thin", "biopsy", "thick", "thick-overlap"]
EFFECTS = [[], ["--tilt", "15"], ["--streaks"], ["--kernel", "sharp"]]
FEW = [
    ("scenarios/supine_suite.toml", "biopsy", []),
    ("female-p5-supine", "thick", []),
    ("male-p95-supine", "thick-overlap", ["--tilt", "15"]),
    ("scenarios/supine_suite.toml", "biopsy", ["--kernel", "sharp", "--streaks"]),
]


def limits(freedom):
    """Chi-squares between which those of `freedom` degrees lie but for UNLIKELY on either side."""
    rng = np.random.default_rng(1)
    return np.quantile(rng.chisquare(freedom, 1_000_000), [UNLIKELY, 1 - UNLIKELY])


def look(program, finder, subject, preset, effects):
    """What is wrong with one scan."""
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "ct", "synth", subject, "--out", folder, "--markers", "ct-sphere", "--preset", preset]
        subprocess.run([*command, *effects, "--json"], check=True, capture_output=True)
        truth = json.loads((Path(folder) / "truth.json").read_text())
        answer = subprocess.run([finder, folder], check=True, capture_output=True, text=True)
    found = json.loads(answer.stdout)
    wrong = []
    true = np.array([marker["sphere_center_m"] for marker in truth["markers"]])
    seen = np.array([marker["center_m"] for marker in found["markers"]]).reshape(-1, 3)
    away = np.linalg.norm(seen[:, None] - true[None], axis=2)
    nearest = away.argmin(axis=1) if len(seen) else np.array([], int)
    close = away.min(axis=1) < 5e-3 if len(seen) else np.array([], bool)
    missing = len(true) - len(set(nearest[close]))
    false = len(seen) - len(set(nearest[close]))
    if missing or false:
        wrong.append(f"{missing} missing, {false} false")
    errors = (seen - true[nearest])[close]
    covariances = np.array([marker["covariance_m2"] for marker in found["markers"]])[close]
    chi_squares = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances), errors)
    rms = np.sqrt((errors**2).sum(axis=1).mean())
    told = np.sqrt(np.trace(covariances, axis1=1, axis2=2).mean())
    limit = RMS_INTERPOLATED_M if "--tilt" in effects else RMS_M
    if preset != "thick" and rms > limit:
        wrong.append(f"{1e3 * rms:.3f} mm rms")
    low, high = limits(3 * len(errors))
    if chi_squares.sum() > high:
        wrong.append(f"chi-square of the markers {chi_squares.sum():.1f}, at most {high:.1f}")
    registration = found["registration"]
    line = (
        f"{subject.split('/')[-1]:20} {preset:13} {' '.join(effects):26} {len(seen)} found, "
        f"{1e3 * rms:.3f} mm rms (told {1e3 * told:.3f}), chi-square {chi_squares.sum() / (3 * len(errors)):.2f}, "
        f"{found['seconds']:.2f} s"
    )
    if "error" in registration:
        wrong.append(registration["error"])
    else:
        targets = registration["targets"]
        off = np.array([target["error_m"] for target in targets])
        covariance = np.array([target["covariance_m2"] for target in targets])
        # Targets share their registration: each on its own.
        worst = max(np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance), off), default=0.0)
        if worst > limits(3)[1]:
            wrong.append(f"chi-square of a target {worst:.1f}")
        told = np.sqrt(np.trace(covariance, axis1=1, axis2=2).max()) if len(off) else 0.0
        line += f"; targets off {1e3 * np.linalg.norm(off, axis=1).max(initial=0):.3f} mm at most (told {1e3 * told:.3f} rms)"
    print(line, *wrong, sep="\n    WRONG: " if wrong else "", flush=True)
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--finder", required=True)
    parser.add_argument("--full", action="store_true", help="all subjects, presets and effects")
    options = parser.parse_args()
    scans = FEW
    if options.full:
        scans = [(subject, preset, effects) for subject in SUBJECTS for preset in PRESETS for effects in EFFECTS]
    wrong = [look(options.program, options.finder, *scan) for scan in scans]
    sys.exit(any(wrong))


if __name__ == "__main__":
    main()
