"""Private: arrays, and functions of the program itself."""

import os
from collections.abc import Callable
from typing import Any, Final, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "ARMS",
    "CERTIFICATES",
    "CLEARANCE_CLASSES",
    "CONFIGURATIONS",
    "JOINT_NAMES",
    "VERSION",
    "Arm",
    "IkAnswers",
    "Run",
    "Scenario",
    "fk",
    "ik",
    "invoke",
    "main",
]

VERSION: Final[str]
CONFIGURATIONS: Final[tuple[str, ...]]
"""Labels of the eight configurations, in the order of arrays."""
CERTIFICATES: Final[tuple[str, ...]]
"""What answers of inverse kinematics are worth, by number."""
JOINT_NAMES: Final[tuple[str, ...]]
"""ROS's names of the joints, in the order of joint vectors."""
ARMS: Final[tuple[str, ...]]
"""Names of the UR arms."""
CLEARANCE_CLASSES: Final[tuple[str, ...]]
"""Classes of pairs between which clearances are measured."""

_Progress = Callable[[str, int, int], object]
_Path = str | os.PathLike[str]

@final
class IkAnswers:
    """All eight configurations of poses, in the memory that they were computed in.

    Shapes are those of one pose, with ``(n, ...)`` before them where an array of poses was given.
    """

    @property
    def joints(self) -> npt.NDArray[np.float64]:
        """Joint positions, rad: (8, 6), by configuration; NaN where there is none. A view; strides 8, 64."""
    @property
    def exists(self) -> npt.NDArray[np.bool_]:
        """Which configurations there are: (8,)."""
    @property
    def merged(self) -> npt.NDArray[np.bool_]:
        """Which stand for another one too, that is the same posture: (8,)."""
    @property
    def wrist_3_is_free(self) -> npt.NDArray[np.bool_]:
        """Which stand for a family, in which wrist 3 may take other values: (8,)."""
    @property
    def touching(self) -> npt.NDArray[np.bool_]:
        """Which miss the pose by no more than the tolerance: (8,)."""
    @property
    def certificate(self) -> Any:
        """What the answer is worth, as a place in `CERTIFICATES`. A view where there are n poses."""
    def __len__(self) -> int: ...

def ik(
    poses: npt.ArrayLike,
    arm: str = "UR3",
    *,
    seed: npt.ArrayLike | None = None,
    tolerance: float = 1e-7,
    out: IkAnswers | None = None,
) -> IkAnswers:
    """All eight configurations of poses of the flange in the controller's base frame, for a nominal UR arm.

    The same postures, bit for bit, as ``needlebench ik --arm``; the interpreter's lock is not held meanwhile.

    Args:
        poses: position (m) and unit quaternion w, x, y, z: (7,) or (n, 7); position and rotation vector (rad): (6,) or
            (n, 6); homogeneous matrices: (4, 4) or (n, 4, 4); or `Poses`.
        arm: name of a UR arm (`ARMS`).
        seed: joint positions to be near to where wrist 3 is free, rad: (6,).
        tolerance: by how much a posture may miss the pose and still be one that touches, m and rad.
        out: answers of an earlier call of the same shape, whose memory is written over.

    Raises:
        InputError: another shape, no rotation, or a position beyond 10 m.
    """

def fk(joints: npt.ArrayLike, arm: str = "UR3") -> dict[str, Any]: ...
def main(arguments: list[str]) -> int: ...
def invoke(
    arguments: list[str], progress: _Progress | None = None
) -> tuple[int, str, str, list[dict[str, Any]], BaseException | None]: ...

@final
class Arm:
    def __new__(
        cls,
        arm: str | None = None,
        *,
        robot: _Path | None = None,
        prefix: str | None = None,
        calibration: _Path | None = None,
        packages: list[str] | None = None,
    ) -> Arm: ...
    @property
    def name(self) -> str: ...
    @property
    def limits_rad(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]: ...
    def fk(self, joints: npt.ArrayLike) -> dict[str, Any]: ...

@final
class Scenario:
    @staticmethod
    def load(
        path: _Path,
        *,
        robot: _Path | None = None,
        arm: str | None = None,
        prefix: str | None = None,
        calibration: _Path | None = None,
        packages: list[str] | None = None,
        missing_inertia: str | None = None,
    ) -> Scenario: ...
    @property
    def name(self) -> str: ...
    @property
    def description(self) -> str: ...
    @property
    def file(self) -> str: ...
    @property
    def sha256(self) -> str: ...
    @property
    def arm(self) -> str: ...
    @property
    def goals(self) -> list[str]: ...
    @property
    def notes(self) -> list[str]: ...
    @property
    def start_rad(self) -> npt.NDArray[np.float64]: ...
    def fk(self, joints: npt.ArrayLike) -> dict[str, Any]: ...
    def clearance(self, joints: npt.ArrayLike, *, pairs: bool = False) -> dict[str, Any]: ...
    def certify(self, joints: npt.ArrayLike, *, tolerance_m: float = 1e-4) -> dict[str, Any]: ...
    def run(
        self,
        *,
        engines: list[str] | None = None,
        jobs: int | None = None,
        referee: bool = False,
        out: _Path | None = None,
        pictures: bool = True,
        page: bool = True,
        record: str | None = None,
        progress: _Progress | None = None,
    ) -> tuple[Run, BaseException | None]: ...

@final
class Run:
    def report_json(self) -> str: ...
    @property
    def verdict(self) -> str: ...
    @property
    def interrupted(self) -> bool: ...
    @property
    def engine_failures(self) -> list[tuple[str, str]]: ...
    def engines(self, goal: str, configuration: str) -> list[str]: ...
    def recording(self, goal: str, configuration: str, engine: str) -> dict[str, Any]: ...
    def duration_s(self, goal: str, configuration: str, *, retreat: bool = False) -> float | None: ...
    def motion(
        self, goal: str, configuration: str, times_s: npt.ArrayLike, *, retreat: bool = False
    ) -> dict[str, Any]: ...
