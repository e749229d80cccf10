"""Studies."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._command import command
from ._errors import CriterionFailed, InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas
    import polars

    from ._progress import Progress


class Study:
    """A study that is finished: a table with a row for each case, goal and configuration, and its statistics."""

    def __init__(self, file: Path, folder: Path, summary: dict[str, Any]) -> None:
        self.file = file
        """The study file."""
        self.folder = folder
        """Folder of its results."""
        self.summary: dict[str, Any] = summary
        """Statistics, criteria and answer, as ``needlebench study --json`` prints them."""

    @property
    def path(self) -> Path:
        """The table: a Parquet file. Columns have units in their names and descriptions in the file's metadata."""
        return self.folder / "results.parquet"

    @property
    def verdict(self) -> str:
        """``pass``, ``fail`` or ``incomplete``."""
        return self.summary["verdict"]

    def check(self) -> Study:
        """Itself if all criteria were met; raises `CriterionFailed` otherwise."""
        if self.verdict != "pass":
            missed = [each for each in self.summary["criteria"] if not each.get("pass", False)]
            lines = [str(each) for each in [*missed, *self.summary["not_judged"]]]
            raise CriterionFailed("\n".join([f"{self.verdict}: {self.summary['name']}", *lines]))
        return self

    def to_arrow(self) -> Any:
        """The table as a ``pyarrow.Table``; needs ``pyarrow``."""
        import pyarrow.parquet

        parquet: Any = pyarrow.parquet
        return parquet.read_table(self.path)

    def to_polars(self) -> polars.DataFrame:
        """The table as a Polars frame; needs ``polars``."""
        import polars

        return polars.read_parquet(self.path)

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a pandas frame; needs ``pandas`` and ``pyarrow``."""
        return self.to_arrow().to_pandas()

    def case(self, number: int) -> dict[str, Any]:
        """One case computed again: its layout and its rows.

        Raises:
            InputError: there is no such case.
        """
        return command("study", self.file, case=number).data

    def __repr__(self) -> str:
        return f"Study({self.summary['name']}: {self.summary['cases']} cases, {self.verdict})"


def study(
    path: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] = "out",
    jobs: int | None = None,
    resume: bool = False,
    yes: bool = False,
    page: bool = True,
    progress: bool | Progress | None = None,
    client: Any = None,
    shards: int | None = None,
    **options: Any,
) -> Study:
    """Computes a study, or goes on with one.

    The table has the same bytes as that of ``needlebench study``. An interrupt keeps what is computed: call again with
    ``resume=True``.

    With a ``client`` of Dask the study is computed on its workers, which need this package and see the same folders
    under the same names. Each shard is a process that is asked for again if its worker is lost; called again after an
    interrupt, it goes on. Shards are kept in ``out/NAME/shards`` and are of no use once the table is there.

    Args:
        path: study file (TOML).
        out: folder; results are written into ``out/NAME``.
        jobs: threads; as many as there are cores if left out. Results do not depend on it.
        resume: go on with what is there.
        yes: start what is expected to take longer than 20 minutes, too.
        page: write the page.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        client: ``distributed.Client``, or anything with its ``submit`` and ``nthreads``; ``jobs`` are the threads of a
            shard then, one if left out.
        shards: in how many parts the client's workers compute it; four for each thread of a worker if left out.
        options: further options of ``needlebench study``, such as ``csv=True``.

    Raises:
        InputError: what ``needlebench study`` refuses.
        EnvironmentFailed: with a client: a shard could not be computed, however often it was asked for again.
        Interrupted: interrupted; finished cases are kept.
    """
    if client is not None:
        return _on_client(client, path, out, jobs, shards, page, progress, options)
    if shards is not None:
        raise InputError("shards: only with a client; study_shard computes one by itself")
    answer = command(
        "study",
        path,
        out=out,
        jobs=jobs,
        resume=resume,
        yes=yes,
        no_page=not page,
        progress=progress,
        **options,
    )
    return _finished(path, out, answer.data)


def _on_client(
    client: Any,
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    jobs: int | None,
    shards: int | None,
    page: bool,
    progress: bool | Progress | None,
    options: dict[str, Any],
) -> Study:
    """A study whose shards are computed on workers."""
    from ._cluster import study_on

    robot = {name: value for name, value in options.items() if name in ROBOT_OPTIONS}
    folder = study_on(client, path, out, shards, jobs or 1, robot, progress)
    # All that is not of the robot is of the table.
    return merge(path, [folder], out=out, page=page, progress=progress, **options)


ROBOT_OPTIONS = ("arm", "robot", "prefix", "package_path", "calibration", "missing_inertia")
"""Options that decide what is computed."""


def study_shard(
    path: str | os.PathLike[str],
    shard: int,
    shards: int,
    *,
    out: str | os.PathLike[str],
    jobs: int | None = 1,
    resume: bool = True,
    progress: bool | Progress | None = None,
    **options: Any,
) -> Path:
    """Computes one of several parts of a study, for `merge`; asked for again it goes on, or returns at once.

    Args:
        path: study file (TOML).
        shard: which, from 1.
        shards: of how many.
        out: folder of this shard alone.
        jobs: threads.
        resume: go on with what is there.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: further options of ``needlebench study``.

    Returns:
        The folder to merge.
    """
    command(
        "study",
        path,
        out=out,
        shard=f"{shard}/{shards}",
        jobs=jobs,
        resume=resume,
        yes=True,
        json=shards == 1,
        progress=progress,
        **options,
    )
    return next(each.parent for each in sorted(Path(out).glob("*/study.json")))


def merge(
    path: str | os.PathLike[str],
    shards: Sequence[str | os.PathLike[str]],
    *,
    out: str | os.PathLike[str] = "out",
    jobs: int | None = None,
    page: bool = True,
    progress: bool | Progress | None = None,
    **options: Any,
) -> Study:
    """Joins the shards of a study: the same bytes as the study in one piece.

    Args:
        path: study file (TOML).
        shards: folders that `study_shard` gave.
        out: folder; results are written into ``out/NAME``.
        jobs: threads.
        page: write the page.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: further options of ``needlebench merge``.

    Raises:
        InputError: shards of another study, or some are missing.
    """
    answer = command("merge", path, *shards, out=out, jobs=jobs, no_page=not page, progress=progress, **options)
    return _finished(path, out, answer.data)


def _finished(path: str | os.PathLike[str], out: str | os.PathLike[str], summary: dict[str, Any]) -> Study:
    return Study(Path(path), Path(out) / summary["name"], summary)
