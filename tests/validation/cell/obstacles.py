"""Obstacles of a scenario, from its TOML and the STL files that it names, by numpy alone.

Frames, rotations and units are written from the description of `[[obstacles]]` in the scenario's
schema: roll, pitch and yaw about fixed axes, millimetres, degrees.
"""

import math
import struct
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

Array = np.ndarray

METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}


def turn(axis: int, degrees: float) -> Array:
    """Rotation about a coordinate axis."""
    sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i], matrix[j, j], matrix[i, j], matrix[j, i] = cosine, cosine, -sine, sine
    return matrix


def placed(position_mm: list[float], rpy_deg: list[float]) -> pin.SE3:
    """A pose by position, roll, pitch and yaw."""
    roll, pitch, yaw = rpy_deg
    return pin.SE3(turn(2, yaw) @ turn(1, pitch) @ turn(0, roll), np.array(position_mm) * 1e-3)


def world_from_parent(settings: dict, attached_to: str) -> pin.SE3:
    """The frame of what an obstacle is attached to."""
    match attached_to:
        case "world":
            return pin.SE3.Identity()
        case "table":
            table = settings["table"]
            center = table.get("center_mm", [0.0, 0.0])
            height = table.get("top_height_mm", 800.0)
            return placed([*center, height], [0.0, 0.0, table.get("yaw_deg", 0.0)])
        case "gantry":
            gantry = settings["gantry"]
            turned = [0.0, gantry.get("tilt_deg", 0.0), gantry.get("axis_yaw_deg", 0.0)]
            return placed(gantry.get("isocentre_mm", [0.0, 0.0, 900.0]), turned)
        case "robot_base":
            robot = settings["robot"]
            return placed(robot["base_position_mm"], robot.get("base_rpy_deg", [0.0] * 3))
        case _:
            raise ValueError(f"attached to {attached_to}")


def stl_corners(path: Path, metres: float) -> Array:
    """Corners of the triangles of a binary STL file, in metres."""
    data = path.read_bytes()
    (count,) = struct.unpack_from("<I", data, 80)
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    triangles = np.frombuffer(data, record, count, 84)
    return triangles["corners"].reshape(-1, 3).astype(float) * metres


def tree_of(corners: Array) -> coal.BVHModelOBBRSS:
    """A surface as Coal's tree of bounding volumes, its triangles by their corners."""
    vertices, index = np.unique(corners, axis=0, return_inverse=True)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(corners) // 3, len(vertices))
    mesh.addVertices(np.ascontiguousarray(vertices))
    mesh.addTriangles(np.ascontiguousarray(index.reshape(-1, 3)))
    mesh.endModel()
    return mesh


def hull_of(corners: Array) -> coal.ConvexBase:
    """The convex hull of points."""
    points = coal.StdVec_Vec3s()
    points.extend(list(np.unique(corners, axis=0)))
    return coal.Convex.convexHull(points, True, "Qt")


def obstacle(section: dict, settings: dict, folder: Path) -> tuple[pin.SE3, object, Array | None]:
    """Place in the world, Coal's shape, and the corners of a shape from a file.

    What is from a file is about the middle of the box around it.
    """
    place = world_from_parent(settings, section.get("attached_to", "world"))
    place = place * placed(section["position_mm"], section.get("rpy_deg", [0.0] * 3))
    ((kind, value),) = section["shape"].items()
    match kind:
        case "box":
            return place, coal.Box(*(edge * 1e-3 for edge in value["size_mm"])), None
        case "cylinder":
            return place, coal.Cylinder(value["radius_mm"] * 1e-3, value["length_mm"] * 1e-3), None
        case "capsule":
            return place, coal.Capsule(value["radius_mm"] * 1e-3, value["length_mm"] * 1e-3), None
        case "sphere":
            return place, coal.Sphere(value["radius_mm"] * 1e-3), None
        case "convex" | "mesh":
            corners = stl_corners(folder / value["file"], METRES[value.get("unit", "mm")])
            middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
            corners = corners - middle
            shape = hull_of(corners) if kind == "convex" else tree_of(corners)
            return place * pin.SE3(np.eye(3), middle), shape, corners
        case _:
            raise ValueError(f"{section['name']} is a {kind}")
