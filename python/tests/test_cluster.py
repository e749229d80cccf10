"""Studies on the workers of Dask: the same table as in one process, whatever happens to workers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import needlebench as nb
from needlebench import _cluster

SHARDS = 4


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    distributed: Any = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture
def small(scenarios: Path, tmp_path: Path) -> Path:
    file = tmp_path / "small study.toml"
    file.write_text(
        f"""
name = "small"
scenario = "{scenarios / "studies/chest.toml"}"
goals = ["right_upper_anterior"]
mode = "static"
replanned_cases = 2
[sampling]
samples = 16
[[factors]]
name = "along"
key = "phantom.position_mm[0]"
range = [-40, 40]
relative = true
[[factors]]
name = "size"
key = "phantom.model"
values = ["female-p5-supine", "male-p50-supine"]
"""
    )
    return file


def test_the_table_has_the_bytes_of_one_process(client: Any, small: Path, tmp_path: Path) -> None:
    whole = nb.study(small, out=tmp_path / "whole", page=False)
    told: list[tuple[str, int, int]] = []

    def tell(message: str, done: int, total: int) -> None:
        told.append((message, done, total))

    found = nb.study(
        small,
        out=tmp_path / "dask",
        client=client,
        shards=SHARDS,
        page=False,
        csv=True,
        progress=tell,
    )
    assert found.path.read_bytes() == whole.path.read_bytes()
    assert found.summary == whole.summary
    assert (found.folder / "results.csv").exists()
    assert ("shards", SHARDS, SHARDS) in told
    # What is there is found by a call that does not say how many shards there are.
    again = nb.study(small, out=tmp_path / "dask", client=client, page=False)
    assert again.path.read_bytes() == whole.path.read_bytes()
    assert sorted(each.name for each in (tmp_path / "dask/small/shards").iterdir()) == ["1", "2", "3", "4"]


def test_what_is_wrong_has_the_class_of_its_exit_status(client: Any, small: Path, tmp_path: Path) -> None:
    with pytest.raises(nb.InputError, match="1 to 32"):
        nb.study(small, out=tmp_path, client=client, shards=33)
    with pytest.raises(nb.InputError, match="requires a client"):
        nb.study(small, out=tmp_path, shards=2)
    nb.study(small, out=tmp_path / "dask", client=client, shards=2, page=False)
    # Another number of shards in the same folders.
    with pytest.raises(nb.InputError, match=r"holds shard ([12])/2 of this study, not shard \1/3"):
        nb.study(small, out=tmp_path / "dask", client=client, shards=3)
    small.write_text(small.read_text().replace("samples = 16", "samples = 0"))
    with pytest.raises(nb.InputError, match="samples"):
        nb.study(small, out=tmp_path, client=client)


def test_an_interrupt_stops_all_shards_and_the_next_call_goes_on(client: Any, scenarios: Path, tmp_path: Path) -> None:
    layouts = scenarios / "studies/layouts.toml"
    shards = tmp_path / "layouts/shards"

    def interrupt() -> None:
        while not any(journal.stat().st_size > 20_000 for journal in shards.glob("*/layouts/journal.nbj")):
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    interrupter = threading.Thread(target=interrupt)
    interrupter.start()
    with pytest.raises(nb.Interrupted, match="call again to resume"):
        nb.study(layouts, out=tmp_path, client=client, shards=SHARDS, page=False)
    interrupter.join()
    status = nb.command("study", layouts, status=shards).data
    # Nobody writes any more, and what was computed is there.
    assert status["running"] == [] and status["done"] > 0
    assert not list(shards.glob(".stop-*"))


def test_a_shard_stops_when_whoever_started_it_is_gone(scenarios: Path, tmp_path: Path) -> None:
    layouts = scenarios / "studies/layouts.toml"
    program = [sys.executable, "-m", "needlebench._cluster", "study", str(layouts), "--shard=1/4"]
    with subprocess.Popen([*program, f"--out={tmp_path}", "--yes", "--quiet"], stdin=subprocess.PIPE) as shard:
        journal = tmp_path / "layouts/journal.nbj"
        deadline = time.monotonic() + 60
        while not journal.exists() or journal.stat().st_size < 2000:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert shard.stdin
        shard.stdin.close()
        assert shard.wait(60) == nb.Interrupted.status


def test_what_may_pass_is_asked_for_again(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_cluster, "RESTARTS", 2)
    ends = [(3, "another process is writing here"), (-9, ""), (0, "")]

    def watched(command_line: list[str], _stop: Path) -> tuple[int, str]:
        assert "--resume" in command_line and "--shard=2/4" in command_line
        return ends.pop(0)

    monkeypatch.setattr(_cluster, "_watched", watched)

    def sleep(_: float) -> None:
        pass

    monkeypatch.setattr(_cluster.time, "sleep", sleep)
    shard = (str(small), 2, 4, str(tmp_path / "2"), str(tmp_path / "stop"), ["--jobs=1"])
    assert _cluster.compute_shard(*shard) == 0
    ends[:] = [(3, "another process is writing here")] * 3
    with pytest.raises(nb.EnvironmentFailed, match="another process"):
        _cluster.compute_shard(*shard)
    ends[:] = [(2, "is of another study")]
    with pytest.raises(nb.InputError, match="another study"):
        _cluster.compute_shard(*shard)
