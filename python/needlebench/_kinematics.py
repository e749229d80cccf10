"""Forward and inverse kinematics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from . import _native
from ._command import command

if TYPE_CHECKING:
    import os

    import numpy as np
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]


class Poses:
    """Poses of one frame in another, one or many.

    Shapes are those of one pose, with ``(n, ...)`` before them where there were n postures.
    """

    __slots__ = ("matrix", "position_m", "quat_wxyz", "rotvec_rad")

    position_m: Floats
    """Position, m: (3,)."""
    quat_wxyz: Floats
    """Unit quaternion, w first: (4,)."""
    rotvec_rad: Floats
    """Rotation vector as UR controllers write it, rad: (3,)."""
    matrix: Floats
    """Homogeneous matrix: (4, 4)."""

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.position_m = arrays["position_m"]
        self.quat_wxyz = arrays["quat_wxyz"]
        self.rotvec_rad = arrays["rotvec_rad"]
        self.matrix = arrays["matrix"]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Floats:
        """Position and quaternion, (7,): what `ik` takes."""
        import numpy as np

        joined = np.concatenate([self.position_m, self.quat_wxyz], axis=-1)
        return joined if dtype is None else joined.astype(dtype, copy=bool(copy))

    def __repr__(self) -> str:
        shape = self.position_m.shape[:-1]
        return f"Poses{shape}"


class ForwardKinematics:
    """Where flange and links are."""

    __slots__ = ("flange_in_base", "flange_in_base_link", "links")

    flange_in_base: Poses
    """Flange in the controller's base frame."""
    flange_in_base_link: Poses
    """Flange in ROS's ``base_link``."""
    links: dict[str, Poses]
    """Each moving link in ``base_link``, by its name."""

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.flange_in_base = Poses(arrays["flange_in_base"])
        self.flange_in_base_link = Poses(arrays["flange_in_base_link"])
        self.links = {name: Poses(poses) for name, poses in arrays["links"].items()}


def fk(joints: npt.ArrayLike, arm: str | Arm = "UR3") -> ForwardKinematics:
    """Poses of flange and links for joint positions.

    The same numbers, bit for bit, as ``needlebench fk``.

    Args:
        joints: joint positions, shoulder pan to wrist 3, rad: (6,) or (n, 6).
        arm: name of a UR arm (`ARMS`), or an `Arm`.

    Raises:
        InputError: another shape, or numbers that are not finite.
    """
    if isinstance(arm, Arm):
        return arm.fk(joints)
    return ForwardKinematics(_native.fk(joints, arm))


class Arm:
    """An arm by itself: a UR model by its name, or a URDF, with a calibration or without.

    ``Arm()`` is the UR3 that scenarios have by default.
    """

    def __init__(
        self,
        arm: str | None = None,
        *,
        robot: str | os.PathLike[str] | None = None,
        prefix: str | None = None,
        calibration: str | os.PathLike[str] | None = None,
        packages: list[str] | None = None,
    ) -> None:
        self._native = _native.Arm(arm, robot=robot, prefix=prefix, calibration=calibration, packages=packages)

    @property
    def name(self) -> str:
        """The maker's name where it is a known arm."""
        return self._native.name

    @property
    def limits_rad(self) -> tuple[Floats, Floats]:
        """Least and greatest joint positions, rad: (6,) each; infinite where a joint has no limit."""
        return self._native.limits_rad

    def fk(self, joints: npt.ArrayLike) -> ForwardKinematics:
        """Poses of flange and links: see `needlebench.fk`."""
        return ForwardKinematics(self._native.fk(joints))

    def __repr__(self) -> str:
        return f"Arm({self.name})"


class Solution(NamedTuple):
    """One posture for a pose."""

    label: str
    """Which of `CONFIGURATIONS` it is."""
    joints_rad: Floats
    """Joint positions, rad: (6,)."""
    residual_m: float
    """Distance of the flange from the wanted position, m."""
    residual_rad: float
    """Angle of the flange from the wanted orientation, rad."""
    within_limits: bool
    """Within the joint limits."""
    free_joint: str | None
    """``wrist_3`` where that may take other values."""
    kind: str
    """``exact``, ``touching`` or ``nearest``."""


class Solutions(NamedTuple):
    """All postures for a pose, as ``needlebench ik --json`` answers."""

    solutions: list[Solution]
    """Postures that reproduce the pose."""
    nearest: list[Solution]
    """Least-squares postures for a pose that none reaches; never solutions."""
    certificate: str
    """What the answer is worth: one of `CERTIFICATES`, or what a numerical method says."""
    data: dict[str, Any]
    """The whole answer."""


def solve(
    pose: npt.ArrayLike | None = None,
    *,
    scenario: str | os.PathLike[str] | None = None,
    goal: str | None = None,
    arm: str | None = None,
    robot: str | os.PathLike[str] | None = None,
    calibration: str | os.PathLike[str] | None = None,
    seed: npt.ArrayLike | None = None,
    tolerance: float | None = 1e-7,
    **options: Any,
) -> Solutions:
    """All postures of one pose, checked by forward kinematics: calibrated arms, goals of scenarios, numerical methods.

    For many poses of a nominal arm `ik` is a thousand times as fast.

    Args:
        pose: the flange in the controller's base frame, x, y, z (m) and rotation vector (rad); or leave it out and give
            ``scenario`` and ``goal``.
        scenario: file of a scenario.
        goal: one of its goals.
        arm: name of a UR arm; the UR3 of scenarios if left out.
        robot: URDF of another arm.
        calibration: the maker's calibration of an arm (YAML).
        seed: joint positions to be near to, rad: (6,).
        tolerance: by how much a posture may miss the pose and still be one that touches, m and rad.
        options: further options of ``needlebench ik``.

    Raises:
        InputError: what ``needlebench ik`` refuses.
    """
    import numpy as np

    def listed(values: npt.ArrayLike) -> str:
        return ",".join(repr(float(value)) for value in np.asarray(values, float).ravel())

    arguments = ["ik"] if scenario is None else ["ik", scenario]
    if options.get("method", "closed-form") != "closed-form":
        tolerance = None
    data = command(
        *arguments,
        pose=None if pose is None else listed(pose),
        goal=goal,
        arm=arm,
        robot=robot,
        calibration=calibration,
        seed=None if seed is None else listed(seed),
        tolerance=tolerance,
        **options,
    ).data

    def solution(row: dict[str, Any]) -> Solution:
        joints = np.array(row["joints_rad"])
        known = {name: row[name] for name in Solution._fields if name != "joints_rad"}
        return Solution(joints_rad=joints, **known)

    return Solutions(
        [solution(row) for row in data["solutions"]],
        [solution(row) for row in data["nearest"]],
        data["certificate"],
        data,
    )
