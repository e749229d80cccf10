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
    """A completed study: a table with a row for each case, goal and configuration, and its statistics."""

    def __init__(self, file: Path, folder: Path, summary: dict[str, Any]) -> None:
        self.file = file
        """The study file."""
        self.folder = folder
        """Folder of its results."""
        self.summary: dict[str, Any] = summary
        """Statistics, criteria and answer, as printed by ``needlebench study --json``."""

    @property
    def path(self) -> Path:
        """The table: a Parquet file. Columns have units in their names and descriptions in the file's metadata."""
        return self.folder / "results.parquet"

    @property
    def verdict(self) -> str:
        """``pass``, ``fail`` or ``incomplete``."""
        return self.summary["verdict"]

    def check(self) -> Study:
        """Returns itself if all criteria are met; raises `CriterionFailed` otherwise."""
        if self.verdict != "pass":
            missed = [each for each in self.summary["criteria"] if not each.get("pass", False)]
            lines = [str(each) for each in [*missed, *self.summary["not_judged"]]]
            raise CriterionFailed("\n".join([f"{self.verdict}: {self.summary['name']}", *lines]))
        return self

    def to_arrow(self) -> Any:
        """The table as a ``pyarrow.Table``; requires ``pyarrow``."""
        import pyarrow.parquet

        parquet: Any = pyarrow.parquet
        return parquet.read_table(self.path)

    def to_polars(self) -> polars.DataFrame:
        """The table as a Polars frame; requires ``polars``."""
        import polars

        return polars.read_parquet(self.path)

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a pandas frame; requires ``pandas`` and ``pyarrow``."""
        return self.to_arrow().to_pandas()

    def case(self, number: int) -> dict[str, Any]:
        """Recomputes one case; returns its layout and rows.

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
    """Computes or resumes a study.

    The table is byte-identical to that of ``needlebench study``. An interrupt keeps completed cases: call again with
    ``resume=True``.

    With a Dask ``client`` the study is computed on its workers, which require this package and access to the same
    folders under the same paths. Each shard is a process that is started again if its worker is lost; the same call
    resumes after an interrupt. Shards are in ``out/NAME/shards`` and can be deleted once the table is complete.

    Args:
        path: study file (TOML).
        out: folder; results are written to ``out/NAME``.
        jobs: number of threads [default: all cores]; does not affect results.
        resume: continue with completed cases.
        yes: start also if the expected time exceeds 20 minutes.
        page: write the page.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        client: ``distributed.Client``, or an object with its ``submit`` and ``nthreads``; ``jobs`` is then the number
            of threads per shard [default: 1].
        shards: number of parts for the client's workers [default: four per worker thread].
        options: further options of ``needlebench study``, e.g. ``csv=True``.

    Raises:
        InputError: input that ``needlebench study`` rejects.
        EnvironmentFailed: with a client: a shard failed in spite of restarts.
        Interrupted: interrupted; completed cases are kept.
    """
    if client is not None:
        return _on_client(client, path, out, jobs, shards, page, progress, options)
    if shards is not None:
        raise InputError("shards: requires a client; study_shard computes a single shard")
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
    """Computes the shards of a study on workers, and merges them."""
    from ._cluster import study_on

    robot = {name: value for name, value in options.items() if name in ROBOT_OPTIONS}
    folder = study_on(client, path, out, shards, jobs or 1, robot, progress)
    # All options that are not of the robot are of the table.
    return merge(path, [folder], out=out, page=page, progress=progress, **options)


ROBOT_OPTIONS = ("arm", "robot", "xacro", "prefix", "package_path", "calibration", "missing_inertia")
"""Options that affect the results."""


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
    """Computes one of several parts of a study, for `merge`; called again, it resumes or returns at once.

    Args:
        path: study file (TOML).
        shard: number of the part, from 1.
        shards: number of parts.
        out: folder of this shard only.
        jobs: number of threads.
        resume: continue with completed cases.
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
    """Joins the shards of a study, byte-identical to the study in one piece.

    Args:
        path: study file (TOML).
        shards: folders returned by `study_shard`.
        out: folder; results are written to ``out/NAME``.
        jobs: number of threads.
        page: write the page.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: further options of ``needlebench merge``.

    Raises:
        InputError: shards of another study, or missing shards.
    """
    answer = command("merge", path, *shards, out=out, jobs=jobs, no_page=not page, progress=progress, **options)
    return _finished(path, out, answer.data)


def _finished(path: str | os.PathLike[str], out: str | os.PathLike[str], summary: dict[str, Any]) -> Study:
    return Study(Path(path), Path(out) / summary["name"], summary)
