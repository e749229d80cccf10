"""The cell of a scenario, built from its files by Pinocchio and Coal.

Place of the robot, joints, geometry of arm and tool, and obstacles come from the scenario's TOML,
the URDF and the STL files, read by Python and Pinocchio. Phantom, table, gantry and mount, which
needlebench makes from parameters, come from its export, and so does the size of the needle's
corridor.
"""

import json
import math
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from obstacles import obstacle

ROOT = Path(__file__).resolve().parents[3]
JOINTS = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
]
Array = np.ndarray


@dataclass(frozen=True)
class Shape:
    """A convex shape about its own origin, or a mesh, with numpy alone: it shares no code with
    Coal and none with needlebench."""

    kind: str
    radius_m: float
    half_m: Array  # half length on z, or half extents
    vertices_m: Array
    planes: Array  # outward unit normals and offsets: `n . x <= d` inside

    def support(self, n: Array) -> Array:
        """Largest `n . x` over the shape, for the rows of `n` in its frame."""
        across = np.hypot(n[:, 0], n[:, 1])
        match self.kind:
            case "sphere":
                return self.radius_m * np.linalg.norm(n, axis=1)
            case "cylinder":
                return self.radius_m * across + self.half_m[0] * np.abs(n[:, 2])
            case "capsule":
                length = np.linalg.norm(n, axis=1)
                return self.radius_m * length + self.half_m[0] * np.abs(n[:, 2])
            case "cuboid":
                return np.abs(n) @ self.half_m
            case _:
                return (n @ self.vertices_m.T).max(axis=1)

    def outside(self, x: Array) -> Array:
        """At least how far points lie outside the shape; exact but for a convex mesh, where the
        point is drawn towards an inner point until it is inside."""
        match self.kind:
            case "sphere":
                return np.maximum(np.linalg.norm(x, axis=1) - self.radius_m, 0.0)
            case "cylinder":
                radial = np.hypot(x[:, 0], x[:, 1]) - self.radius_m
                axial = np.abs(x[:, 2]) - self.half_m[0]
                return np.hypot(np.maximum(radial, 0.0), np.maximum(axial, 0.0))
            case "capsule":
                z = np.maximum(np.abs(x[:, 2]) - self.half_m[0], 0.0)
                reach = np.sqrt(x[:, 0] ** 2 + x[:, 1] ** 2 + z**2)
                return np.maximum(reach - self.radius_m, 0.0)
            case "cuboid":
                return np.linalg.norm(np.maximum(np.abs(x) - self.half_m, 0.0), axis=1)
            case "convex":
                middle = self.vertices_m.mean(axis=0)
                slack = self.planes[:, 3] - self.planes[:, :3] @ middle
                reach = ((x - middle) @ self.planes[:, :3].T / slack).max(axis=1)
                share = np.maximum(1.0 - 1.0 / np.maximum(reach, 1e-300), 0.0)
                return share * np.linalg.norm(x - middle, axis=1)
            case _:
                raise ValueError(f"no containment for {self.kind}")

    def nearest(self, x: Array) -> Array | None:
        """The point of the shape nearest to a point; `None` for meshes."""
        match self.kind:
            case "sphere" | "capsule":
                core = np.array([0.0, 0.0, np.clip(x[2], -self.half_m[0], self.half_m[0])])
                if self.kind == "sphere":
                    core = np.zeros(3)
                length = np.linalg.norm(x - core)
                return x if length <= self.radius_m else core + (x - core) * (self.radius_m / length)
            case "cylinder":
                share = min(1.0, self.radius_m / max(np.hypot(x[0], x[1]), 1e-300))
                z = np.clip(x[2], -self.half_m[0], self.half_m[0])
                return np.array([share * x[0], share * x[1], z])
            case "cuboid":
                return np.clip(x, -self.half_m, self.half_m)
            case _:
                return None


@dataclass(frozen=True)
class Solid:
    """A shape on a link (1 to 6) or in the world (0)."""

    name: str
    body: int
    link: int
    shape: Shape
    rotation: Array  # of the shape in its link
    position: Array


@dataclass(frozen=True)
class Cell:
    """A scenario's cell."""

    header: dict
    model: pin.Model
    geometry: pin.GeometryModel
    solids: list[Solid]
    first_solid: list[int]  # of every body
    pair_of: Array  # body pair of every pair of solids, ascending
    # What Pinocchio read from the URDFs against what needlebench did.
    placement_difference_m: float

    def body_names(self, pair: int) -> tuple[str, str]:
        """Names of a pair's bodies."""
        entry = self.header["pairs"][pair]
        return tuple(self.header["bodies"][entry[side]]["name"] for side in "ab")


def pose(value: dict) -> pin.SE3:
    """A pose as the export writes it."""
    quaternion = pin.Quaternion(*(value["quat_xyzw"][i] for i in (3, 0, 1, 2)))
    return pin.SE3(quaternion.toRotationMatrix(), np.array(value["position_m"]))


def planes_of(vertices: Array, triangles: Array) -> Array:
    """Planes of a convex mesh's triangles, moved out to hold every vertex."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal = normal[length > 0.0] / length[length > 0.0, None]
    return np.column_stack([normal, (normal @ vertices.T).max(axis=1)])


def numpy_shape(value: dict) -> Shape:
    """A shape of the export."""
    none = np.zeros((0, 3))
    vertices, planes = none, np.zeros((0, 4))
    if value["kind"] in ("convex", "mesh"):
        vertices = np.array(value["vertices_m"])
        if value["kind"] == "convex":
            planes = planes_of(vertices, np.array(value["triangles"]))
    half = value.get("half_extents_m", [value.get("half_length_m", 0.0)])
    return Shape(value["kind"], value.get("radius_m", 0.0), np.array(half), vertices, planes)


def coal_mesh(*, vertices: Array, triangles: Array) -> coal.BVHModelOBBRSS:
    """A surface as Coal's tree of bounding volumes."""
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(vertices))
    mesh.addVertices(np.ascontiguousarray(vertices))
    mesh.addTriangles(np.ascontiguousarray(triangles))
    mesh.endModel()
    return mesh


def coal_shape(value: dict) -> coal.CollisionGeometry:
    """A shape of the export."""
    match value["kind"]:
        case "sphere":
            return coal.Sphere(value["radius_m"])
        case "cylinder":
            return coal.Cylinder(value["radius_m"], 2.0 * value["half_length_m"])
        case "capsule":
            return coal.Capsule(value["radius_m"], 2.0 * value["half_length_m"])
        case "cuboid":
            return coal.Box(*(2.0 * half for half in value["half_extents_m"]))
        case "convex":
            vertices = coal.StdVec_Vec3s()
            vertices.extend([np.array(vertex) for vertex in value["vertices_m"]])
            return coal.Convex.convexHull(vertices, True, "Qt")
        case _:
            return coal_mesh(
                vertices=np.array(value["vertices_m"]), triangles=np.array(value["triangles"])
            )


def shape_difference_m(theirs: coal.CollisionGeometry, ours: dict) -> float:
    """Largest difference of two shapes' dimensions; infinite if they are not of one kind."""
    match ours["kind"]:
        case "sphere" if isinstance(theirs, coal.Sphere):
            return abs(theirs.radius - ours["radius_m"])
        case "cylinder" if isinstance(theirs, coal.Cylinder):
            half = abs(theirs.halfLength - ours["half_length_m"])
            return max(abs(theirs.radius - ours["radius_m"]), half)
        case "capsule" if isinstance(theirs, coal.Capsule):
            half = abs(theirs.halfLength - ours["half_length_m"])
            return max(abs(theirs.radius - ours["radius_m"]), half)
        case "cuboid" if isinstance(theirs, coal.Box):
            return float(np.abs(theirs.halfSide - np.array(ours["half_extents_m"])).max())
        case _:
            return math.inf


def points_difference_m(corners: Array, ours: dict) -> float:
    """How far points from a file are from the vertices of a shape that is made of them: of a mesh
    every one is a vertex, of a hull the outermost in every direction."""
    vertices = np.array(ours["vertices_m"])
    if ours["kind"] == "mesh":
        theirs = np.unique(corners, axis=0)
        if len(theirs) != len(vertices) or len(corners) != 3 * len(ours["triangles"]):
            return math.inf
        order = [np.lexsort(np.round(each, 9).T) for each in (theirs, vertices)]
        return float(np.abs(theirs[order[0]] - vertices[order[1]]).max())
    directions = np.random.default_rng(1).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reach = [(directions @ each.T).max(axis=1) for each in (corners, vertices)]
    return float(np.abs(reach[0] - reach[1]).max())


def numbers(values: list[float]) -> str:
    """Numbers of a URDF attribute."""
    return " ".join(repr(float(value)) for value in values)


def fixed_joint(*, parent: str, child: str, xyz: list[float], rpy: list[float]) -> str:
    """A fixed joint; lengths in m, angles in rad."""
    return (
        f'<joint name="{parent}_to_{child}" type="fixed">'
        f'<parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{numbers(xyz)}" rpy="{numbers(rpy)}"/></joint>'
    )


def inside_of(text: str) -> str:
    """What stands inside <robot>, without needlebench's own element."""
    inside = re.sub(r".*?<robot\b[^>]*>(.*)</robot>.*", r"\1", text, flags=re.DOTALL)
    return re.sub(r"<needle_guide\b[^>]*/>", "", inside)


def assembled_urdf(scenario: Path) -> tuple[str, set[str]]:
    """Robot and tool of a scenario at their place, and the names of the tool's links."""
    settings = tomllib.loads(scenario.read_text())
    robot, tool = settings.get("robot", {}), settings.get("tool", {})

    def text(name: str, folder: str) -> str:
        shipped = ROOT / "models" / folder / f"{name}.urdf"
        return inside_of((shipped if shipped.exists() else scenario.parent / name).read_text())

    place = fixed_joint(
        parent="cell",
        child="base_link",
        xyz=[value * 1e-3 for value in robot.get("base_position_mm", [0.0, 0.0, 800.0])],
        rpy=[math.radians(value) for value in robot.get("base_rpy_deg", [0.0] * 3)],
    )
    bolted = fixed_joint(
        parent="tool0",
        child="tool_mount",
        xyz=[0.0] * 3,
        rpy=[0.0, 0.0, math.radians(tool.get("mount_rotation_deg", 0.0))],
    )
    name = robot.get("urdf", "ur3")
    arm = text(name, name)
    guide = text(tool.get("urdf", "offset"), "needle_guide")
    links = set(re.findall(r'<link\s+name="([^"]+)"', guide))
    return f'<robot name="cell"><link name="cell"/>{place}{arm}{bolted}{guide}</robot>', links


def build_cell(header_file: Path) -> Cell:
    """Build the cell whose export is given."""
    header = json.loads(header_file.read_text())
    scenario = ROOT / header["scenario"]
    settings = tomllib.loads(scenario.read_text())
    sections = {each["name"]: each for each in settings.get("obstacles", [])}
    xml, tool_links = assembled_urdf(scenario)
    model = pin.buildModelFromXML(xml)
    if list(model.names)[1:] != JOINTS or model.nq != len(JOINTS):
        raise ValueError(f"{header['name']}: joints {list(model.names)} with {model.nq} numbers")
    urdf = pin.buildGeomFromUrdfString(model, xml, pin.GeometryType.COLLISION)
    entry = model.frames[model.getFrameId("guide_entry")]
    # Collision elements by what they belong to, in the order of the files.
    read: dict[tuple[str, int], list[pin.GeometryObject]] = {}
    for item in urdf.geometryObjects:
        frame = model.frames[item.parentFrame].name
        if frame in tool_links:
            kind = "guide_tube" if frame == "guide_tube" else "tool"
        else:
            kind = "base" if item.parentJoint == 0 else "link"
        read.setdefault((kind, item.parentJoint), []).append(item)

    geometry = pin.GeometryModel()
    solids: list[Solid] = []
    first_solid: list[int] = []
    worst_m = 0.0
    for index, body in enumerate(header["bodies"]):
        link = 0 if body["link"] is None else body["link"] + 1
        first_solid.append(len(solids))
        section = sections.pop(body["name"], None) if link == 0 else None
        theirs = read.pop((body["kind"], link), None)
        if theirs is not None and len(theirs) != len(body["solids"]):
            raise ValueError(f"{body['name']}: {len(theirs)} solids in the URDF")
        for k, solid in enumerate(body["solids"]):
            ours = pose(solid["parent_from_shape"])
            if theirs is not None:
                placement, shape = theirs[k].placement, theirs[k].geometry
                worst_m = max(worst_m, shape_difference_m(shape, solid["shape"]))
            elif section is not None:
                placement, shape, corners = obstacle(section, settings, scenario.parent)
                worst_m = max(
                    worst_m,
                    shape_difference_m(shape, solid["shape"])
                    if corners is None
                    else points_difference_m(corners, solid["shape"]),
                )
            elif body["kind"] == "needle_corridor":
                shape = coal_shape(solid["shape"])
                # The cylinder of the corridor ends at the guide's entry, the hand cone's apex is there.
                back_m = solid["shape"].get("half_length_m", 0.0)
                placement = entry.placement * pin.SE3(np.eye(3), np.array([0.0, 0.0, -back_m]))
            else:
                placement, shape = ours, coal_shape(solid["shape"])
            off = ours.actInv(placement)
            # Not of a rotation about an axis of symmetry alone: it has to be the same pose.
            worst_m = max(worst_m, float(np.abs(off.homogeneous - np.eye(4)).max()))
            geometry.addGeometryObject(pin.GeometryObject(solid["name"], link, placement, shape))
            solids.append(
                Solid(
                    name=solid["name"],
                    body=index,
                    link=link,
                    shape=numpy_shape(solid["shape"]),
                    rotation=placement.rotation.copy(),
                    position=placement.translation.copy(),
                )
            )
    if missing := [name for name, each in sections.items() if each.get("present", True)]:
        raise ValueError(f"needlebench has no obstacles {missing}")
    if read:
        raise ValueError(f"needlebench has no geometry for {sorted(read)}")
    pair_of = []
    for number, pair in enumerate(header["pairs"]):
        of = {
            side: range(
                first_solid[pair[side]],
                first_solid[pair[side]] + len(header["bodies"][pair[side]]["solids"]),
            )
            for side in "ab"
        }
        for a in of["a"]:
            for b in of["b"]:
                geometry.addCollisionPair(pin.CollisionPair(a, b))
                pair_of.append(number)
    base = pose(header["world_from_base_link"])
    theirs = model.frames[model.getFrameId("base_link")].placement
    worst_m = max(worst_m, float(np.abs(base.actInv(theirs).homogeneous - np.eye(4)).max()))
    return Cell(header, model, geometry, solids, first_solid, np.array(pair_of), worst_m)
