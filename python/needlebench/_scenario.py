"""Scenarios."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _native
from ._command import command, with_result
from ._errors import EnvironmentFailed
from ._kinematics import ForwardKinematics
from ._progress import Watching
from ._run import Plan, Run

if TYPE_CHECKING:
    import os

    import numpy as np
    import numpy.typing as npt

    from ._progress import Progress

    Floats = npt.NDArray[np.float64]


class ClassClearance(NamedTuple):
    """The minimum clearance of one class of pairs.

    Shapes are for one posture, with ``(n, ...)`` in front for n postures.
    """

    minimum_m: Any
    """Signed distance, m: positive for a gap, negative for a penetration."""
    pair: Any
    """Names of the two solids; a list of them for n postures."""
    witness_points_m: Floats
    """Witness points, one on each solid, in the world frame, m: (2, 3)."""


class PairClearances(NamedTuple):
    """Signed distances of all enabled pairs.

    Shapes are for one posture, with ``(n, ...)`` in front for n postures.
    """

    pair: list[tuple[str, str]]
    """Names of the two bodies of each pair."""
    classes: list[str]
    """Class of each pair."""
    distance_m: Floats
    """Signed distance of each pair, m: (p,)."""
    witness_points_m: Floats
    """Witness points, one on each body, in the world frame, m: (p, 2, 3)."""
    solids: Any
    """Names of the two closest solids; a list of such lists for n postures."""


class Clearance(NamedTuple):
    """Clearances of one posture or several."""

    classes: dict[str, ClassClearance]
    """By class; classes without pairs in the cell are absent."""
    pairs: PairClearances | None
    """All pairs, if requested."""


class ClassCertificate(NamedTuple):
    """Bounds of the minimum clearance of one class over a whole motion."""

    certified_lower_bound_m: float
    """Certified lower bound over the whole motion, m."""
    minimum_m: float
    """Attained minimum, m."""
    time_s: float
    """Time of the minimum, s."""
    joints_rad: Floats
    """Posture of the minimum, rad: (6,)."""
    pair: tuple[str, str]
    """Names of the two solids."""
    witness_points_m: Floats
    """Witness points, one on each solid, in the world frame, m: (2, 3)."""


class Certificate(NamedTuple):
    """Certified clearances of a motion."""

    classes: dict[str, ClassCertificate]
    """By class."""
    duration_s: float
    """Duration of the motion, s."""


class Scenario:
    """A validated scenario: robot, tool, patient, room, goals."""

    def __init__(self, native: _native.Scenario, options: dict[str, Any]) -> None:
        self._native = native
        self._options = options

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        robot: str | os.PathLike[str] | None = None,
        arm: str | None = None,
        prefix: str | None = None,
        calibration: str | os.PathLike[str] | None = None,
        packages: list[str] | None = None,
        missing_inertia: str | None = None,
    ) -> Scenario:
        """Reads a scenario file.

        Args:
            path: TOML file.
            robot: URDF instead of the scenario's robot.
            arm: arm data: a bundled arm (e.g. ``ur5e``) or the path of an arm.toml; also selects the robot without
                ``robot``.
            prefix: prefix of the arm's link and joint names, for a URDF with several arms.
            calibration: factory calibration of the arm (YAML).
            packages: ``NAME=DIR`` for ``package://NAME/`` in URDFs.
            missing_inertia: policy for links without inertia in the URDF.

        Raises:
            InputError: with all findings of ``needlebench check``, and for a start posture in collision.
        """
        native = _native.Scenario.load(
            path,
            robot=robot,
            arm=arm,
            prefix=prefix,
            calibration=calibration,
            packages=packages,
            missing_inertia=missing_inertia,
        )
        return cls(
            native,
            {
                "robot": robot,
                "arm": arm,
                "prefix": prefix,
                "calibration": calibration,
                "package_path": packages,
                "missing_inertia": missing_inertia,
            },
        )

    @property
    def name(self) -> str:
        """Its name."""
        return self._native.name

    @property
    def description(self) -> str:
        """Its description."""
        return self._native.description

    @property
    def file(self) -> str:
        """Its file."""
        return self._native.file

    @property
    def sha256(self) -> str:
        """SHA-256 of its text."""
        return self._native.sha256

    @property
    def arm(self) -> str:
        """The manufacturer's name of its arm."""
        return self._native.arm

    @property
    def goals(self) -> list[str]:
        """Names of its goals."""
        return self._native.goals

    @property
    def notes(self) -> list[str]:
        """Notes on assumed and adjusted values."""
        return self._native.notes

    @property
    def start_rad(self) -> Floats:
        """Start posture of all motions, rad: (6,)."""
        return self._native.start_rad

    def __repr__(self) -> str:
        return f"Scenario({self.name}: {', '.join(self.goals)})"

    def fk(self, joints: npt.ArrayLike) -> ForwardKinematics:
        """Poses of flange and links of its arm: see `needlebench.fk`."""
        return ForwardKinematics(self._native.fk(joints))

    def clearance(self, joints: npt.ArrayLike, *, pairs: bool = False) -> Clearance:
        """Computes the signed clearances of postures in its cell.

        Bit-identical to ``needlebench clearance``.

        Args:
            joints: joint positions, rad: (6,) or (n, 6).
            pairs: also return every enabled pair.

        Raises:
            InputError: wrong shape, or numbers that are not finite.
        """
        found = self._native.clearance(joints, pairs=pairs)
        classes = {name: ClassClearance(**each) for name, each in found["classes"].items()}
        all_pairs = found.get("pairs")
        if all_pairs is None:
            return Clearance(classes, None)
        all_pairs["classes"] = all_pairs.pop("class")
        return Clearance(classes, PairClearances(**all_pairs))

    def certify(self, joints: npt.ArrayLike, *, tolerance_m: float = 1e-4) -> Certificate:
        """Certifies the clearances of joint-space lines through postures.

        Speeds are those of the scenario; the bounds do not depend on them.

        Args:
            joints: postures, rad: (n, 6), n at least 2.
            tolerance_m: largest gap between certified bound and attained minimum, m.

        Raises:
            InputError: wrong shape, or numbers that are not finite.
        """
        found = self._native.certify(joints, tolerance_m=tolerance_m)
        classes = {name: ClassCertificate(**each) for name, each in found["classes"].items()}
        return Certificate(classes, found["duration_s"])

    def plan(self, *, jobs: int | None = None, progress: bool | Progress | None = None) -> Plan:
        """Plans every configuration of every goal without simulation: postures, rejections, motions, clearances.

        Args:
            jobs: number of threads [default: all cores]; does not affect results.
            progress: ``True`` shows a bar; a function is called with message, done and total.
        """
        with Watching(progress) as watch:
            native, interrupted = self._native.run(engines=[], jobs=jobs, progress=watch)
        plan = Plan(native)
        if interrupted is not None:
            raise with_result(interrupted, plan)
        return plan

    def run(
        self,
        engines: list[str] | None = None,
        *,
        jobs: int | None = None,
        reference: bool = False,
        referee: bool | None = None,
        out: str | os.PathLike[str] | None = None,
        pictures: bool = True,
        page: bool = True,
        record: str | None = None,
        progress: bool | Progress | None = None,
    ) -> Run:
        """Plans, simulates, measures and evaluates every configuration of every goal.

        The report is bit-identical to ``needlebench run --json``, except ``timings``.

        Args:
            engines: names of physics engines [default: those of the scenario].
            jobs: number of threads [default: all cores]; does not affect results.
            reference: verify every motion against the reference integrator.
            referee: the old name of ``reference``.
            out: folder; results are written to ``out/NAME``, as by ``needlebench run --out``.
            pictures: with images and charts.
            page: with the report page.
            record: ``"mcap"`` also writes each recording as MCAP with ROS 2 messages.
            progress: ``True`` shows a bar; a function is called with message, done and total.

        Raises:
            InputError: unknown engine, or unusable scan.
            EnvironmentFailed: an engine failed; the measurements of the others are in ``result``.
            Interrupted: completed results are in ``result``.
        """
        if referee is not None:
            warnings.warn("`referee` is now `reference`", DeprecationWarning, stacklevel=2)
            reference = reference or referee
        with Watching(progress) as watch:
            native, interrupted = self._native.run(
                engines=engines,
                jobs=jobs,
                reference=reference,
                out=out,
                pictures=pictures,
                page=page,
                record=record,
                progress=watch,
            )
        run = Run(native)
        if interrupted is not None:
            raise with_result(interrupted, run)
        if native.engine_failures:
            text = "\n".join(f"{engine}: {message}" for engine, message in native.engine_failures)
            raise EnvironmentFailed(text, run)
        return run

    def export(
        self,
        format: str,
        out: str | os.PathLike[str] | None = None,
        *,
        goal: str | None = None,
        configuration: str | None = None,
        engine: str | None = None,
        joints: npt.ArrayLike | None = None,
        progress: bool | Progress | None = None,
    ) -> list[dict[str, Any]]:
        """Exports the cell or a motion to another tool's format, as ``needlebench export``.

        Args:
            format: ``mjcf``, ``urdf``, ``gltf`` for the cell; ``mcap``, ``trajectory``, ``urscript`` for a motion.
            out: file [default: in ``out/NAME``].
            goal: goal of a motion or a posture [default: the scenario's only goal].
            configuration: configuration of the goal [default for a motion: the recommended one].
            engine: physics engine that simulates the motion.
            joints: posture of the cell, rad: (6,).
            progress: ``True`` shows a bar; a function is called with message, done and total.

        Returns:
            Each written file: ``name``, ``bytes``, ``sha256``.

        Raises:
            InputError: input that ``needlebench export`` rejects, e.g. an infeasible configuration.
        """
        listed = None
        if joints is not None:
            import numpy as np

            listed = ",".join(repr(float(value)) for value in np.asarray(joints, float).ravel())
        given = {key: value for key, value in self._options.items() if value is not None}
        answer = command(
            "export",
            self.file,
            as_=format,
            out=out,
            goal=goal,
            configuration=configuration,
            engine=engine,
            joints=listed,
            progress=progress,
            **given,
        )
        return answer.data["files"]

    def command(self, name: str, **options: Any) -> Any:
        """Runs a command on the scenario and returns its JSON answer, e.g. ``s.command("pairs")``."""
        given = {key: value for key, value in self._options.items() if value is not None}
        return command(name, self.file, **given, **options).data
