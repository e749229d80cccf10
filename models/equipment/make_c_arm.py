"""Writes c_arm.stl: the arc of a mobile C-arm, an arc of rectangular section, in millimetres.

The arc lies in the plane y = 0 about the origin, open towards -x: the isocentre is the file's origin.
Sizes are those of the usual full-size mobile systems, rounded (assumed): an arc of 1400 mm across and
75 mm by 110 mm of section, which spans 210 degrees.

    python3 models/equipment/make_c_arm.py
"""

import math
import struct
from pathlib import Path

INNER_MM, OUTER_MM = 625.0, 700.0
HALF_WIDTH_MM = 55.0
SPAN_DEG = 210.0
STEPS = 28


def corners(step: int) -> list[tuple[float, float, float]]:
    """The four corners of the section at one step along the arc."""
    angle = math.radians(SPAN_DEG * (step / STEPS - 0.5))
    return [
        (radius * math.cos(angle), y, radius * math.sin(angle))
        for radius, y in [
            (INNER_MM, -HALF_WIDTH_MM),
            (OUTER_MM, -HALF_WIDTH_MM),
            (OUTER_MM, HALF_WIDTH_MM),
            (INNER_MM, HALF_WIDTH_MM),
        ]
    ]


def triangles() -> list[list[tuple[float, float, float]]]:
    """Counter-clockwise seen from outside."""
    found = []
    for step in range(STEPS):
        here, there = corners(step), corners(step + 1)
        for k in range(4):
            n = (k + 1) % 4
            found.append([here[k], here[n], there[n]])
            found.append([here[k], there[n], there[k]])
    first, last = corners(0), corners(STEPS)
    found += [[first[0], first[2], first[1]], [first[0], first[3], first[2]]]
    found += [[last[0], last[1], last[2]], [last[0], last[2], last[3]]]
    return found


def volume_mm3(parts: list[list[tuple[float, float, float]]]) -> float:
    """Six times the signed volumes of the tetrahedra with the origin, over six."""
    return (
        sum(
            a[0] * (b[1] * c[2] - b[2] * c[1])
            - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
            for a, b, c in parts
        )
        / 6.0
    )


def main() -> None:
    """Writes the file, its triangles turned so that they face outwards."""
    parts = triangles()
    if volume_mm3(parts) < 0.0:
        parts = [[a, c, b] for a, b, c in parts]
    with Path(__file__).with_name("c_arm.stl").open("wb") as file:
        file.write(b"C-arm, mm; made by make_c_arm.py".ljust(80))
        file.write(struct.pack("<I", len(parts)))
        for part in parts:
            numbers = [0.0] * 3 + [x for corner in part for x in corner]
            file.write(struct.pack("<12fH", *numbers, 0))


if __name__ == "__main__":
    main()
