"""A study in shards on the workers of a Dask cluster.

A shard is a separate process, as on any other cluster, which may be killed and started again: it resumes. Workers and
caller share a folder, and nothing else.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import tomllib
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._command import command, option_words
from ._errors import EnvironmentFailed, InputError, Interrupted, NeedlebenchError
from ._progress import Watching

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ._progress import Progress

PERIOD_S = 0.2
"""Polling period of futures and processes."""

RESTARTS = 5
"""Number of restarts of a shard, where a restart may help."""

SHARDS_PER_WORKER = 4
"""Enough for a balanced load at the end."""


def study_on(
    client: Any,
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    shards: int | None,
    jobs: int,
    robot: dict[str, Any],
    progress: bool | Progress | None,
) -> Path:
    """Computes all shards on a client's workers; returns their folder."""
    file = Path(path).resolve()
    name = _name(file)
    folder = Path(out).resolve() / name / "shards"
    folder.mkdir(parents=True, exist_ok=True)
    status = command("study", file, status=folder, **robot).data
    arguments = [f"--jobs={jobs}", *option_words(robot)]
    count = _number_of_shards(client, shards, status)
    # Tells the workers to stop: a task that runs cannot be cancelled otherwise.
    stop = folder / f".stop-{uuid.uuid4().hex}"
    futures = {k: _submit(client, file, k, count, folder, stop, arguments) for k in range(1, count + 1)}
    tries = dict.fromkeys(futures, 0)
    done = 0
    try:
        with Watching(progress) as watch:
            while futures:
                ended = [k for k, future in futures.items() if future.done()]
                for k in ended:
                    error = futures[k].exception()
                    if error is None:
                        del futures[k]
                        done += 1
                    elif isinstance(error, InputError) or tries[k] == RESTARTS:
                        raise _of_shard(k, count, error)
                    else:
                        # A worker that was lost more often than Dask tolerates, or a temporary failure.
                        tries[k] += 1
                        futures[k] = _submit(client, file, k, count, folder, stop, arguments)
                if watch:
                    watch("shards", done, count)
                if futures and not ended:
                    time.sleep(PERIOD_S)
    except BaseException as error:
        _end(futures, stop)
        if isinstance(error, KeyboardInterrupt):
            said = f"interrupted: {done} of {count} shards are in {folder}; call again to resume"
            raise Interrupted(said) from error
        raise
    return folder


def _name(file: Path) -> str:
    """The name of the study and of its folder."""
    try:
        name = tomllib.loads(file.read_text(encoding="utf-8")).get("name")
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        name = None
    if not isinstance(name, str):
        # Raises the error of the file.
        command("study", file, case=0)
        raise InputError(f"{file}: the study has no name")
    return name


def _number_of_shards(client: Any, shards: int | None, status: dict[str, Any]) -> int:
    most = status["blocks"]
    if shards is None:
        threads = sum(client.nthreads().values())
        # Shards in progress keep their number.
        return status["shards"] or max(1, min(SHARDS_PER_WORKER * threads, most))
    if not 1 <= shards <= most:
        raise InputError(f"shards={shards}: 1 to {most} possible for this study")
    return shards


def _submit(
    client: Any, file: Path, shard: int, shards: int, folder: Path, stop: Path, arguments: Sequence[str]
) -> Any:
    return client.submit(
        compute_shard,
        os.fspath(file),
        shard,
        shards,
        os.fspath(folder / str(shard)),
        os.fspath(stop),
        list(arguments),
        # No cached result of another call: its files may be deleted.
        pure=False,
    )


def _of_shard(shard: int, shards: int, error: BaseException) -> BaseException:
    """The error of a shard, by its class."""
    if isinstance(error, NeedlebenchError):
        return error
    return EnvironmentFailed(f"shard {shard}/{shards}: {type(error).__name__}: {error}")


def _end(futures: dict[int, Any], stop: Path) -> None:
    """Stops running shards, and waits until they have stored their cases."""
    stop.touch()
    try:
        for future in futures.values():
            future.cancel()
        # A process ends with the case that it computes; a moment is enough to see the file.
        time.sleep(2 * PERIOD_S)
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline and any(_is_running(stop.parent / str(k)) for k in futures):
            time.sleep(PERIOD_S)
    finally:
        stop.unlink(missing_ok=True)


def _is_running(shard: Path) -> bool:
    """Whether a worker computes a shard."""
    return (shard / RUNNING).exists()


RUNNING = ".running"
"""Marker file that exists while a worker watches the process of the shard."""


def compute_shard(file: str, shard: int, shards: int, out: str, stop: str, arguments: list[str]) -> int:
    """Computes a shard on a worker, in a process that ends with this one. Returns the exit status, 0.

    Raises:
        InputError: exit status 2.
        EnvironmentFailed: exit status 3, or killed.
        InterruptedShard: stopped on request.
    """
    command_line = [sys.executable, "-m", "needlebench._cluster", "study", file, f"--shard={shard}/{shards}"]
    command_line += [f"--out={out}", "--resume", "--yes", "--quiet", *arguments]
    Path(out).mkdir(parents=True, exist_ok=True)
    running = Path(out) / RUNNING
    status, said = 3, ""
    # Between attempts, too: a stop request waits until it is seen.
    running.touch()
    try:
        for attempt in range(RESTARTS + 1):
            if Path(stop).exists():
                raise InterruptedShard(f"shard {shard}/{shards}: stopped on request")
            status, said = _watched(command_line, Path(stop))
            if status == 0:
                return status
            if status == 2:
                raise InputError(said)
            # The folder of a dead worker is in use until its process has ended.
            time.sleep(0.0 if Path(stop).exists() else min(2.0**attempt, 10.0))
    finally:
        running.unlink(missing_ok=True)
    raise EnvironmentFailed(said or f"shard {shard}/{shards} ended with {status}")


class InterruptedShard(NeedlebenchError):
    """A shard that was stopped on request. Its completed cases are kept."""

    status = 130


def _watched(command_line: list[str], stop: Path) -> tuple[int, str]:
    """Exit status and error output of a process. Its standard input is a pipe that closes when this process ends."""
    with subprocess.Popen(
        command_line, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        said: list[str] = []
        reader = threading.Thread(target=lambda: said.extend(process.stderr or []), daemon=True)
        reader.start()
        try:
            while True:
                try:
                    process.wait(PERIOD_S)
                    break
                except subprocess.TimeoutExpired:
                    if stop.exists():
                        process.terminate()
        except BaseException:
            process.terminate()
            raise
        reader.join(5)
        return process.returncode, "".join(said).strip()


def _main() -> int:
    """The command line in a process that stops when its standard input ends, i.e. when its parent is gone."""
    from . import _native

    def watch() -> None:
        while os.read(0, 4096):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True).start()
    return _native.main(["needlebench", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(_main())
