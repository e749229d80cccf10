"""The program, a scenario's cell as it sees it, and tallies of differences."""

import json
import re
import subprocess
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
Array = np.ndarray
JOINTS = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
]
LINKS = [
    "shoulder_link",
    "upper_arm_link",
    "forearm_link",
    "wrist_1_link",
    "wrist_2_link",
    "wrist_3_link",
]
# Bodies of needlebench whose links have ROS's names.
LINK_OF = {"base": "base_link"} | {name.removesuffix("_link"): name for name in LINKS}


class Failed(Exception):
    """Something is not as it should be."""


@dataclass
class Tally:
    """The greatest of differences that have to stay below a limit."""

    name: str
    limit: float
    unit: str
    greatest: float = 0.0
    count: int = 0
    where: str = ""

    def add(self, difference: float, where: str) -> None:
        """Count a difference; NaN is the greatest of all."""
        self.count += 1
        if not abs(difference) <= self.greatest:
            self.greatest, self.where = abs(difference), where

    def figure(self) -> str:
        """As the records of the checks have it."""
        name = re.sub(r"\W+", "_", f"{self.name} {self.unit}".lower()).strip("_")
        return f"figure {name} {self.greatest:.3e}"

    def line(self) -> str:
        """The tally for people; raises where there is nothing, or too much."""
        text = f"  {self.name}: {self.greatest:.2e} {self.unit} at most, of {self.count}"
        if self.count == 0:
            raise Failed(f"{self.name}: nothing was compared")
        if not self.greatest <= self.limit:
            raise Failed(f"{text.strip()}, limit {self.limit:.0e} {self.unit}: {self.where}")
        return text


@dataclass
class Cell:
    """A scenario, its exports, and what the program says of it."""

    program: Path
    scenario: Path
    folder: Path
    start: Array = field(default_factory=lambda: np.zeros(6))

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return tomllib.loads(self.scenario.read_text())["name"]

    def ask(self, *words: str) -> dict:
        """What the program prints as JSON."""
        done = subprocess.run(
            [self.program, *words, "--json"], capture_output=True, text=True, check=False
        )
        if done.returncode != 0:
            raise Failed(f"needlebench {' '.join(words)}: status {done.returncode}\n{done.stderr}")
        return json.loads(done.stdout)

    def export(self, form: str, file: str, *words: str) -> Path:
        """The file that people open. Exported twice: the bytes have to be the same."""
        path = self.folder / file
        words = ("export", str(self.scenario), "--as", form, "--out", str(path), *words)
        first, second = self.ask(*words), self.ask(*words)
        if first != second:
            raise Failed(f"{self.name} as {form}: two exports differ")
        return path

    def clearances(self, q: Array) -> dict[tuple[str, str], dict]:
        """Every pair's clearance at a posture."""
        joints = ",".join(repr(float(value)) for value in q)
        answer = self.ask("clearance", str(self.scenario), "--joints", joints)
        return {tuple(each["pair"]): each for each in answer["pairs"]}

    def arm(self) -> str:
        """The arm by the name that `fk` takes."""
        return tomllib.loads(self.scenario.read_text()).get("robot", {}).get("urdf", "ur3")

    def base_link_from_flange(self, q: Array) -> Array:
        """Pose of the flange as `fk` has it, 4 by 4."""
        joints = ",".join(repr(float(value)) for value in q)
        pose = self.ask("fk", "--robot", self.arm(), "--joints", joints)["flange_in_base_link"]
        return homogeneous(pose["position_m"], pose["quat_wxyz"])

    def world_from_base_link(self) -> Array:
        """Where the scenario's file places the robot."""
        robot = tomllib.loads(self.scenario.read_text()).get("robot", {})
        place = np.eye(4)
        roll, pitch, yaw = np.radians(robot.get("base_rpy_deg", [0.0, 0.0, 0.0]))
        turn = rotation("z", yaw) @ rotation("y", pitch) @ rotation("x", roll)
        place[:3, :3] = turn
        place[:3, 3] = np.array(robot.get("base_position_mm", [0.0, 0.0, 800.0])) * 1e-3
        return place


def rotation(axis: str, angle: float) -> Array:
    """A turn about an axis."""
    c, s = np.cos(angle), np.sin(angle)
    match axis:
        case "x":
            return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        case "y":
            return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        case _:
            return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def homogeneous(position: list[float], quat_wxyz: list[float]) -> Array:
    """A pose as a matrix."""
    w, x, y, z = np.array(quat_wxyz) / np.linalg.norm(quat_wxyz)
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = position
    return pose
