"""The glTF files by Khronos's validator, and their nodes against the URDF and `fk`."""

import json
import struct
import subprocess
from pathlib import Path

import numpy as np
from common import JOINTS, LINKS, Array, Cell, Failed, Tally, homogeneous, rotation

FRAME_M = 1e-6
HERE = Path(__file__).resolve().parent


def validate(files: list[Path]) -> str:
    """No errors and no warnings."""
    if not (HERE / "node_modules").is_dir():
        subprocess.run(["npm", "ci", "--silent", "--no-audit"], cwd=HERE, check=True)
    words = ["node", "validate_gltf.mjs", *[str(file) for file in files]]
    done = subprocess.run(words, cwd=HERE, check=True, capture_output=True, text=True)
    answers = json.loads(done.stdout)
    hints = 0
    for file, issues in answers.items():
        if issues["numErrors"] or issues["numWarnings"]:
            raise Failed(f"{file}: {json.dumps(issues['messages'][:5], indent=1)}")
        hints += issues["numInfos"] + issues["numHints"]
    return f"  glTF validator: {len(answers)} files, 0 errors, 0 warnings, {hints} remarks"


def read(path: Path) -> tuple[dict, bytes]:
    """Scene and numbers of a binary file."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    if (magic, version, length) != (b"glTF", 2, len(data)):
        raise Failed(f"{path}: head {magic}, {version}, {length}")
    size, _ = struct.unpack_from("<I4s", data, 12)
    return json.loads(data[20 : 20 + size]), data[20 + size + 8 :]


def local(node: dict) -> Array:
    """Pose of a node in its parent, in the precision in which viewers have it."""
    x, y, z, w = np.float32(node.get("rotation", [0, 0, 0, 1])).astype(float)
    at = np.float32(node.get("translation", [0, 0, 0])).astype(float)
    return homogeneous(list(at), [w, x, y, z])


def placed(scene: dict, turned: dict[int, list[float]] | None = None) -> dict[str, Array]:
    """Pose of each node in the scene's coordinates, y up, by its name."""
    poses: dict[str, Array] = {}

    def visit(index: int, parent: Array) -> None:
        node = scene["nodes"][index]
        if turned and index in turned:
            node = node | {"rotation": turned[index]}
        pose = parent @ local(node)
        poses.setdefault(node["name"], pose)
        for child in node.get("children", []):
            visit(child, pose)

    for root in scene["scenes"][scene["scene"]]["nodes"]:
        visit(root, np.eye(4))
    return poses


def check_frames(cell: Cell, path: Path, q: Array, tally: Tally) -> None:
    """Places of nodes in a posture; the links are one below the other, as the joints are."""
    scene, _ = read(path)
    asset = scene["asset"]["extras"]
    if asset["joint_names"] != JOINTS or asset["scenario"] != cell.name:
        raise Failed(f"{path}: {asset}")
    nodes = {node["name"]: node for node in scene["nodes"]}
    parent = "base_link"
    for link, joint, position in zip(LINKS, JOINTS, q, strict=True):
        children = [scene["nodes"][child]["name"] for child in nodes[parent]["children"]]
        extras = nodes[link]["extras"]
        if link not in children or extras["joint"] != joint:
            raise Failed(f"{path}: {link} is not on {parent}, or not of {joint}")
        tally.add(extras["position_rad"] - position, f"{cell.name}: {joint}")
        parent = link
    # y up: z of the scenario is y, and y is minus z.
    up = np.eye(4)
    up[:3, :3] = rotation("x", -np.pi / 2.0)
    wanted = up @ cell.world_from_base_link() @ cell.base_link_from_flange(q)
    tally.add(np.abs(placed(scene)["tool0"] - wanted).max(), f"{cell.name}: tool0")


def check_animation(cell: Cell, path: Path, tally: Tally) -> Array:
    """The motion begins at the start posture and ends where the nodes are; gives the final posture."""
    scene, numbers = read(path)
    q = np.array(scene["asset"]["extras"]["joint_positions_rad"])
    (animation,) = scene["animations"]

    def column(accessor: int) -> Array:
        entry = scene["accessors"][accessor]
        view = scene["bufferViews"][entry["bufferView"]]
        width = {"SCALAR": 1, "VEC4": 4}[entry["type"]]
        values = np.frombuffer(numbers, "<f4", entry["count"] * width, view["byteOffset"])
        return values.reshape(-1, width).astype(float)

    first, last = {}, {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        keys = column(sampler["output"])
        node = channel["target"]["node"]
        first[node], last[node] = list(keys[0]), list(keys[-1])
    up = np.eye(4)
    up[:3, :3] = rotation("x", -np.pi / 2.0)
    place = up @ cell.world_from_base_link()
    for turned, posture in ((first, cell.start), (last, q)):
        wanted = place @ cell.base_link_from_flange(posture)
        tally.add(np.abs(placed(scene, turned)["tool0"] - wanted).max(), f"{cell.name}: animation")
    return q
