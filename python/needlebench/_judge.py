"""Motions of other planners and answers of other solvers, judged."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Literal

from . import _native
from ._command import with_result
from ._errors import EnvironmentFailed
from ._progress import Watching
from ._run import Run

if TYPE_CHECKING:
    import os

    import numpy.typing as npt

    from ._progress import Progress
    from ._scenario import Scenario

Curve = Literal["quintics", "cubics", "lines"]
"""What joins the points of a motion."""


def judge(
    scenario: Scenario,
    times_s: npt.ArrayLike,
    positions_rad: npt.ArrayLike,
    velocities_rad_s: npt.ArrayLike | None = None,
    accelerations_rad_s2: npt.ArrayLike | None = None,
    *,
    goal: str | None = None,
    between: Curve | None = None,
    any_start: bool = False,
    beside: bool = True,
    engines: list[str] | None = None,
    jobs: int | None = None,
    reference: bool = False,
    out: str | os.PathLike[str] | None = None,
    pictures: bool = True,
    page: bool = True,
    record: Literal["mcap"] | None = None,
    progress: bool | Progress | None = None,
) -> Run:
    """Judges a motion as a run judges its own, as ``needlebench judge --motion``.

    Each goal at which the motion holds has the one configuration in which it is held; ``run.report["judged"]`` says
    where it holds, how near to the joints' limits it comes, and what needlebench plans to the same goals.

    Args:
        scenario: scenario with the goals.
        times_s: time of each point, s, increasing: (n,).
        positions_rad: joint positions, rad: (n, 6).
        velocities_rad_s: joint velocities, rad/s: (n, 6).
        accelerations_rad_s2: joint accelerations, rad/s^2: (n, 6).
        goal: goal that the motion leads to [default: those at which it stands].
        between: what joins the points [default: quintics with accelerations, cubics with velocities, else straight
            lines].
        any_start: the motion may begin elsewhere than at the scenario's start posture.
        beside: needlebench plans to the same goals beside it.
        engines: names of physics engines [default: those of the scenario].
        jobs: number of threads [default: all cores]; does not affect results.
        reference: verify the motion against the reference integrator.
        out: folder; results are written to ``out/NAME``.
        pictures: with images and charts.
        page: with the report page.
        record: format of the recordings beside CSV, which are written with ``out``.
        progress: ``True`` shows a bar; a function is called with message, done and total.

    Raises:
        InputError: the motion is refused: a jump, a time that does not increase, an end that is no goal.
        EnvironmentFailed: an engine failed; the measurements of the others are in ``result``.
        Interrupted: completed results are in ``result``.
    """
    with Watching(progress) as watch:
        native, interrupted = _native.judge(
            scenario._native,
            times_s,
            positions_rad,
            velocities_rad_s,
            accelerations_rad_s2,
            goal=goal,
            between=between,
            any_start=any_start,
            beside=beside,
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


def judge_free(
    scenario: Scenario,
    times_s: npt.ArrayLike,
    positions_rad: npt.ArrayLike,
    velocities_rad_s: npt.ArrayLike | None = None,
    accelerations_rad_s2: npt.ArrayLike | None = None,
    *,
    between: Curve | None = None,
) -> dict[str, Any]:
    """Judges the clearances and joints' limits of a motion that leads to no goal, as ``needlebench judge --free``.

    Args:
        scenario: scenario with the cell.
        times_s: time of each point, s, increasing: (n,).
        positions_rad: joint positions, rad: (n, 6).
        velocities_rad_s: joint velocities, rad/s: (n, 6).
        accelerations_rad_s2: joint accelerations, rad/s^2: (n, 6).
        between: what joins the points [default: as of `judge`].

    Returns:
        ``verdict``, ``clearance`` by class, attained and certified, m, ``peaks``, ``criteria``, ``not_judged``, as
        ``needlebench judge --free --json`` prints it.

    Raises:
        InputError: the motion is refused.
    """
    text = _native.judge_free(
        scenario._native, times_s, positions_rad, velocities_rad_s, accelerations_rad_s2, between=between
    )
    return json.loads(text)


def judge_answers(
    scenario: Scenario,
    joints_rad: npt.ArrayLike,
    *,
    goal: str | None = None,
    tolerance: float | None = None,
    partial: bool = False,
    jobs: int | None = None,
    progress: bool | Progress | None = None,
) -> dict[str, Any]:
    """Judges answers of inverse kinematics against the complete set, as ``needlebench judge --answers``.

    Args:
        scenario: scenario with the goal.
        joints_rad: joint positions, rad: (n, 6).
        goal: goal that is answered [default: the scenario's only goal].
        tolerance: largest distance, m, and angle, rad, of a right answer [default: 1e-4].
        partial: one right answer is enough.
        jobs: number of threads [default: all cores]; does not affect results.
        progress: ``True`` shows a bar; a function is called with message, done and total.

    Returns:
        ``verdict``, and ``questions`` with ``solutions`` and ``answers``, as ``needlebench judge --answers --json``
        prints it.

    Raises:
        InputError: no such goal, or no joint positions.
        Interrupted: it was interrupted.
    """
    with Watching(progress) as watch:
        text = _native.judge_answers(
            scenario._native,
            joints_rad,
            goal=goal,
            tolerance=tolerance,
            partial=partial,
            jobs=jobs,
            progress=watch,
        )
    return json.loads(text)
