"""Studies, comparisons and CT volumes, and the command line that the package brings along."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from conftest import CommandLine

import needlebench as nb

STUDY = """
name = "small"
description = "A few layouts."
scenario = "{scenarios}/supine_suite.toml"
seed = 3
mode = "static"

[sampling]
method = "sobol"
samples = 4

[[factors]]
name = "along"
key = "phantom.position_mm[0]"
range = [-40, 40]
relative = true
"""


@pytest.fixture
def small(scenarios: Path, tmp_path: Path) -> Path:
    file = tmp_path / "small.toml"
    file.write_text(STUDY.format(scenarios=scenarios))
    return file


def test_a_study_has_the_bytes_of_the_command_line(small: Path, command_line: CommandLine, tmp_path: Path) -> None:
    found = nb.study(small, out=tmp_path / "package", jobs=2, page=False)
    document = command_line.json("study", small, "--out", tmp_path / "program", "--no-page", "--quiet")
    other = tmp_path / "program" / "small"
    assert found.path.read_bytes() == (other / "results.parquet").read_bytes()
    assert found.summary == document and found.verdict == document["verdict"]
    assert found.case(3) == command_line.json("study", small, "--case", "3")
    rows = found.to_arrow()
    assert rows.num_rows == found.to_polars().height > 0
    with pytest.raises(nb.InputError, match="there is no case"):
        found.case(10**6)


def test_shards_merge_to_the_same_bytes(small: Path, tmp_path: Path) -> None:
    whole = nb.study(small, out=tmp_path / "whole", page=False)
    shards = [nb.study_shard(small, k, 3, out=tmp_path / f"shard{k}") for k in (1, 2, 3)]
    # Asked for again it is there.
    assert nb.study_shard(small, 2, 3, out=tmp_path / "shard2") == shards[1]
    merged = nb.merge(small, shards, out=tmp_path / "merged", page=False)
    assert merged.path.read_bytes() == whole.path.read_bytes()
    with pytest.raises(nb.InputError):
        nb.merge(small, shards[:2], out=tmp_path / "partial", page=False)


def test_an_interrupted_study_goes_on(scenarios: Path, tmp_path: Path) -> None:
    layouts = scenarios / "studies/layouts.toml"
    timer = threading.Timer(3.0, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(nb.Interrupted, match="--resume continues"):
        nb.study(layouts, out=tmp_path, jobs=1, yes=True, page=False)
    timer.join()
    told: list[tuple[str, int, int]] = []

    class Seen(Exception):
        pass

    def first(message: str, done: int, total: int) -> None:
        told.append((message, done, total))
        if done:
            raise Seen

    with pytest.raises(Seen):
        nb.study(layouts, out=tmp_path, jobs=1, resume=True, page=False, progress=first)
    # It did not begin anew.
    assert max(done for _, done, _ in told) > 5


def test_results_are_compared(scenarios: Path, command_line: CommandLine, tmp_path: Path) -> None:
    scenario = nb.Scenario.load(scenarios / "table3.toml")
    for name in ("a", "b"):
        scenario.run(["rapier"], out=tmp_path / name, pictures=False, page=False)
    a, b = tmp_path / "a/table3", tmp_path / "b/table3"
    found = nb.compare(a, b, max_loss={"clearance": "0.5mm"})
    assert found.verdict == "pass" and found.check() is found
    assert found.data == command_line.json("compare", a, b, "--max-loss", "clearance=0.5mm")
    with pytest.raises(nb.InputError, match="no_such_metric"):
        nb.compare(a, b, max_loss={"no_such_metric": 1})


def test_a_scan_becomes_a_patient_with_routes(scenarios: Path, tmp_path: Path) -> None:
    made = nb.ct.synth(
        scenarios / "supine_suite.toml",
        tmp_path / "ct",
        pixels=160,
        preset="thick-overlap",
        markers="ct-sphere",
        no_labels=True,
    )
    assert made["schema_version"]
    volume = tmp_path / "ct/ct.nii.gz"
    about = nb.ct.info(volume)
    assert about["schema_version"]
    told: list[str] = []
    file = nb.ct.build(
        volume,
        tmp_path / "patient",
        lesions={"lower": (-74.0, 37.0, -10.0)},
        thickness_mm=5,
        markers=tmp_path / "ct/marker_list.toml",
        room=scenarios / "supine_suite.toml",
        no_pictures=True,
        progress=lambda message, _done, _total: told.append(message),
    )
    assert told
    patient = nb.Scenario.load(file)
    assert patient.goals
    routes = nb.ct.routes(tmp_path / "patient", lesion="lower", no_pictures=True, out=tmp_path / "routes")
    assert routes["schema_version"]


def test_commands_without_a_wrapper_answer_too(scenarios: Path, command_line: CommandLine) -> None:
    table3 = scenarios / "table3.toml"
    assert nb.command("pairs", table3).data == command_line.json("pairs", table3)
    assert nb.command("check", table3).data == command_line.json("check", table3)
    assert "properties" in nb.command("schema", "scenario", json=False).data
    assert nb.Scenario.load(table3).command("pairs")["schema_version"]
    with pytest.raises(nb.InputError, match="--no-such-option"):
        nb.command("check", table3, no_such_option=True)


def test_the_command_line_is_part_of_the_package(scenarios: Path) -> None:
    module = [sys.executable, "-m", "needlebench"]
    run = subprocess.run([*module, "check", "nowhere.toml"], capture_output=True, text=True, check=False)
    assert run.returncode == 2 and "nowhere.toml" in run.stderr
    script = Path(sys.executable).parent / "needlebench"
    told = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert nb.__version__ in told.stdout
    checked = subprocess.run([script, "check", scenarios / "table3.toml"], capture_output=True, text=True, check=False)
    assert checked.returncode == 0


def test_the_import_is_light() -> None:
    """Nothing is imported that not everybody needs."""
    code = """
import sys, needlebench
print(sorted({name.split(".")[0] for name in sys.modules} & {"numpy", "polars", "pyarrow", "pandas", "inspect"}))
"""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"
