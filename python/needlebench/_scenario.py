"""Scenarios."""

from __future__ import annotations

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
    """The least clearance of one class of pairs.

    Shapes are those of one posture, with ``(n, ...)`` before them where there were n.
    """

    minimum_m: Any
    """Signed distance, m: a gap is positive, a depth negative."""
    pair: Any
    """Names of the two solids; a list of them where there are n postures."""
    witness_points_m: Floats
    """A point on each of the two, in the world, m: (2, 3)."""


class PairClearances(NamedTuple):
    """Signed distances of all pairs that are measured.

    Shapes are those of one posture, with ``(n, ...)`` before them where there were n.
    """

    pair: list[tuple[str, str]]
    """Names of the two bodies of each pair."""
    classes: list[str]
    """Class of each pair."""
    distance_m: Floats
    """Signed distance of each pair, m: (p,)."""
    witness_points_m: Floats
    """A point on each body, in the world, m: (p, 2, 3)."""
    solids: Any
    """Names of the two solids that are nearest; a list of such lists where there are n postures."""


class Clearance(NamedTuple):
    """Clearances of one posture or several."""

    classes: dict[str, ClassClearance]
    """By class; a class that the cell has no pair of is absent."""
    pairs: PairClearances | None
    """All pairs, where they were asked for."""


class ClassCertificate(NamedTuple):
    """The least clearance of one class over a whole motion, from both sides."""

    certified_lower_bound_m: float
    """Proven for every time of the motion, m."""
    minimum_m: float
    """Attained, m."""
    time_s: float
    """When it is attained, s."""
    joints_rad: Floats
    """Posture in which it is attained, rad: (6,)."""
    pair: tuple[str, str]
    """Names of the two solids."""
    witness_points_m: Floats
    """A point on each, in the world, m: (2, 3)."""


class Certificate(NamedTuple):
    """Proven clearances of a motion."""

    classes: dict[str, ClassCertificate]
    """By class."""
    duration_s: float
    """How long the motion takes, s."""


class Scenario:
    """A scenario that was read and checked: robot, tool, patient, room, goals."""

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
            robot: URDF in place of the scenario's robot.
            arm: whose data the robot has, where the URDF does not say.
            prefix: what stands before the names of the robot's joints, where a URDF has several arms.
            calibration: the maker's calibration of the arm (YAML).
            packages: ``NAME=DIR`` for ``package://NAME/`` in URDFs.
            missing_inertia: what to do where the URDF has no inertia.

        Raises:
            InputError: with every finding of ``needlebench check``, and a start posture that collides.
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
        """What it is about."""
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
        """The maker's name of its arm."""
        return self._native.arm

    @property
    def goals(self) -> list[str]:
        """Names of its goals."""
        return self._native.goals

    @property
    def notes(self) -> list[str]:
        """What was assumed or adjusted."""
        return self._native.notes

    @property
    def start_rad(self) -> Floats:
        """Posture in which every motion begins, rad: (6,)."""
        return self._native.start_rad

    def __repr__(self) -> str:
        return f"Scenario({self.name}: {', '.join(self.goals)})"

    def fk(self, joints: npt.ArrayLike) -> ForwardKinematics:
        """Poses of flange and links of its arm: see `needlebench.fk`."""
        return ForwardKinematics(self._native.fk(joints))

    def clearance(self, joints: npt.ArrayLike, *, pairs: bool = False) -> Clearance:
        """Signed clearances of postures in its cell.

        The same numbers, bit for bit, as ``needlebench clearance``.

        Args:
            joints: joint positions, rad: (6,) or (n, 6).
            pairs: list every pair that is measured, too.

        Raises:
            InputError: another shape, or numbers that are not finite.
        """
        found = self._native.clearance(joints, pairs=pairs)
        classes = {name: ClassClearance(**each) for name, each in found["classes"].items()}
        all_pairs = found.get("pairs")
        if all_pairs is None:
            return Clearance(classes, None)
        all_pairs["classes"] = all_pairs.pop("class")
        return Clearance(classes, PairClearances(**all_pairs))

    def certify(self, joints: npt.ArrayLike, *, tolerance_m: float = 1e-4) -> Certificate:
        """Proves how near anything comes while the arm goes straight in joint space through postures.

        Speeds are the scenario's; bounds do not depend on them.

        Args:
            joints: postures, rad: (n, 6), n at least 2.
            tolerance_m: how far the proven bound may be below what is attained, m.

        Raises:
            InputError: another shape, or numbers that are not finite.
        """
        found = self._native.certify(joints, tolerance_m=tolerance_m)
        classes = {name: ClassCertificate(**each) for name, each in found["classes"].items()}
        return Certificate(classes, found["duration_s"])

    def plan(self, *, jobs: int | None = None, progress: bool | Progress | None = None) -> Plan:
        """Plans every configuration of every goal, without simulating: postures, reasons, motions, proven clearances.

        Args:
            jobs: threads; as many as there are cores if left out. Results do not depend on it.
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
        referee: bool = False,
        out: str | os.PathLike[str] | None = None,
        pictures: bool = True,
        page: bool = True,
        record: str | None = None,
        progress: bool | Progress | None = None,
    ) -> Run:
        """Plans, simulates, measures and judges every configuration of every goal.

        The report has the same numbers as ``needlebench run --json``, bit for bit, but for ``timings``.

        Args:
            engines: names of engines; the scenario's own choice if left out.
            jobs: threads; as many as there are cores if left out. Results do not depend on it.
            referee: hold every motion against the referee.
            out: folder; the results are written into ``out/NAME`` as ``needlebench run --out`` does.
            pictures: pictures and charts among them.
            page: the report page among them.
            record: ``"mcap"`` writes each recording as MCAP with ROS 2 messages, too.
            progress: ``True`` shows a bar; a function is called with message, done and total.

        Raises:
            InputError: an engine that there is not; a scan that cannot be used.
            EnvironmentFailed: an engine failed; what the others measured is in ``result``.
            Interrupted: what was finished until then is in ``result``.
        """
        with Watching(progress) as watch:
            native, interrupted = self._native.run(
                engines=engines,
                jobs=jobs,
                referee=referee,
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
        """Writes the cell or a motion in the format of another tool, as ``needlebench export`` does.

        Args:
            format: ``mjcf``, ``urdf``, ``gltf`` for the cell; ``mcap``, ``trajectory``, ``urscript`` for a motion.
            out: file; in ``out/NAME`` if left out.
            goal: of a motion or a posture; the scenario's only one if left out.
            configuration: of the goal; of a motion the recommended one if left out.
            engine: whose motion it is.
            joints: posture of the cell, rad: (6,).
            progress: ``True`` shows a bar; a function is called with message, done and total.

        Returns:
            Each file that was written: ``name``, ``bytes``, ``sha256``.

        Raises:
            InputError: what ``needlebench export`` refuses, such as a configuration that does not work.
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
        """JSON answer of a command that takes a scenario, such as ``s.command("pairs")``."""
        given = {key: value for key, value in self._options.items() if value is not None}
        return command(name, self.file, **given, **options).data
