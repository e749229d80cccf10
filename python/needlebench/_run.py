"""Results of plans and runs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ._errors import CriterionFailed

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from . import _native

    Floats = npt.NDArray[np.float64]

Recording = dict[str, Any]
"""Arrays of a recorded motion, by names with units; poses and clearances are dictionaries of arrays."""


class PlannedConfiguration:
    """One of the eight configurations of a goal, as planned."""

    def __init__(self, native: _native.Run, goal: str, report: dict[str, Any]) -> None:
        self._native = native
        self._goal = goal
        self.report: dict[str, Any] = report
        """Its part of the report, SI units."""

    @property
    def label(self) -> str:
        """Its label, one of `needlebench.CONFIGURATIONS`."""
        return self.report["label"]

    @property
    def status(self) -> str:
        """``planned``: no rule rejects it and it has a motion; ``rejected`` otherwise."""
        return "rejected" if self.rejections else "planned"

    @property
    def rejections(self) -> list[dict[str, Any]]:
        """Rules that reject it, the first failing one first."""
        return self.report["rejections"]

    @property
    def joints_rad(self) -> Floats | None:
        """Its final posture, rad: (6,); ``None`` if the pose is out of reach."""
        import numpy as np

        joints = self.report["joints_rad"]
        return None if joints is None else np.array(joints)

    @property
    def metrics(self) -> dict[str, Any]:
        """Its metrics by key, SI units."""
        return self.report["metrics"]

    @property
    def clearance(self) -> dict[str, Any]:
        """Minimum clearances by class over its motion, attained and certified, m."""
        return self.report["clearance"]

    def duration_s(self, *, retreat: bool = False) -> float | None:
        """Duration of its planned motion, or of the retreat, s; ``None`` without a motion."""
        return self._native.duration_s(self._goal, self.label, retreat=retreat)

    def motion(self, times_s: npt.ArrayLike | None = None, *, retreat: bool = False) -> dict[str, Any]:
        """Its planned motion: position, velocity and acceleration of all joints.

        Args:
            times_s: times, s: (n,) [default: every 8 ms of the whole motion].
            retreat: the retreat instead of the motion to the goal.

        Returns:
            ``time_s`` (n,), ``phase``, and ``position_rad``, ``velocity_rad_s``, ``acceleration_rad_s2`` (n, 6).

        Raises:
            KeyError: it has no motion.
        """
        import numpy as np

        if times_s is None:
            duration = self.duration_s(retreat=retreat)
            if duration is None:
                raise KeyError(f"{self.label} has no motion")
            times_s = np.append(np.arange(0.0, duration, 0.008), duration)
        return self._native.motion(self._goal, self.label, np.atleast_1d(times_s), retreat=retreat)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.label}: {self.status})"


class Configuration(PlannedConfiguration):
    """One of the eight configurations of a goal, as simulated and evaluated."""

    @property
    def status(self) -> str:
        """``ok``, ``rejected`` or ``failed``."""
        return self.report["status"]

    @property
    def recordings(self) -> dict[str, Recording]:
        """The recording of each engine, by its name."""
        engines = self._native.engines(self._goal, self.label)
        return {engine: self._native.recording(self._goal, self.label, engine) for engine in engines}

    @property
    def recording(self) -> Recording:
        """The recording of the first engine.

        ``time_s`` (n,), ``phase``; ``position_rad``, ``velocity_rad_s`` and the planned ``reference_...`` (n, 6);
        ``torque_nm``, ``drive_nm`` over each step (n - 1, 6); ``flange_in_world``: ``position_m``, ``quat_wxyz``, ...;
        ``contact_force_n``, ``penetration_m`` (n,); ``clearance``: ``time_s`` and a series for each class, m.

        Raises:
            KeyError: nothing was simulated.
        """
        engines = self._native.engines(self._goal, self.label)
        if not engines:
            raise KeyError(f"{self.label} was not simulated")
        return self._native.recording(self._goal, self.label, engines[0])


_Configuration = TypeVar("_Configuration", bound=PlannedConfiguration)


class _Goal(Mapping[str, _Configuration], Generic[_Configuration]):
    def __init__(self, report: dict[str, Any], configurations: list[_Configuration]) -> None:
        self.report: dict[str, Any] = report
        """Its part of the report, SI units."""
        self._configurations = {each.label: each for each in configurations}

    @property
    def name(self) -> str:
        """Its name."""
        return self.report["name"]

    def __getitem__(self, label: str) -> _Configuration:
        return self._configurations[label]

    def __iter__(self) -> Iterator[str]:
        return iter(self._configurations)

    def __len__(self) -> int:
        return len(self._configurations)

    def __repr__(self) -> str:
        statuses = ", ".join(f"{label}: {each.status}" for label, each in self.items())
        return f"{type(self).__name__}({self.name}; {statuses})"


class PlannedGoal(_Goal[PlannedConfiguration]):
    """The plans of one goal: its configurations by their labels."""

    @property
    def planned(self) -> list[PlannedConfiguration]:
        """Configurations with a motion that no rule rejects. Criteria are evaluated by a run only."""
        return [each for each in self.values() if each.status == "planned"]


class GoalResult(_Goal[Configuration]):
    """Results of one goal: its configurations by their labels."""

    @property
    def working(self) -> list[Configuration]:
        """Feasible configurations."""
        return [each for each in self.values() if each.status == "ok"]

    @property
    def recommended(self) -> Configuration | None:
        """The recommended configuration; ``None`` if none is feasible."""
        chosen = self.report["recommended"]
        return None if chosen is None else self[chosen["label"]]


_JUDGED = (
    "status",
    "not_judged",
    "engines",
    "engine_difference",
    "adjudication",
    "referee",
    "pareto",
    "dominated_by",
    "ranking",
    "files",
)
"""Keys that a plan does not have."""


class Plan(Mapping[str, PlannedGoal]):
    """Goals by their names, with the plans of their configurations; not simulated, not evaluated."""

    def __init__(self, native: _native.Run) -> None:
        def planned(goal: dict[str, Any]) -> PlannedGoal:
            configurations: list[PlannedConfiguration] = []
            for each in goal.pop("configurations"):
                known = {key: value for key, value in each.items() if key not in _JUDGED}
                configurations.append(PlannedConfiguration(native, goal["name"], known))
            known = {key: value for key, value in goal.items() if key not in ("recommended", "ranking")}
            return PlannedGoal(known, configurations)

        self._goals = {goal["name"]: planned(goal) for goal in json.loads(native.report_json())["goals"]}

    def __getitem__(self, goal: str) -> PlannedGoal:
        return self._goals[goal]

    def __iter__(self) -> Iterator[str]:
        return iter(self._goals)

    def __len__(self) -> int:
        return len(self._goals)

    def __repr__(self) -> str:
        return f"Plan({', '.join(self)})"


class Run(Mapping[str, GoalResult]):
    """Results of a run: goals by their names, the report, recordings, the verdict."""

    def __init__(self, native: _native.Run) -> None:
        self._native = native
        self._report: dict[str, Any] | None = None

    def to_json(self) -> str:
        """The report as ``needlebench run --json`` prints it."""
        return self._native.report_json()

    @property
    def report(self) -> dict[str, Any]:
        """The report, SI units."""
        report = self._report
        if report is None:
            report = self._report = json.loads(self.to_json())
        return report

    def __getitem__(self, goal: str) -> GoalResult:
        for each in self.report["goals"]:
            if each["name"] == goal:
                rows = each["configurations"]
                return GoalResult(each, [Configuration(self._native, goal, row) for row in rows])
        raise KeyError(goal)

    def __iter__(self) -> Iterator[str]:
        return iter([goal["name"] for goal in self.report["goals"]])

    def __len__(self) -> int:
        return len(self.report["goals"])

    @property
    def verdict(self) -> str:
        """``pass``, ``fail`` or ``incomplete``."""
        return self._native.verdict

    @property
    def criteria(self) -> list[dict[str, Any]]:
        """The evaluated criteria."""
        return self.report["criteria"]

    def check(self) -> Run:
        """Returns itself if all criteria are met; raises `CriterionFailed` with the failed ones otherwise."""
        if self.verdict != "pass":
            missed = [each for each in self.criteria if not each["pass"]]
            lines = [" ".join(str(part) for part in _line(each) if part) for each in missed]
            lines += [f"not evaluated: {each}" for each in self.report["not_judged"]]
            raise CriterionFailed("\n".join([f"{self.verdict}: {self.report['scenario']}", *lines]))
        return self

    def __repr__(self) -> str:
        return f"Run({', '.join(self)}: {self.verdict})"


def _line(criterion: dict[str, Any]) -> list[Any]:
    """The text of a failed criterion."""
    place = [criterion[key] for key in ("goal", "label", "engine")]
    value, limit, unit = (criterion[key] for key in ("value", "limit", "unit"))
    return [*place, f"{criterion['criterion']}: {value} {unit}, limit {limit} {unit}", criterion["detail"]]
