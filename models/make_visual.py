"""Write the visual surfaces of the shipped arms, `ARM/visual/*.stl`, next to this file.

Run as `python3 make_visual.py [ARM ...]`; all arms if none is named. Standard library only; the same bytes every time.

The surfaces are our own: surfaces of revolution and one swept bend, drawn to the size of the collision primitives of
the arm's URDF (every vertex lies inside them or within 1 mm). Nothing is taken from the manufacturer's meshes. They are
for pictures; no collision, distance or mass comes from them.

Lengths in this file are millimetres, in the frame of the link that the file is named after; the STL files are in
metres. One file per link and colour. `Surface`, `Link` and `drum` draw; after them come the arms.
"""

import itertools
import math
import struct
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

Point = tuple[float, float, float]
Triangle = tuple[Point, Point, Point]
Profile = list[tuple[float, float]]
"""(position along the axis, radius), in order along the axis."""

SEGMENTS = 36
"""Facets around a housing: 10 degrees each."""
SMALL_SEGMENTS = 16
"""Facets around a screw or a plug."""

LID_EDGE: Profile = [(0.0, 0.0), (6.0, 0.2), (10.5, 1.7), (13.2, 5.5), (14.0, 12.0)]
"""Side view of a lid: (height above its seam, how far the radius has shrunk)."""

AXES: dict[str, tuple[Point, Point, Point]] = {
    "x": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "y": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "z": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
}
"""Right-handed (u, v, axis) for a revolution about each coordinate axis."""


@dataclass
class Surface:
    """Closed triangle surfaces of one colour, counter-clockwise seen from outside."""

    triangles: list[Triangle] = field(default_factory=list)

    def skin(self, rings: list[list[Point]]) -> None:
        """Join consecutive rings of points; a ring of one point is an apex."""
        for lower, upper in itertools.pairwise(rings):
            count = max(len(lower), len(upper))
            for i in range(count):
                j = (i + 1) % count
                if len(lower) > 1:
                    self.triangles.append((lower[i], lower[j], upper[i % len(upper)]))
                if len(upper) > 1:
                    self.triangles.append((lower[j % len(lower)], upper[j], upper[i]))

    def lathe(
        self,
        axis: str,
        profile: Profile,
        *,
        centre: Point = (0.0, 0.0, 0.0),
        segments: int = SEGMENTS,
        flat_y: float | None = None,
    ) -> None:
        """Turn `profile` about an axis through `centre`; the ends are closed by flat discs.

        `flat_y` mills the piece off at that y coordinate.
        """
        u, v, w = AXES[axis]
        ends = [(profile[0][0], 0.0), *profile, (profile[-1][0], 0.0)]
        if ends[0] == ends[1]:
            ends.pop(0)
        if ends[-1] == ends[-2]:
            ends.pop()
        rings: list[list[Point]] = []
        for along, radius in ends:
            ring: list[Point] = []
            for i in range(segments if radius > 0.0 else 1):
                angle = 2.0 * math.pi * (i + 0.5) / segments
                a, b = radius * math.cos(angle), radius * math.sin(angle)
                x, y, z = (centre[k] + a * u[k] + b * v[k] + along * w[k] for k in range(3))
                ring.append((x, y if flat_y is None else max(y, flat_y), z))
            rings.append(ring)
        self.skin(rings)

    def sweep_xz(self, path: list[tuple[float, float, float, float]]) -> None:
        """Sweep a circle along a path in the xz plane: (x, z, direction from +x towards +z in rad, radius)."""
        rings: list[list[Point]] = []
        for x, z, heading, radius in path:
            # Ring plane: y, and the direction that makes (y, w, heading) right-handed.
            wx, wz = -math.sin(heading), math.cos(heading)
            ring: list[Point] = []
            for i in range(SEGMENTS):
                angle = 2.0 * math.pi * (i + 0.5) / SEGMENTS
                a, b = radius * math.cos(angle), radius * math.sin(angle)
                ring.append((x + b * wx, a, z + b * wz))
            rings.append(ring)
        first, last = path[0], path[-1]
        self.skin([[(first[0], 0.0, first[1])], *rings, [(last[0], 0.0, last[1])]])

    def write(self, path: Path, title: str) -> None:
        """Write a binary STL in metres, without the triangles that vanish (collapsed by a flat)."""
        records: list[bytes] = []
        for corners in self.triangles:
            # Rounding to 0.1 um hides the last digit in which mathematics libraries differ.
            a, b, c = (tuple(round(x * 1e-3, 7) + 0.0 for x in corner) for corner in corners)
            p = [b[k] - a[k] for k in range(3)]
            q = [c[k] - a[k] for k in range(3)]
            normal = (p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0])
            length = math.sqrt(sum(n * n for n in normal))
            if length < 1e-13:
                continue
            unit = (n / length for n in normal)
            records.append(struct.pack("<12fH", *unit, *a, *b, *c, 0))
        header = title.encode("ascii").ljust(80, b" ")[:80]
        path.write_bytes(header + struct.pack("<I", len(records)) + b"".join(records))


@dataclass
class Link:
    """The three coloured surfaces of one link."""

    body: Surface = field(default_factory=Surface)
    blue: Surface = field(default_factory=Surface)
    dark: Surface = field(default_factory=Surface)

    def lid(self, axis: str, seam: float, outward: float, radius: float, *, centre: Point = (0.0, 0.0, 0.0)) -> None:
        """Blue lid from `seam` on in the direction `outward` (+1 or -1) of the axis, with a dark seam under it."""
        edge = [(seam + outward * height, radius - shrink) for height, shrink in LID_EDGE]
        gap = [(seam - outward * 2.0, radius - 1.6), (seam + outward * 0.5, radius - 1.6)]
        self.blue.lathe(axis, edge if outward > 0.0 else edge[::-1], centre=centre)
        self.dark.lathe(axis, gap if outward > 0.0 else gap[::-1], centre=centre)

    def ring(self, axis: str, low: float, high: float, radius: float, *, centre: Point = (0.0, 0.0, 0.0)) -> None:
        """Dark seal ring."""
        self.dark.lathe(axis, [(low, radius), (high, radius)], centre=centre)

    def screws(self, axis: str, at: tuple[float, float], radius: float, circle: float, count: int) -> None:
        """Dark screw heads or holes on a bolt circle (radius `circle`) about the link's axis, from 45 degrees on."""
        u, v, _ = AXES[axis]
        for i in range(count):
            angle = 2.0 * math.pi * (i + 0.5) / count
            a, b = circle * math.cos(angle), circle * math.sin(angle)
            x, y, z = (a * u[k] + b * v[k] for k in range(3))
            self.dark.lathe(axis, [(at[0], radius), (at[1], radius)], centre=(x, y, z), segments=SMALL_SEGMENTS)


def drum(low: float, high: float, radius: float, edge_low: float, edge_high: float) -> Profile:
    """Cylinder with rounded edges of the given radii."""
    profile: Profile = []
    for at, inward, edge in ((low, 1.0, edge_low), (high, -1.0, edge_high)):
        corner = [
            (at + inward * edge * (1.0 - math.sin(angle)), radius - edge * (1.0 - math.cos(angle)))
            for angle in (math.pi / 2.0, math.pi / 4.0, 0.0)
        ]
        profile += corner if inward > 0.0 else corner[::-1]
    return profile


def ur3_base() -> Link:
    """Foot with four mounting screws, barrel, and the plug of the cable to the control box (base_link_inertia)."""
    link = Link()
    foot: Profile = [(0.0, 62.8), (1.0, 63.8), (9.5, 63.8), (11.0, 62.3), (11.0, 50.5)]
    barrel: Profile = [(13.5, 48.2), (18.0, 47.0), (60.0, 46.0), (80.5, 46.0), (83.0, 44.5)]
    link.body.lathe("z", foot + barrel)
    link.screws("z", (10.0, 13.0), 4.6, 56.5, 4)
    link.ring("z", 82.0, 86.0, 43.5)
    socket: Profile = [(40.0, 8.2), (76.0, 8.2), (77.0, 7.2)]
    plug: Profile = [(76.0, 7.0), (80.0, 7.0), (80.0, 8.2), (92.0, 8.2), (93.0, 7.0), (99.0, 5.5)]
    link.body.lathe("y", socket, centre=(-5.9, 0.0, 9.4), segments=SMALL_SEGMENTS)
    link.dark.lathe("y", plug, centre=(-5.9, 0.0, 9.4), segments=SMALL_SEGMENTS)
    return link


def ur3_shoulder() -> Link:
    """Upright drum with a lid on top; the shoulder lift joint leaves along -y."""
    link = Link()
    link.ring("z", -66.0, -63.0, 43.5)
    link.body.lathe("z", drum(-64.0, 38.8, 45.7, 2.5, 1.0))
    link.lid("z", 40.3, 1.0, 44.8)
    link.body.lathe("y", drum(-51.5, 5.0, 45.9, 2.0, 8.0))
    link.ring("y", -54.2, -50.0, 43.5)
    return link


def ur3_upper_arm() -> Link:
    """Shoulder drum and elbow drum across the ends of a tube along -x."""
    link = Link()
    link.ring("z", 53.9, 58.0, 43.5)
    link.body.lathe("z", drum(56.5, 161.5, 46.4, 2.0, 1.0))
    link.lid("z", 163.0, 1.0, 45.6)
    neck: Profile = [(-78.5, 35.0), (-77.0, 38.5), (-72.0, 42.5), (-63.0, 45.2), (-45.0, 45.9), (-8.0, 45.9)]
    tube: Profile = [(-176.0, 33.2), (-128.0, 31.6), (-80.0, 33.2)]
    collar: Profile = [(-236.0, 38.3), (-188.0, 38.3), (-180.0, 36.8), (-177.0, 34.2)]
    for part in (neck, tube, collar):
        link.body.lathe("x", part, centre=(0.0, 0.0, 120.0))
    for seam in (-78.8, -177.2):
        link.ring("x", seam - 1.0, seam + 1.0, 32.4, centre=(0.0, 0.0, 120.0))
    elbow = (-243.0, 0.0, 0.0)
    link.ring("z", 69.4, 76.0, 37.5, centre=elbow)
    link.body.lathe("z", drum(74.5, 161.5, 40.9, 2.0, 1.0), centre=elbow)
    link.lid("z", 163.0, 1.0, 40.2, centre=elbow)
    return link


def ur3_forearm() -> Link:
    """The bend at the elbow, a tube along -x, and the wrist drum across its end."""
    link = Link()
    bend = [
        # Quarter circle about (-43, 70.4) from the elbow axis (heading -z) to the tube's axis (heading -x).
        (-43.0 + 43.0 * math.cos(angle), 70.4 - 43.0 * math.sin(angle), -math.pi / 2.0 - angle, radius)
        for angle, radius in ((math.pi / 2.0 * step / 8.0, 37.0 - 4.8 * step / 8.0) for step in range(9))
    ]
    lip = [(0.0, 73.0, -math.pi / 2.0, 36.0), (0.0, 71.8, -math.pi / 2.0, 37.0)]
    link.body.sweep_xz([*lip, *bend, (-70.0, 27.4, -math.pi, 32.0), (-71.5, 27.4, -math.pi, 31.0)])
    link.ring("z", 71.0, 76.0, 35.0)
    tube: Profile = [(-202.0, 31.6), (-185.0, 31.4), (-130.0, 30.0), (-74.0, 31.6)]
    link.body.lathe("x", tube, centre=(0.0, 0.0, 27.4))
    link.ring("x", -75.0, -70.5, 30.3, centre=(0.0, 0.0, 27.4))
    wrist = (-213.25, 0.0, 0.0)
    link.body.lathe("z", drum(-3.5, 66.5, 32.6, 1.0, 2.0), centre=wrist)
    link.lid("z", -5.0, -1.0, 32.2, centre=wrist)
    link.ring("z", 65.5, 69.8, 30.5, centre=wrist)
    return link


def ur3_wrist_1() -> Link:
    """Drum along y, lid at +y; the forearm's joint is at -z, wrist 2 leaves along -y."""
    link = Link()
    link.ring("z", -46.5, -42.0, 29.8)
    link.body.lathe("z", drum(-43.0, 0.0, 31.6, 2.0, 2.0))
    link.body.lathe("y", drum(-39.5, 31.0, 31.6, 2.0, 1.0))
    link.lid("y", 32.5, 1.0, 31.2)
    link.ring("y", -42.5, -38.0, 29.8)
    return link


def ur3_wrist_2() -> Link:
    """Drum along y, lid at -y; wrist 1 is at -z, wrist 3 leaves along +y."""
    link = Link()
    link.ring("z", -46.4, -42.0, 29.8)
    link.body.lathe("z", drum(-43.0, 0.0, 31.4, 2.0, 2.0))
    link.body.lathe("y", drum(-32.7, 37.8, 31.6, 1.0, 2.0))
    link.lid("y", -34.2, -1.0, 31.2)
    link.ring("y", 36.5, 40.8, 29.8)
    return link


def ur3_wrist_3() -> Link:
    """Tool flange: disc with a flat that carries the tool connector, four threads on a 50 mm circle, centring bore."""
    link = Link()
    link.ring("z", -41.4, -37.5, 29.5)
    link.body.lathe("z", drum(-38.5, -1.4, 31.2, 2.0, 1.0), flat_y=-29.0)
    link.screws("z", (-3.0, -1.15), 3.0, 25.0, 4)
    link.dark.lathe("z", [(-3.0, 15.75), (-1.15, 15.75)], segments=32)
    link.body.lathe("z", [(-2.5, 13.5), (-1.0, 13.5)], segments=32)
    link.dark.lathe("z", [(-3.0, 3.0), (-1.15, 3.0)], centre=(25.0, 0.0, 0.0), segments=SMALL_SEGMENTS)
    connector: Profile = [(-35.6, 3.0), (-35.2, 3.8), (-28.0, 4.2)]
    link.dark.lathe("y", connector, centre=(0.0, 0.0, -17.65), segments=SMALL_SEGMENTS)
    return link


UR3: dict[str, Callable[[], Link]] = {
    "base": ur3_base,
    "shoulder": ur3_shoulder,
    "upper_arm": ur3_upper_arm,
    "forearm": ur3_forearm,
    "wrist_1": ur3_wrist_1,
    "wrist_2": ur3_wrist_2,
    "wrist_3": ur3_wrist_3,
}


@dataclass(frozen=True, kw_only=True)
class ESeries:
    """Sizes of an e-Series arm, read off its collision primitives.

    A housing is a drum about a joint's axis with a lid on one end; a tube ends in a collar at each housing.
    """

    upper_arm: float
    """Length from the shoulder's axis to the elbow's."""
    forearm: float
    """Length from the elbow's axis to wrist 1's."""
    foot: Profile
    """The base from the floor up."""
    shoulder_radius: float
    shoulder_z: tuple[float, float]
    """Bottom and top of the shoulder's upright housing."""
    shoulder_lift: float
    """Where the shoulder's face towards the upper arm is, against y."""
    housing_radius: float
    """Of the upper arm at the shoulder."""
    housing_z: tuple[float, float]
    elbow_radius: float
    """Of the upper arm at the elbow."""
    elbow_z: tuple[float, float]
    tube_z: float
    """Height of the upper arm's tube over the elbow's plane."""
    tube: Profile
    """Along x, from the elbow to the shoulder."""
    bend_radius: tuple[float, float]
    """Of the forearm's bend at the elbow and at its tube."""
    bend_top: float
    """Face towards the upper arm."""
    lip: Profile
    """Below that face, about the elbow's axis."""
    fore_z: float
    """Height of the forearm's tube."""
    fore_tube: Profile
    """Along x, from wrist 1 to the elbow."""
    wrist_radius: float
    fore_wrist_z: tuple[float, float]
    """Lid and face of the forearm's housing at wrist 1."""
    wrist_1_z: float
    """Face of wrist 1 towards the forearm."""
    wrist_1_y: tuple[float, float]
    """Face towards wrist 2, and lid."""
    wrist_2_z: float
    wrist_2_y: tuple[float, float]
    """Lid, and face towards wrist 3."""
    flange: Profile
    """Wrist 3 along its axis, up to the face at z = 0."""
    connector: tuple[float, float, float]
    """Tool connector: height, where it ends against y, radius."""


def lidded(link: Link, axis: str, face: float, end: float, radius: float, *, centre: Point = (0.0, 0.0, 0.0)) -> None:
    """Housing from a joint's `face` to the `end` of its lid, with a dark ring at the face."""
    outward = math.copysign(1.0, end - face)
    seam = end - outward * (LID_EDGE[-1][0] + 1.0)
    low, high = sorted((face + outward * 2.5, seam - outward * 1.5))
    link.body.lathe(axis, drum(low, high, radius, 1.5, 1.5), centre=centre)
    link.lid(axis, seam, outward, radius - 0.6, centre=centre)
    low, high = sorted((face, face + outward * 4.0))
    link.ring(axis, low, high, radius - 2.2, centre=centre)


def e_series(arm: ESeries) -> dict[str, Callable[[], Link]]:
    """Links of an e-Series arm."""

    def base() -> Link:
        link = Link()
        link.body.lathe("z", arm.foot[:-1])
        top, radius = arm.foot[-1]
        link.ring("z", arm.foot[-2][0] - 1.0, top, radius)
        return link

    def shoulder() -> Link:
        link = Link()
        lidded(link, "z", *arm.shoulder_z, arm.shoulder_radius)
        face = -arm.shoulder_lift
        link.body.lathe("y", drum(face + 2.5, 4.0, arm.shoulder_radius, 1.5, 8.0))
        link.ring("y", face, face + 4.0, arm.shoulder_radius - 2.2)
        return link

    def upper_arm() -> Link:
        link = Link()
        lidded(link, "z", *arm.housing_z, arm.housing_radius)
        lidded(link, "z", *arm.elbow_z, arm.elbow_radius, centre=(-arm.upper_arm, 0.0, 0.0))
        link.body.lathe("x", arm.tube, centre=(0.0, 0.0, arm.tube_z))
        return link

    def forearm() -> Link:
        link = Link()
        turn = arm.bend_top - arm.fore_z
        at_elbow, at_tube = arm.bend_radius
        quarter = [math.pi / 2.0 * step / 8.0 for step in range(9)]
        bend = [
            # Quarter circle from the elbow's axis (heading -z) to the tube's axis (heading -x).
            (
                turn * (math.cos(angle) - 1.0),
                arm.bend_top - 3.0 - (turn - 3.0) * math.sin(angle),
                -math.pi / 2.0 - angle,
                at_elbow + (at_tube - at_elbow) * angle / quarter[-1],
            )
            for angle in quarter
        ]
        link.body.sweep_xz(bend)
        link.body.lathe("z", arm.lip)
        link.ring("z", arm.lip[-1][0] - 1.0, arm.bend_top, arm.lip[-1][1] - 2.2)
        link.body.lathe("x", arm.fore_tube, centre=(0.0, 0.0, arm.fore_z))
        lid, face = arm.fore_wrist_z
        lidded(link, "z", face, lid, arm.wrist_radius, centre=(-arm.forearm, 0.0, 0.0))
        return link

    def wrist_1() -> Link:
        link = Link()
        link.ring("z", arm.wrist_1_z, arm.wrist_1_z + 4.0, arm.wrist_radius - 2.2)
        link.body.lathe("z", drum(arm.wrist_1_z + 2.5, 0.0, arm.wrist_radius, 1.5, 2.0))
        lidded(link, "y", *arm.wrist_1_y, arm.wrist_radius)
        return link

    def wrist_2() -> Link:
        link = Link()
        link.ring("z", arm.wrist_2_z, arm.wrist_2_z + 4.0, arm.wrist_radius - 2.2)
        link.body.lathe("z", drum(arm.wrist_2_z + 2.5, 0.0, arm.wrist_radius, 1.5, 2.0))
        lid, face = arm.wrist_2_y
        lidded(link, "y", face, lid, arm.wrist_radius)
        return link

    def wrist_3() -> Link:
        link = Link()
        link.body.lathe("z", arm.flange)
        link.ring("z", arm.flange[0][0] - 2.5, arm.flange[0][0] + 1.0, arm.flange[0][1] - 2.2)
        link.screws("z", (-2.0, 0.1), 3.0, 25.0, 4)
        link.dark.lathe("z", [(-2.0, 15.75), (0.1, 15.75)], segments=32)
        link.body.lathe("z", [(-1.0, 13.5), (0.15, 13.5)], segments=32)
        height, end, radius = arm.connector
        stub: Profile = [(end, radius - 1.0), (end + 1.0, radius), (end + 9.0, radius)]
        link.dark.lathe("y", stub, centre=(0.0, 0.0, height), segments=SMALL_SEGMENTS)
        return link

    return {
        "base": base,
        "shoulder": shoulder,
        "upper_arm": upper_arm,
        "forearm": forearm,
        "wrist_1": wrist_1,
        "wrist_2": wrist_2,
        "wrist_3": wrist_3,
    }


UR3E = ESeries(
    upper_arm=243.55,
    forearm=213.2,
    foot=[(0.0, 63.0), (1.0, 64.0), (21.0, 64.0), (24.0, 63.0), (72.0, 46.2), (76.0, 45.4), (91.0, 45.0), (94.9, 43.0)],
    shoulder_radius=45.2,
    shoulder_z=(-57.0, 57.8),
    shoulder_lift=62.9,
    housing_radius=45.4,
    housing_z=(63.0, 177.8),
    elbow_radius=37.8,
    elbow_z=(66.0, 176.2),
    tube_z=120.0,
    tube=[
        *[(-240.0, 37.6), (-190.0, 37.6), (-186.0, 36.4), (-182.0, 33.4)],
        *[(-131.0, 32.8), (-83.0, 33.4), (-78.0, 40.0), (-72.0, 44.4), (-66.0, 45.2), (-10.0, 45.2)],
    ],
    bend_radius=(36.6, 31.4),
    bend_top=66.9,
    lip=[(50.0, 36.6), (56.0, 37.4), (64.5, 37.4)],
    fore_z=27.0,
    fore_tube=[
        *[(-205.0, 31.5), (-170.0, 31.5), (-167.0, 30.4), (-163.5, 27.2)],
        *[(-111.0, 26.8), (-59.0, 27.2), (-57.0, 30.6), (-54.0, 31.6), (-35.0, 31.6)],
    ],
    wrist_radius=31.6,
    fore_wrist_z=(-19.4, 77.3),
    wrist_1_z=-53.6,
    wrist_1_y=(-49.9, 46.8),
    wrist_2_z=-35.4,
    wrist_2_y=(-46.4, 50.4),
    flange=[(-39.0, 31.4), (-3.0, 31.4), (-1.0, 31.4), (0.0, 30.6)],
    connector=(-29.6, -37.6, 5.0),
)

UR5E = ESeries(
    upper_arm=425.0,
    forearm=392.2,
    foot=[(0.0, 74.4), (1.0, 75.4), (22.0, 75.4), (26.0, 74.0), (72.0, 59.2), (78.0, 58.2), (95.0, 58.0), (99.0, 55.8)],
    shoulder_radius=58.2,
    shoulder_z=(-63.9, 71.2),
    shoulder_lift=74.4,
    housing_radius=58.6,
    housing_z=(74.4, 209.6),
    elbow_radius=58.6,
    elbow_z=(60.2, 209.6),
    tube_z=138.0,
    tube=[
        *[(-420.0, 58.2), (-354.0, 58.2), (-349.0, 56.0), (-336.0, 45.0), (-330.0, 43.0)],
        *[(-212.0, 42.4), (-100.0, 43.0), (-94.0, 47.0), (-84.0, 56.0), (-78.0, 58.2), (-10.0, 58.2)],
    ],
    bend_radius=(52.6, 47.8),
    bend_top=60.3,
    lip=[(26.0, 53.0), (34.0, 56.0), (44.0, 58.0), (58.0, 58.2)],
    fore_z=7.0,
    fore_tube=[
        *[(-385.0, 37.6), (-240.0, 37.0), (-97.0, 38.0)],
        *[(-92.0, 39.0), (-87.0, 46.8), (-84.0, 48.2), (-40.0, 48.2)],
    ],
    wrist_radius=37.8,
    fore_wrist_z=(-49.4, 60.4),
    wrist_1_z=-73.5,
    wrist_1_y=(-53.5, 56.2),
    wrist_2_z=-46.0,
    wrist_2_y=(-56.6, 53.1),
    flange=[(-43.0, 37.6), (-8.5, 37.6), (-6.5, 36.2), (-6.5, 31.6), (-1.0, 31.6), (0.0, 30.6)],
    connector=(-31.5, -43.5, 5.0),
)

ARMS: dict[str, dict[str, Callable[[], Link]]] = {"ur3": UR3, "ur3e": e_series(UR3E), "ur5e": e_series(UR5E)}


def main() -> None:
    """Write every surface that has triangles."""
    for arm in sys.argv[1:] or ARMS:
        folder = Path(__file__).resolve().parent / arm / "visual"
        folder.mkdir(exist_ok=True)
        for name, make in ARMS[arm].items():
            link = make()
            for color, surface in (("body", link.body), ("blue", link.blue), ("dark", link.dark)):
                if surface.triangles:
                    title = arm.upper().replace("E", "e")
                    surface.write(folder / f"{name}_{color}.stl", f"needlebench {title} {name} {color}, m")


if __name__ == "__main__":
    main()
