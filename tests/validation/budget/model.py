"""Arm, tool, scenario and real arms as files have them, read and moved by NumPy alone.

Shares no code with needlebench: URDF, arm data, calibrations, tool and scenario are read here, chains and
gravity are computed from them. Rows of arrays are draws. Lengths in m, angles in rad, masses in kg.
"""

import json
import math
import re
import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
MODELS = ROOT / "models"
GRAVITY_M_S2 = 9.80665
# Joints of a UR arm in ROS's names, with the entry of a calibration file that is the joint's origin.
JOINTS = {
    "shoulder_pan_joint": "shoulder",
    "shoulder_lift_joint": "upper_arm",
    "elbow_joint": "forearm",
    "wrist_1_joint": "wrist_1",
    "wrist_2_joint": "wrist_2",
    "wrist_3_joint": "wrist_3",
}
# Outer diameters of needles by gauge, from a chart of the Birmingham gauge.
OUTER_M = {16: 1.651e-3, 17: 1.473e-3, 18: 1.270e-3, 19: 1.067e-3, 20: 0.908e-3, 21: 0.819e-3, 22: 0.718e-3}
Array = np.ndarray


def turn_about(axis: int, angle: float) -> Array:
    """Rotation about a coordinate axis."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
    return turn


def from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """URDF's roll, pitch, yaw."""
    return turn_about(2, yaw) @ turn_about(1, pitch) @ turn_about(0, roll)


def from_vector(vector: Array) -> Array:
    """Rotation matrices of rotation vectors (Rodrigues)."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(
        *x.shape, 3, 3
    )
    safe = np.maximum(angle, 1e-150)
    return (
        np.eye(3)
        + np.sinc(angle / np.pi) * cross
        + (1.0 - np.cos(angle)) / safe**2 * (cross @ cross)
    )


def to_vector(turn: Array) -> Array:
    """Rotation vector of a small rotation."""
    axis = 0.5 * np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    sine = np.linalg.norm(axis)
    return axis if sine == 0.0 else axis * (math.asin(sine) / sine)


def numbers(text: str | None) -> Array:
    """Numbers of an attribute; zeros where there is none."""
    return np.array([float(word) for word in (text or "0 0 0").split()])


def origin_of(element: ElementTree.Element | None) -> tuple[Array, Array]:
    """Rotation and translation of a URDF origin."""
    origin = None if element is None else element.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    return from_rpy(*numbers(origin.get("rpy"))), numbers(origin.get("xyz"))


@dataclass(frozen=True)
class Body:
    """Mass, centre of mass and inertia about it, in the frame of its link."""

    mass: float
    com: Array
    inertia: Array


def body_of(link: ElementTree.Element) -> Body:
    """The inertia of a URDF link."""
    inertial = link.find("inertial")
    if inertial is None:
        return Body(0.0, np.zeros(3), np.zeros((3, 3)))
    turn, com = origin_of(inertial)
    entry = inertial.find("inertia").attrib
    xx, xy, xz, yy, yz, zz = (
        float(entry["i" + key]) for key in ("xx", "xy", "xz", "yy", "yz", "zz")
    )
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Body(float(inertial.find("mass").get("value")), com, turn @ tensor @ turn.T)


def joined(bodies: list[tuple[Array, Array, Body]]) -> Body:
    """Several bodies as one: their frames in the common one, and they."""
    mass = sum(body.mass for _, _, body in bodies)
    places = [turn @ body.com + at for turn, at, body in bodies]
    com = (
        sum(
            body.mass * place
            for place, (_, _, body) in zip(places, bodies, strict=True)
        )
        / mass
    )
    inertia = np.zeros((3, 3))
    for place, (turn, _, body) in zip(places, bodies, strict=True):
        off = place - com
        inertia += turn @ body.inertia @ turn.T
        inertia += body.mass * (off @ off * np.eye(3) - np.outer(off, off))
    return Body(mass, com, inertia)


@dataclass(frozen=True)
class Chain:
    """Six joints about their own z: origins in the link before them, and the flange in the last link."""

    turns: Array  # draws, 6, 3, 3
    places: Array  # draws, 6, 3
    flange_turn: Array
    flange_place: Array


@dataclass(frozen=True)
class Tool:
    """What is bolted to the flange, in its frame."""

    body: Body
    exit_turn: Array
    exit_place: Array
    guide_length: float
    bore: float
    needle: float


@dataclass(frozen=True)
class Arm:
    """The nominal arm where it stands, with its tool, and what its data say of the drives."""

    chain: Chain
    bodies: list[Body]
    base_turn: Array
    base_place: Array
    tool: Tool
    data: dict


def read_chain(name: str) -> tuple[Chain, list[Body]]:
    """Joints and links of a shipped arm."""
    root = ElementTree.parse(MODELS / name / f"{name}.urdf").getroot()
    joints = {joint.get("name"): joint for joint in root.iter("joint")}
    links = {link.get("name"): link for link in root.iter("link")}
    turns, places, bodies = [], [], []
    for joint in JOINTS:
        turn, place = origin_of(joints[joint])
        assert list(numbers(joints[joint].find("axis").get("xyz"))) == [0.0, 0.0, 1.0]
        turns.append(turn)
        places.append(place)
        bodies.append(body_of(links[joints[joint].find("child").get("link")]))
    # What is fixed before the first joint and behind the last one.
    base_turn, base_place = origin_of(joints["base_link-base_link_inertia"])
    turns[0], places[0] = base_turn @ turns[0], base_turn @ places[0] + base_place
    flange_turn, flange_place = np.eye(3), np.zeros(3)
    for joint in ("wrist_3-flange", "flange-tool0"):
        turn, place = origin_of(joints[joint])
        flange_place = flange_turn @ place + flange_place
        flange_turn = flange_turn @ turn
    chain = Chain(
        np.array(turns)[None], np.array(places)[None], flange_turn, flange_place
    )
    return chain, bodies


def read_tool(name: str) -> Tool:
    """A shipped tool: every link hangs on `tool_mount` by fixed joints."""
    root = ElementTree.parse(MODELS / "needle_guide" / f"{name}.urdf").getroot()
    frames = {"tool_mount": (np.eye(3), np.zeros(3))}
    for joint in root.iter("joint"):
        turn, at = frames[joint.find("parent").get("link")]
        own_turn, own_at = origin_of(joint)
        frames[joint.find("child").get("link")] = (turn @ own_turn, turn @ own_at + at)
    bodies = [(*frames[link.get("name")], body_of(link)) for link in root.iter("link")]
    guide = root.find("needle_guide").attrib
    turn, at = frames["guide_exit"]
    length = np.linalg.norm(at - frames["guide_entry"][1])
    bore, needle = (float(guide[key]) * 1e-3 for key in ("bore_mm", "needle_od_mm"))
    return Tool(joined(bodies), turn, at, float(length), bore, needle)


def read_deviations(population: list[dict], folder: Path, own: str) -> Array:
    """Real arms: translation and rotation vector of each joint's origin in the nominal one."""
    arms = []
    for entry in population:
        text = (folder / entry["file"]).read_text()
        nominal, _ = read_chain(entry.get("of", own).lower())
        # The nominal chain as in `base_link`, calibrations as in `base_link_inertia` behind it.
        half_turn = from_rpy(0.0, 0.0, math.pi)
        arm = []
        for i, joint in enumerate(JOINTS.values()):
            values = re.search(rf"\b{joint}: \{{(.*?)\}}", text).group(1)
            value = {k: float(v) for k, v in re.findall(r"(\w+): ([-+.\deE]+)", values)}
            turn = from_rpy(value["roll"], value["pitch"], value["yaw"])
            place = np.array([value["x"], value["y"], value["z"]])
            if i == 0:
                turn, place = half_turn @ turn, half_turn @ place
            back = nominal.turns[0, i].T
            moved = back @ (place - nominal.places[0, i])
            arm.append(np.concatenate([moved, to_vector(back @ turn)]))
        arms.append(arm)
    return np.array(arms)


def moved(chain: Chain, deviations: Array) -> Chain:
    """Chains whose origins are off by deviations (draws, 6, 6)."""
    places = chain.places + np.einsum("nijk,nik->nij", chain.turns, deviations[..., :3])
    return Chain(
        chain.turns @ from_vector(deviations[..., 3:]),
        places,
        chain.flange_turn,
        chain.flange_place,
    )


@dataclass(frozen=True)
class Posture:
    """Links of arms in the world: rotations and origins; a joint's axis is the z of its link."""

    turns: list[Array]
    places: list[Array]


def posture(arm: Arm, chain: Chain, q: Array) -> Posture:
    """Forward kinematics of rows of chains and joint positions."""
    turn, place = arm.base_turn[None], arm.base_place[None]
    turns, places = [], []
    for i in range(6):
        place = place + (turn @ chain.places[:, i, :, None])[..., 0]
        before = turn @ chain.turns[:, i]
        c, s = np.cos(q[:, i, None]), np.sin(q[:, i, None])
        x, y, z = (before[..., k] for k in range(3))
        x, y, z = np.broadcast_arrays(c * x + s * y, c * y - s * x, z)
        turn = np.stack([x, y, z], axis=-1)
        turns.append(turn)
        places.append(place)
    return Posture(turns, places)


def flange(chain: Chain, at: Posture) -> tuple[Array, Array]:
    """Rotation and origin of the flange."""
    place = at.places[-1] + at.turns[-1] @ chain.flange_place
    return at.turns[-1] @ chain.flange_turn, place


def centres(arm: Arm, chain: Chain, at: Posture, tool_com: Array) -> list[Array]:
    """Centres of mass of the six links and of the tool."""
    links = [
        p + t @ body.com
        for t, p, body in zip(at.turns, at.places, arm.bodies, strict=True)
    ]
    turn, place = flange(chain, at)
    return [*links, place + (turn @ tool_com[..., None])[..., 0]]


def gravity_torque(
    arm: Arm, chain: Chain, q: Array, tool_mass: Array, tool_com: Array
) -> Array:
    """Torque of each joint that holds the arm: the moment about its axis of all that it carries."""
    at = posture(arm, chain, q)
    points = centres(arm, chain, at, tool_com)
    mass = tool_mass[:, None]
    # Mass times place, summed from the tool inwards.
    first_moment = mass * points[6]
    torques = []
    for i in reversed(range(6)):
        mass = mass + arm.bodies[i].mass
        first_moment = first_moment + arm.bodies[i].mass * points[i]
        lever = first_moment - mass * at.places[i]
        axis = at.turns[i][..., 2]
        # Minus axis . (lever x gravity), with gravity along -z.
        torques.append(
            GRAVITY_M_S2 * (axis[..., 0] * lever[..., 1] - axis[..., 1] * lever[..., 0])
        )
    return np.stack(torques[::-1], axis=-1)


def mass_matrix(arm: Arm, q: Array) -> Array:
    """Joint-space mass matrix of the nominal arm with its tool and rotors."""
    at = posture(arm, arm.chain, q[None])
    points = centres(arm, arm.chain, at, arm.tool.body.com[None])
    turns = [*(turn[0] for turn in at.turns), flange(arm.chain, at)[0][0]]
    matrix = np.diag(np.array(arm.data["rotors"]["inertia_kgm2"]))
    for k, body in enumerate([*arm.bodies, arm.tool.body]):
        linear, angular = np.zeros((3, 6)), np.zeros((3, 6))
        for i in range(min(k, 5) + 1):
            axis = at.turns[i][0, :, 2]
            linear[:, i] = np.cross(axis, points[k][0] - at.places[i][0])
            angular[:, i] = axis
        inertia = turns[k] @ body.inertia @ turns[k].T
        matrix += body.mass * linear.T @ linear + angular.T @ inertia @ angular
    return matrix


def defaults(section: str, given: dict) -> dict:
    """A block of the scenario with what it leaves out as the schema describes it."""
    schema = json.loads((ROOT / "scenarios" / "scenario.schema.json").read_text())
    properties = schema["definitions"][section]["properties"]
    usual = {key: value["default"] for key, value in properties.items() if "default" in value}
    if section == "NeedleBlock":
        # What the schema says in words: in tissue, unless it has a key of a needle in air.
        usual["model"] = "cantilever" if "side_force_n" in given else "tissue"
        usual["side_force_n"] = 0.1
    return usual | given


def read_toml(path: Path) -> dict:
    """A TOML file."""
    return tomllib.loads(path.read_text())
