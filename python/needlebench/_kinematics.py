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

    Shapes are for one pose, with ``(n, ...)`` in front for n postures.
    """

    __slots__ = ("matrix", "position_m", "quat_wxyz", "rotvec_rad")

    position_m: Floats
    """Position, m: (3,)."""
    quat_wxyz: Floats
    """Unit quaternion, w first: (4,)."""
    rotvec_rad: Floats
    """Rotation vector as shown by UR controllers, rad: (3,)."""
    matrix: Floats
    """Homogeneous matrix: (4, 4)."""

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.position_m = arrays["position_m"]
        self.quat_wxyz = arrays["quat_wxyz"]
        self.rotvec_rad = arrays["rotvec_rad"]
        self.matrix = arrays["matrix"]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Floats:
        """Position and quaternion, (7,): input of `ik`."""
        import numpy as np

        joined = np.concatenate([self.position_m, self.quat_wxyz], axis=-1)
        return joined if dtype is None else joined.astype(dtype, copy=bool(copy))

    def __repr__(self) -> str:
        shape = self.position_m.shape[:-1]
        return f"Poses{shape}"


class ForwardKinematics:
    """Poses of flange and links."""

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
    """Computes the poses of flange and links for joint positions.

    Bit-identical to ``needlebench fk``.

    Args:
        joints: joint positions, shoulder pan to wrist 3, rad: (6,) or (n, 6).
        arm: name of a UR arm (`ARMS`), or an `Arm`.

    Raises:
        InputError: wrong shape, or numbers that are not finite.
    """
    if isinstance(arm, Arm):
        return arm.fk(joints)
    return ForwardKinematics(_native.fk(joints, arm))


class Arm:
    """An arm: a UR model by its name, or a URDF, with or without a calibration.

    ``Arm()`` is the UR3, the default of scenarios.
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
        """The manufacturer's name if it is a known arm."""
        return self._native.name

    @property
    def limits_rad(self) -> tuple[Floats, Floats]:
        """Lower and upper joint limits, rad: (6,) each; infinite for joints without limits."""
        return self._native.limits_rad

    def fk(self, joints: npt.ArrayLike) -> ForwardKinematics:
        """Poses of flange and links: see `needlebench.fk`."""
        return ForwardKinematics(self._native.fk(joints))

    def __repr__(self) -> str:
        return f"Arm({self.name})"


class Solution(NamedTuple):
    """One solution of the inverse kinematics."""

    label: str
    """Its configuration, one of `CONFIGURATIONS`."""
    joints_rad: Floats
    """Joint positions, rad: (6,)."""
    residual_m: float
    """Distance of the flange from the target position, m."""
    residual_rad: float
    """Angle of the flange from the target orientation, rad."""
    within_limits: bool
    """Within the joint limits."""
    free_joint: str | None
    """``wrist_3`` if it may take any value, else ``None``."""
    kind: str
    """``exact``, ``touching`` or ``nearest``."""


class Solutions(NamedTuple):
    """All solutions for a pose, as in ``needlebench ik --json``."""

    solutions: list[Solution]
    """The solutions."""
    nearest: list[Solution]
    """Least-squares postures for an unreachable pose; never solutions."""
    certificate: str
    """Certificate of completeness: one of `CERTIFICATES`, or that of a numerical method."""
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
    """Solves one pose, verified by forward kinematics; for calibrated arms, scenario goals and numerical methods.

    For many poses of a nominal arm `ik` is a thousand times faster.

    Args:
        pose: flange in the controller's base frame, x, y, z (m) and rotation vector (rad); omit it with ``scenario``
            and ``goal``.
        scenario: scenario file.
        goal: one of its goals.
        arm: name of a UR arm [default: UR3].
        robot: URDF of another arm.
        calibration: factory calibration of the arm (YAML).
        seed: reference or initial joint positions, rad: (6,).
        tolerance: pose tolerance for boundary solutions, m and rad.
        options: further options of ``needlebench ik``.

    Raises:
        InputError: input that ``needlebench ik`` rejects.
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
