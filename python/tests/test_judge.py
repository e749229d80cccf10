"""Motions and answers of others, judged in process as on the command line."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import CommandLine

import needlebench as nb


@pytest.fixture(scope="module")
def table3() -> nb.Scenario:
    return nb.Scenario.load(Path(__file__).resolve().parents[2] / "scenarios/table3.toml")


def straight(table3: nb.Scenario, until: float = 1.0) -> tuple[Any, Any]:
    """A straight line of the joints to a feasible configuration, and a stop."""
    end = table3.plan()["pose"]["Right-Up-Fold"].joints_rad
    assert end is not None
    part = np.append(np.linspace(0.0, until, 41), until)
    times = np.append(np.linspace(0.0, 5.0, 41), 6.0)
    return times, table3.start_rad + part[:, None] * (end - table3.start_rad)


def as_csv(path: Path, times: Any, positions: Any) -> None:
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time_s", *nb.JOINT_NAMES])
        rows.writerows(
            [repr(float(time)), *(repr(float(q)) for q in row)] for time, row in zip(times, positions, strict=False)
        )


def without_source(report: dict[str, Any]) -> dict[str, Any]:
    """A report but for what names the file, and the time that it took."""
    report.pop("timings", None)
    report["provenance"].pop("git_revision", None)
    for key in ("file", "sha256", "format"):
        del report["judged"][key]
    return report


def test_a_judged_motion_is_that_of_the_command_line(
    table3: nb.Scenario, command_line: CommandLine, scenarios: Path, tmp_path: Path
) -> None:
    times, positions = straight(table3)
    as_csv(tmp_path / "motion.csv", times, positions)
    expected = command_line.json(
        *("judge", scenarios / "table3.toml", "--motion", tmp_path / "motion.csv", "--engine", "rapier"),
        *("--out", tmp_path / "out", "--no-pictures", "--no-page", "--quiet", "--record", "mcap"),
        status=1,
    )
    run = nb.judge(
        *(table3, times, positions),
        engines=["rapier"],
        out=tmp_path / "package",
        pictures=False,
        page=False,
        record="mcap",
    )
    assert (tmp_path / "package/table3/pose/Right-Up-Fold.rapier.mcap").is_file()
    found = json.loads(run.to_json())
    assert run.verdict == "fail"
    assert list(run["pose"]) == ["Right-Up-Fold"]
    hold = found["judged"]["holds"][0]
    assert hold["label"] == "Right-Up-Fold" and hold["guide_off_m"] < 1e-9
    assert without_source(found) == without_source(expected)
    recording = run["pose"]["Right-Up-Fold"].recording
    assert recording["time_s"][-1] == pytest.approx(6.0, abs=2e-3)


def test_a_motion_to_no_goal_has_its_clearances(table3: nb.Scenario) -> None:
    times, positions = straight(table3, until=0.5)
    with pytest.raises(nb.InputError, match="stands at no goal"):
        nb.judge(table3, times, positions, engines=["rapier"])
    report = nb.judge_free(table3, times, positions)
    failed = [each["criterion"] for each in report["criteria"] if not each["pass"]]
    assert failed == ["joint_acceleration"]
    # Against samples of the line itself, which no certificate may exceed.
    between = positions[0] + np.linspace(0, 1, 400)[:, None] * (positions[-1] - positions[0])
    sampled = table3.clearance(between).classes
    for name in ("robot_phantom", "robot_table", "tool_phantom"):
        least = sampled[name].minimum_m.min()
        assert report["clearance"][name]["certified_lower_bound_m"] <= least + 1e-12
        assert report["clearance"][name]["minimum_m"] == pytest.approx(least, abs=2e-4)


def test_set_points_at_the_controllers_rate_need_no_velocities(table3: nb.Scenario) -> None:
    plan = table3.plan()["pose"]["Right-Up-Fold"]
    duration = plan.duration_s()
    assert duration is not None

    def failed(period: float) -> list[str]:
        times = np.append(np.arange(0.0, duration, period), duration)
        # The last step is as long as the others, or longer.
        times = np.delete(times, -2)
        report = nb.judge_free(table3, times, plan.motion(times)["position_rad"])
        return [each["criterion"] for each in report["criteria"] if not each["pass"]]

    # A UR3 of the CB3 series takes set-points every 8 ms.
    assert failed(0.008) == []
    assert failed(0.04) == ["joint_acceleration"]


def test_answers_are_those_of_the_command_line(
    table3: nb.Scenario, command_line: CommandLine, scenarios: Path, tmp_path: Path
) -> None:
    solved = command_line.json("ik", scenarios / "table3.toml", "--goal", "pose")["solutions"]
    joints = np.array([each["joints_rad"] for each in solved])
    assert nb.judge_answers(table3, joints)["verdict"] == "pass"
    some = joints[[0, 1, 1, 4]]
    some[3, 0] += 1e-3
    np.save(tmp_path / "some.npy", some)
    expected = command_line.json("judge", scenarios / "table3.toml", "--answers", tmp_path / "some.npy", status=1)
    found = nb.judge_answers(table3, some)
    # The bytes of an array in memory are not those of its file.
    for report in (expected, found):
        del report["source"]
    assert found == expected
    defects = [[each["kind"] for each in answer["defects"]] for answer in found["questions"][0]["answers"]]
    assert defects == [[], [], ["double"], ["off"]]
    assert nb.judge_answers(table3, joints[:1], partial=True)["verdict"] == "pass"
    assert nb.judge_answers(table3, joints[:1])["verdict"] == "fail"


def test_wrong_arrays_are_refused(table3: nb.Scenario) -> None:
    times, positions = straight(table3)
    refused: list[tuple[tuple[Any, ...], dict[str, Any], str]] = [
        ((times, positions[:-1]), {}, "41 rows for 42 times"),
        ((times, positions[:, :5]), {}, "it has the shape"),
        ((times[::-1], positions), {}, "not after"),
        ((times / 1000, positions), {}, "jumps by"),
        ((times, np.degrees(positions)), {}, "are these degrees"),
        ((times, positions), {"between": "splines"}, "there is no curve `splines`"),
        ((times, positions), {"between": "cubics"}, "the points have no velocities"),
        ((times, positions), {"goal": "other"}, "the scenario has no goal `other`"),
        ((times, positions), {"engines": ["other"]}, "other"),
    ]
    for arguments, keywords, said in refused:
        with pytest.raises(nb.InputError, match=said):
            nb.judge(table3, *arguments, **keywords)
    positions[3, 2] = np.nan
    with pytest.raises(nb.InputError, match="point 4: elbow_joint is NaN"):
        nb.judge(table3, times, positions)
    with pytest.raises(nb.InputError, match="is no tolerance"):
        nb.judge_answers(table3, positions[:1], tolerance=0.0)
