"""Writes log.csv, commanded.csv and reference.json: the formulas of ISO 9283 in NumPy.

Run with `python3 make_reference.py` beside them; NumPy 2 wrote the files that are here.
"""

import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
CYCLES = 30


def rotation(vector: np.ndarray) -> np.ndarray:
    """Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def vector(matrix: np.ndarray) -> np.ndarray:
    """Rotation vector of a small rotation."""
    axis = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    sine = np.linalg.norm(axis) / 2
    return axis / 2 * (np.arcsin(sine) / sine if sine > 0 else 1.0)


def main() -> None:
    rng = np.random.default_rng(9283)
    commanded = {
        pose: (np.round(rng.uniform(-300, 300, 3), 3), np.round(rng.uniform(-1.5, 1.5, 3), 6))
        for pose in range(1, 6)
    }
    lines = ["pose;x [mm];y [mm];z [mm];rx [rad];ry [rad];rz [rad]"]
    for pose, (position, turn) in commanded.items():
        numbers = ";".join(str(value).replace(".", ",") for value in (*position, *turn))
        lines.append(f"P{pose};{numbers}")
    (HERE / "commanded.csv").write_text("\n".join(lines) + "\n")

    rows, reference = [], {"poses": {}, "directional": {}}
    for pose, (position, turn) in commanded.items():
        for axis in ("", "x", "y", "z") if pose in (1, 2, 4) else ("",):
            bias = rng.normal(0, 0.2, 3)
            lean = rng.normal(0, 0.001, 3)
            for cycle in range(1, CYCLES + 1):
                at = np.round(position + bias + rng.normal(0, 0.03, 3), 4)
                small = lean + rng.normal(0, 0.0002, 3)
                whole = rotation(small) @ rotation(turn)
                # Rotation vector of the whole rotation, by its eigenvector.
                values, vectors = np.linalg.eig(whole)
                unit = np.real(vectors[:, np.argmin(abs(values - 1))])
                angle = np.arccos(np.clip((np.trace(whole) - 1) / 2, -1, 1))
                sense = np.array(
                    [
                        whole[2, 1] - whole[1, 2],
                        whole[0, 2] - whole[2, 0],
                        whole[1, 0] - whole[0, 1],
                    ]
                )
                rv = np.round(unit * angle * (1 if unit @ sense > 0 else -1), 7)
                rows.append((cycle, pose, axis, at, rv))
    rows.sort(key=lambda row: (row[2], row[0], -row[1]))
    text = ["// Tracker log, made by make_reference.py", "cycle,Point,Approach,X_mm,Y_mm,Z_mm,Rx_rad,Ry_rad,Rz_rad,RMS_mm"]
    for cycle, pose, axis, at, rv in rows:
        numbers = ",".join(str(value) for value in (*at, *rv))
        text.append(f"{cycle},P{pose},{axis},{numbers},0.004")
    (HERE / "log.csv").write_text("\n".join(text) + "\n")

    for pose, (position, turn) in commanded.items():
        def of(axis: str) -> tuple[np.ndarray, np.ndarray]:
            found = [row for row in rows if row[1] == pose and row[2] == axis]
            points = np.array([row[3] for row in found])
            turns = np.array([vector(rotation(row[4]) @ rotation(turn).T) for row in found])
            return points, turns

        points, turns = of("")
        mean = points.mean(axis=0)
        distances = np.linalg.norm(points - mean, axis=1)
        reference["poses"][pose] = {
            "ap_mm": np.linalg.norm(mean - position),
            "rp_mm": distances.mean() + 3 * distances.std(ddof=1),
            "ap_rad": turns.mean(axis=0).tolist(),
            "rp_rad": (3 * turns.std(axis=0, ddof=1)).tolist(),
        }
        if pose in (1, 2, 4):
            means = [of(axis)[0].mean(axis=0) for axis in "xyz"]
            leans = np.array([of(axis)[1].mean(axis=0) for axis in "xyz"])
            reference["directional"][pose] = {
                "vap_mm": max(np.linalg.norm(a - b) for a in means for b in means),
                "vap_rad": np.ptp(leans, axis=0).tolist(),
            }
    (HERE / "reference.json").write_text(json.dumps(reference, indent=1) + "\n")


main()
