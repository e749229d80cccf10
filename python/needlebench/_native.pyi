"""Private: arrays, and functions of the compiled module."""

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
    "judge",
    "judge_answers",
    "judge_free",
    "main",
]

VERSION: Final[str]
CONFIGURATIONS: Final[tuple[str, ...]]
"""Labels of the eight configurations, in the order of arrays."""
CERTIFICATES: Final[tuple[str, ...]]
"""Certificates of inverse-kinematics answers, by number."""
JOINT_NAMES: Final[tuple[str, ...]]
"""ROS names of the joints, in the order of joint vectors."""
ARMS: Final[tuple[str, ...]]
"""Names of the UR arms."""
CLEARANCE_CLASSES: Final[tuple[str, ...]]
"""Clearance classes of collision pairs."""

_Progress = Callable[[str, int, int], object]
_Path = str | os.PathLike[str]

@final
class IkAnswers:
    """The solutions of poses in all eight configurations, without copies.

    Shapes are for one pose, with ``(n, ...)`` in front for an array of poses.
    """

    @property
    def joints(self) -> npt.NDArray[np.float64]:
        """Joint positions, rad: (8, 6), by configuration; NaN without a solution. A view; strides 8, 64."""
    @property
    def exists(self) -> npt.NDArray[np.bool_]:
        """Which configurations have a solution: (8,)."""
    @property
    def merged(self) -> npt.NDArray[np.bool_]:
        """Which are coincident solutions, i.e. stand for another configuration too: (8,)."""
    @property
    def wrist_3_is_free(self) -> npt.NDArray[np.bool_]:
        """Which stand for a family of solutions with free wrist 3: (8,)."""
    @property
    def touching(self) -> npt.NDArray[np.bool_]:
        """Which are boundary solutions, off the pose by no more than the tolerance: (8,)."""
    @property
    def certificate(self) -> Any:
        """Certificate of completeness, as an index into `CERTIFICATES`. A view for n poses."""
    def __len__(self) -> int: ...

def ik(
    poses: npt.ArrayLike,
    arm: str = "UR3",
    *,
    seed: npt.ArrayLike | None = None,
    tolerance: float = 1e-7,
    out: IkAnswers | None = None,
) -> IkAnswers:
    """Solves flange poses in the controller's base frame in all eight configurations, for a nominal UR arm.

    Bit-identical to ``needlebench ik --arm``; the global interpreter lock is released.

    Args:
        poses: position (m) and unit quaternion w, x, y, z: (7,) or (n, 7); position and rotation vector (rad): (6,) or
            (n, 6); homogeneous matrices: (4, 4) or (n, 4, 4); or `Poses`.
        arm: name of a UR arm (`ARMS`).
        seed: reference joint positions for a free wrist 3, rad: (6,).
        tolerance: pose tolerance for boundary solutions, m and rad.
        out: answers of an earlier call of the same shape, to be overwritten.

    Raises:
        InputError: wrong shape, invalid rotation, or a position beyond 10 m.
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
        reference: bool = False,
        out: _Path | None = None,
        pictures: bool = True,
        page: bool = True,
        record: str | None = None,
        progress: _Progress | None = None,
    ) -> tuple[Run, BaseException | None]: ...

def judge(
    scenario: Scenario,
    times_s: npt.ArrayLike,
    positions_rad: npt.ArrayLike,
    velocities_rad_s: npt.ArrayLike | None = None,
    accelerations_rad_s2: npt.ArrayLike | None = None,
    *,
    goal: str | None = None,
    between: str | None = None,
    any_start: bool = False,
    beside: bool = True,
    engines: list[str] | None = None,
    jobs: int | None = None,
    reference: bool = False,
    out: _Path | None = None,
    pictures: bool = True,
    page: bool = True,
    record: str | None = None,
    progress: _Progress | None = None,
) -> tuple[Run, BaseException | None]: ...
def judge_free(
    scenario: Scenario,
    times_s: npt.ArrayLike,
    positions_rad: npt.ArrayLike,
    velocities_rad_s: npt.ArrayLike | None = None,
    accelerations_rad_s2: npt.ArrayLike | None = None,
    *,
    between: str | None = None,
) -> str: ...
def judge_answers(
    scenario: Scenario,
    joints_rad: npt.ArrayLike,
    *,
    goal: str | None = None,
    tolerance: float | None = None,
    partial: bool = False,
    jobs: int | None = None,
    progress: _Progress | None = None,
) -> str: ...

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
