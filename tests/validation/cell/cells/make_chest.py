"""Writes chest.stl: a chest whose front is hollow, so that it is not convex; in centimetres.

    python3 tests/validation/cell/cells/make_chest.py
"""

import math
import struct
from pathlib import Path

RINGS, SPOKES = 20, 36
# Half of breadth, depth and length.
HALF_CM = (15.9, 10.7, 24.0)
# The hollow over the breastbone: depth, and its reach across and along.
HOLLOW_CM, ACROSS_CM, ALONG_CM = 4.0, 6.0, 12.0


def point(ring: int, spoke: int) -> tuple[float, float, float]:
    """A point of the surface: x left, y back, z head."""
    polar = math.pi * ring / RINGS
    turn = 2.0 * math.pi * spoke / SPOKES
    across = math.sin(polar) if ring < RINGS else 0.0
    x = HALF_CM[0] * across * math.cos(turn)
    y = HALF_CM[1] * across * math.sin(turn)
    z = HALF_CM[2] * math.cos(polar)
    if y < 0.0:
        near = math.exp(-((x / ACROSS_CM) ** 2) - (z / ALONG_CM) ** 2)
        y += min(HOLLOW_CM * near, -0.8 * y)
    return x, y, z


def triangles() -> list[list[tuple[float, float, float]]]:
    """Counter-clockwise seen from outside."""
    found = []
    for ring in range(RINGS):
        for spoke in range(SPOKES):
            here, there = spoke, (spoke + 1) % SPOKES
            a, b = point(ring, here), point(ring, there)
            c, d = point(ring + 1, here), point(ring + 1, there)
            if ring > 0:
                found.append([a, d, b])
            if ring + 1 < RINGS:
                found.append([a, c, d])
    return found


def main() -> None:
    """Writes the file; the poles are one point each."""
    with Path(__file__).with_name("chest.stl").open("wb") as file:
        parts = triangles()
        file.write(b"hollow chest, cm; made by make_chest.py".ljust(80))
        file.write(struct.pack("<I", len(parts)))
        for part in parts:
            numbers = [0.0] * 3 + [x for corner in part for x in corner]
            file.write(struct.pack("<12fH", *numbers, 0))


if __name__ == "__main__":
    main()
