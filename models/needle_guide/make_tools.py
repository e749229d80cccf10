"""Write `offset.urdf`, `perpendicular.urdf` and `inline.urdf` next to this file.

Run as `python3 make_tools.py`. Standard library only; the same bytes every time.

A tool is a list of parts: boxes and cylinders with a material. Masses and inertias are those of the parts at uniform
density, visuals are the parts, collision shapes are the parts grown by 0.2 mm. Lengths in this file are millimetres,
masses grams; the URDF is in metres and kilograms. Frames and choices: README.md.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path

Vector = tuple[float, float, float]

ALUMINIUM, STEEL, PEEK = 2.70e-3, 7.85e-3, 1.30e-3
"""Densities, g/mm3: EN AW-6082, carbon steel, unfilled PEEK."""

COLORS = {
    "aluminium": "0.72 0.74 0.77 1",
    "peek": "0.80 0.70 0.52 1",
    "steel": "0.20 0.20 0.22 1",
}

HALF_PI = "1.5707963267948966"
RPY = {"x": f"0 {HALF_PI} 0", "y": f"{HALF_PI} 0 0", "z": "0 0 0", "-y": f"{HALF_PI} 0 0"}
"""Turns the z axis of a part or a frame to the named axis; a cylinder's sign does not matter, so y serves as -y."""

PLATE_RADIUS = 31.5
PLATE_HEIGHT = 10.0
BUSH_RADIUS = 6.0
COLLISION_MARGIN = 0.2

GUIDE_LENGTH = 50.0
BORE = 1.40
NEEDLE_GAUGE = 18
NEEDLE_OD = 1.270
NEEDLE_LENGTH = 200.0


@dataclass(frozen=True)
class Part:
    """A box (`size` = edge lengths) or a cylinder (`size` = radius, length, bore radius)."""

    name: str
    kind: str
    centre: Vector
    size: Vector
    color: str
    density: float
    axis: str = "z"
    collides: bool = False
    shown: bool = True
    on_flange: bool = False

    def mass_and_moments(self) -> tuple[float, Vector]:
        """Mass, g, and moments of inertia about the part's centre along x, y, z, g mm2."""
        a, b, c = self.size
        if self.kind == "box":
            mass = self.density * a * b * c
            return mass, (mass * (b * b + c * c) / 12.0, mass * (a * a + c * c) / 12.0, mass * (a * a + b * b) / 12.0)
        mass = self.density * math.pi * (a * a - c * c) * b
        axial = mass * (a * a + c * c) / 2.0
        across = mass * (3.0 * (a * a + c * c) + b * b) / 12.0
        return mass, (across, axial if self.axis == "y" else across, axial if self.axis == "z" else across)

    def geometry(self, margin: float) -> tuple[Vector, str]:
        """Centre and URDF geometry, grown by `margin` on every side but the one that lies on the flange."""
        x, y, z = self.centre
        if self.kind == "box":
            sides = " ".join(metres(edge + 2.0 * margin) for edge in self.size)
            return self.centre, f'<box size="{sides}"/>'
        radius, length = self.size[0] + margin, self.size[1] + 2.0 * margin
        if self.on_flange:
            z, length = z + margin / 2.0, length - margin
        return (x, y, z), f'<cylinder radius="{metres(radius)}" length="{metres(length)}"/>'


@dataclass(frozen=True)
class Tool:
    """Parts of the bracket and of the guide tube, and where the needle enters."""

    name: str
    summary: str
    entry: Vector
    direction: str
    bracket: list[Part] = field(default_factory=list)


def metres(millimetres: float) -> str:
    """Shortest decimal of a length in metres, to 1 nm."""
    text = f"{millimetres / 1000.0:.9f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def triple(vector: Vector) -> str:
    """Three lengths in metres."""
    return " ".join(metres(value) for value in vector)


def box(name: str, low: Vector, high: Vector) -> Part:
    """Aluminium box between two corners."""
    centre = ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, (low[2] + high[2]) / 2.0)
    size = (high[0] - low[0], high[1] - low[1], high[2] - low[2])
    return Part(name, "box", centre, size, "aluminium", ALUMINIUM, collides=True)


def flange_plate() -> list[Part]:
    """Disc of the flange's diameter with four M6 screws, sunk flush, on the 50 mm circle at 45 degrees."""
    centre = (0.0, 0.0, PLATE_HEIGHT / 2.0)
    size = (PLATE_RADIUS, PLATE_HEIGHT, 0.0)
    plate = Part("plate", "cylinder", centre, size, "aluminium", ALUMINIUM, collides=True, on_flange=True)
    parts = [plate]
    for i in range(4):
        angle = math.pi * (2 * i + 1) / 4.0
        x, y = 25.0 * math.cos(angle), 25.0 * math.sin(angle)
        # The screw counts with what it weighs more than the aluminium that the plate has already put in its place.
        excess = STEEL - ALUMINIUM
        parts.append(Part(f"screw_{i}", "cylinder", (x, y, 7.05), (5.0, 6.1, 0.0), "steel", excess))
        parts.append(Part(f"shank_{i}", "cylinder", (x, y, 2.0), (3.0, 4.0, 0.0), "steel", excess, shown=False))
    return parts


def bored_block(low: Vector, high: Vector, axis: str) -> list[Part]:
    """Block that holds the guide tube in a through hole along `axis`."""
    block = box("block", low, high)
    length = block.size["xyz".index(axis)]
    hole = Part(
        "hole", "cylinder", block.centre, (BUSH_RADIUS, length, 0.0), "aluminium", -ALUMINIUM, axis, shown=False
    )
    return [block, hole]


TOOLS = [
    Tool(
        name="offset",
        summary="guide parallel to the flange axis, 70 mm beside it: a needle can be inserted from behind",
        entry=(0.0, -70.0, 30.0),
        direction="z",
        bracket=[
            *flange_plate(),
            box("column", (-6.0, -20.0, 10.0), (6.0, 10.0, 71.0)),
            box("arm", (-6.0, -59.0, 39.0), (6.0, -20.0, 71.0)),
            *bored_block((-11.0, -81.0, 35.0), (11.0, -59.0, 75.0), "z"),
        ],
    ),
    Tool(
        name="perpendicular",
        summary="guide across the flange axis, 70 mm ahead of the flange, pointing along -y",
        entry=(0.0, -15.0, 70.0),
        direction="-y",
        bracket=[
            *flange_plate(),
            box("column", (-6.0, -24.0, 10.0), (6.0, 6.0, 44.0)),
            box("arm", (-6.0, -58.0, 24.0), (6.0, -24.0, 59.0)),
            *bored_block((-11.0, -60.0, 59.0), (11.0, -20.0, 81.0), "y"),
        ],
    ),
    Tool(
        name="inline",
        summary="guide on the flange axis; slotted, the needle is loaded from the side: for comparison only",
        entry=(0.0, 0.0, 40.0),
        direction="z",
        bracket=[
            *flange_plate(),
            box("column", (-8.0, 11.0, 10.0), (8.0, 29.0, 85.0)),
            *bored_block((-11.0, -11.0, 45.0), (11.0, 11.0, 85.0), "z"),
        ],
    ),
]


def tube() -> list[Part]:
    """Guide tube in its own frame: z along the needle, origin at the entry."""
    size = (BUSH_RADIUS, GUIDE_LENGTH, BORE / 2.0)
    bush = Part("tube", "cylinder", (0.0, 0.0, GUIDE_LENGTH / 2.0), size, "peek", PEEK, collides=True)
    # Marks the mouths of the bore, which the visual cylinder does not show.
    mouths = [
        Part(f"mouth_{i}", "cylinder", (0.0, 0.0, z), (1.5, 0.2, 0.0), "steel", 0.0)
        for i, z in enumerate((0.0, GUIDE_LENGTH))
    ]
    return [bush, *mouths]


def moment_kg_m2(moment: float) -> str:
    """A moment of inertia given in g mm2, in kg m2 (factor 1e-9) to six digits of the smallest moment here."""
    value = round(moment * 1e-9, 13)
    return f"{value:.13f}" if value else "0"


def inertial(parts: list[Part]) -> str:
    """Mass, centre of mass and inertia about it of all parts together."""
    total = 0.0
    moment = [0.0, 0.0, 0.0]
    for part in parts:
        mass, _ = part.mass_and_moments()
        total += mass
        moment = [moment[k] + mass * part.centre[k] for k in range(3)]
    centre = [value / total for value in moment]
    tensor = [[0.0] * 3 for _ in range(3)]
    for part in parts:
        mass, own = part.mass_and_moments()
        d = [part.centre[k] - centre[k] for k in range(3)]
        square = sum(value * value for value in d)
        for i in range(3):
            for j in range(3):
                tensor[i][j] += mass * ((square if i == j else 0.0) - d[i] * d[j]) + (own[i] if i == j else 0.0)
    names = ("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2)
    values = " ".join(f'{name}="{moment_kg_m2(tensor[i][j])}"' for name, i, j in names)
    x, y, z = centre
    return (
        "    <inertial>\n"
        f'      <origin xyz="{triple((round(x, 4) + 0.0, round(y, 4) + 0.0, round(z, 4) + 0.0))}"/>\n'
        f'      <mass value="{total / 1000.0:.6f}"/>\n'
        f"      <inertia {values}/>\n"
        "    </inertial>\n"
    )


def link(name: str, parts: list[Part]) -> str:
    """A link with its inertial, visuals and collision shapes."""
    text = f'  <link name="{name}">\n' + inertial(parts)
    for element, margin in (("visual", 0.0), ("collision", COLLISION_MARGIN)):
        for part in parts:
            if not (part.collides if element == "collision" else part.shown):
                continue
            centre, geometry = part.geometry(margin)
            text += f'    <{element} name="guide.{part.name}">\n' if element == "collision" else "    <visual>\n"
            text += f'      <origin xyz="{triple(centre)}" rpy="{RPY[part.axis]}"/>\n'
            text += f"      <geometry>{geometry}</geometry>\n"
            text += f'      <material name="guide_{part.color}"/>\n' if element == "visual" else ""
            text += f"    </{element}>\n"
    return text + "  </link>\n\n"


def joint(parent: str, child: str, xyz: Vector, rpy: str = "0 0 0") -> str:
    """A fixed joint."""
    return (
        f'  <joint name="{parent}-{child}" type="fixed">\n'
        f'    <parent link="{parent}"/>\n'
        f'    <child link="{child}"/>\n'
        f'    <origin xyz="{triple(xyz)}" rpy="{rpy}"/>\n'
        "  </joint>\n"
    )


def urdf(tool: Tool) -> str:
    """The whole file."""
    text = '<?xml version="1.0"?>\n'
    text += f"<!-- Needle guide: {tool.summary}.\n"
    text += "     Written by make_tools.py; frames, sources and grades: README.md. Lengths m, masses kg. -->\n"
    text += f'<robot name="needle_guide_{tool.name}">\n'
    text += (
        f'  <needle_guide bore_mm="{BORE:.2f}" guide_length_mm="{GUIDE_LENGTH:g}" needle_gauge="{NEEDLE_GAUGE}"'
        f' needle_od_mm="{NEEDLE_OD:.3f}" needle_length_mm="{NEEDLE_LENGTH:g}"/>\n\n'
    )
    for name, rgba in COLORS.items():
        text += f'  <material name="guide_{name}"><color rgba="{rgba}"/></material>\n'
    text += '\n  <link name="tool_mount"/>\n\n'
    text += link("bracket", tool.bracket)
    text += link("guide_tube", tube())
    for frame in ("guide_entry", "guide_exit", "needle_tip"):
        text += f'  <link name="{frame}"/>\n'
    text += "\n" + joint("tool_mount", "bracket", (0.0, 0.0, 0.0))
    text += joint("tool_mount", "guide_entry", tool.entry, RPY[tool.direction])
    text += joint("guide_entry", "guide_tube", (0.0, 0.0, 0.0))
    text += joint("guide_entry", "guide_exit", (0.0, 0.0, GUIDE_LENGTH))
    text += joint("guide_entry", "needle_tip", (0.0, 0.0, NEEDLE_LENGTH))
    return text + "</robot>\n"


def main() -> None:
    """Write every tool."""
    folder = Path(__file__).resolve().parent
    for tool in TOOLS:
        (folder / f"{tool.name}.urdf").write_text(urdf(tool), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
