"""Scenarios, clearances, plans and runs against the command line."""

from __future__ import annotations

import csv
import itertools
import json
import os
import signal
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import CommandLine

import needlebench as nb


@pytest.fixture(scope="module")
def table3() -> nb.Scenario:
    return nb.Scenario.load(Path(__file__).resolve().parents[2] / "scenarios/table3.toml")


def postures(count: int) -> Any:
    return np.random.default_rng(5).uniform(-2, 2, (count, 6))


def test_clearances_are_those_of_the_command_line(
    table3: nb.Scenario, command_line: CommandLine, scenarios: Path
) -> None:
    q = postures(4)
    many = table3.clearance(q, pairs=True)
    assert many.pairs is not None
    for row in range(len(q)):
        listed = ",".join(map(repr, q[row].tolist()))
        answer = command_line.json("clearance", scenarios / "table3.toml", f"--joints={listed}")
        one = table3.clearance(q[row], pairs=True)
        assert one.pairs is not None
        assert set(one.classes) == set(answer["classes"])
        for name, found in one.classes.items():
            expected = answer["classes"][name]
            assert found.minimum_m == expected["minimum_m"] == many.classes[name].minimum_m[row]
            assert list(found.pair) == expected["pair"] == list(many.classes[name].pair[row])
            assert found.witness_points_m.tolist() == expected["witness_points_m"]
        pairs = answer["pairs"]
        assert [list(pair) for pair in one.pairs.pair] == [pair["pair"] for pair in pairs]
        assert one.pairs.classes == [pair["class"] for pair in pairs]
        assert one.pairs.distance_m.tolist() == [pair["distance_m"] for pair in pairs]
        assert many.pairs.distance_m[row].tolist() == one.pairs.distance_m.tolist()
        assert [list(each) for each in one.pairs.solids] == [pair["solids"] for pair in pairs]
        assert many.pairs.witness_points_m[row].tolist() == [pair["witness_points_m"] for pair in pairs]


def test_certificates_are_not_refuted_by_sampling(table3: nb.Scenario) -> None:
    way = np.array([table3.start_rad, table3.start_rad + 0.4, table3.start_rad - 0.3])
    proven = table3.certify(way, tolerance_m=1e-5)
    sampled = np.concatenate([a + np.linspace(0, 1, 500)[:, None] * (b - a) for a, b in itertools.pairwise(way)])
    found = table3.clearance(sampled)
    for name, certificate in proven.classes.items():
        least = found.classes[name].minimum_m.min()
        assert certificate.certified_lower_bound_m <= least
        assert certificate.minimum_m - certificate.certified_lower_bound_m <= 1.01e-5
        # Between samples the arm moves by at most 2 mm.
        assert certificate.minimum_m >= least - 2e-3
        again = table3.clearance(certificate.joints_rad).classes[name].minimum_m
        assert again == pytest.approx(certificate.minimum_m, abs=1e-12)


@pytest.mark.parametrize("joints", [[1.0, 2.0], [[0.0] * 6]])
def test_motions_of_one_posture_are_refused(table3: nb.Scenario, joints: Any) -> None:
    with pytest.raises(nb.InputError, match="joints"):
        table3.certify(joints)


def test_a_run_is_that_of_the_command_line(
    table3: nb.Scenario, command_line: CommandLine, scenarios: Path, tmp_path: Path
) -> None:
    run = table3.run(["rapier"], out=tmp_path / "package", pictures=False, page=False)
    document = command_line.json(
        *("run", scenarios / "table3.toml", "--engine", "rapier"),
        *("--out", tmp_path / "program", "--no-pictures", "--no-page", "--quiet"),
    )
    report = json.loads(run.to_json())
    for each in (report, document):
        del each["timings"]
        # Another program made it.
        each["provenance"].pop("git_revision", None)
    assert report == document
    assert run.verdict == "pass" and run.check() is run
    # The same files, with the same bytes.
    names = sorted(path.relative_to(tmp_path / "program") for path in (tmp_path / "program").rglob("*.csv"))
    assert names
    for name in names:
        assert (tmp_path / "package" / name).read_bytes() == (tmp_path / "program" / name).read_bytes()
    best = run["pose"].recommended
    assert best is not None and best.label == document["goals"][0]["recommended"]["label"]
    held_against_csv(best, tmp_path / "package" / "table3" / "pose" / f"{best.label}.rapier.csv")


def test_the_reference_integrator_is_asked_by_its_name_and_by_the_old_one(table3: nb.Scenario) -> None:
    asked = table3.run(["rapier"], reference=True)
    with pytest.warns(DeprecationWarning, match="`referee` is now `reference`"):
        as_before = table3.run(["rapier"], referee=True)
    report, before = json.loads(asked.to_json()), json.loads(as_before.to_json())
    for each in (report, before):
        del each["timings"]
    assert report == before
    assert report["goals"][0]["configurations"][0]["referee"]["rapier"]["convergence"]


def held_against_csv(configuration: nb.Configuration, file: Path) -> None:
    recording = configuration.recording
    with file.open() as lines:
        rows = list(csv.DictReader(lines))
    times = np.array([float(row["time_s"]) for row in rows])
    at = np.searchsorted(recording["time_s"], times - 1e-6)
    for joint, name in enumerate(["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]):
        for column, key in [
            ("position_rad", "position_rad"),
            ("velocity_rad_s", "velocity_rad_s"),
            ("reference_rad", "reference_position_rad"),
        ]:
            printed = np.array([float(row[f"{name}_{column}"]) for row in rows])
            # Twelve digits after the point are printed.
            assert np.abs(recording[key][at, joint] - printed).max() <= 0.51e-12
    flange = recording["flange_in_world"]["position_m"][at]
    printed = np.array([[float(row[f"flange_{axis}_m"]) for axis in "xyz"] for row in rows])
    assert np.abs(flange - printed).max() <= 0.51e-12


def test_a_plan_has_motions_and_judges_nothing(table3: nb.Scenario) -> None:
    plan = table3.plan()
    goal = plan["pose"]
    assert len(goal) == 8 and len(goal.planned) == 6
    for configuration in goal.planned:
        motion = configuration.motion()
        duration = configuration.duration_s()
        assert duration is not None and motion["time_s"][-1] == duration
        assert motion["position_rad"][0] == pytest.approx(table3.start_rad, abs=1e-12)
        assert configuration.joints_rad is not None
        assert motion["position_rad"][-1] == pytest.approx(configuration.joints_rad, abs=1e-9)
        # What is said to be the velocity is that of the positions, by central differences of a jerk-limited motion.
        times = motion["time_s"][:-1]
        slope = np.gradient(motion["position_rad"][:-1], times, axis=0)
        assert np.abs(slope - motion["velocity_rad_s"][:-1])[1:-1].max() < 2e-3
        assert "status" not in configuration.report
        back = configuration.motion(retreat=True)
        assert back["position_rad"][-1] == pytest.approx(table3.start_rad, abs=1e-9)
    rejected = goal["Left-Up-Unfold"]
    assert rejected.status == "rejected" and rejected.rejections[0]["rule"] == "needle_corridor"


def test_exports_are_those_of_the_program(
    table3: nb.Scenario, command_line: CommandLine, scenarios: Path, tmp_path: Path
) -> None:
    for made, options in [("cell.urdf", ["urdf"]), ("way.script", ["urscript"])]:
        (tmp_path / "package").mkdir(exist_ok=True)
        (tmp_path / "program").mkdir(exist_ok=True)
        files = table3.export(options[0], tmp_path / "package" / made)
        other = command_line.json(
            "export", scenarios / "table3.toml", "--as", *options, "--out", tmp_path / "program" / made
        )
        assert [each["sha256"] for each in files] == [each["sha256"] for each in other["files"]]
        assert (tmp_path / "package" / made).read_bytes() == (tmp_path / "program" / made).read_bytes()
    with pytest.raises(nb.InputError, match="Left-Up-Unfold"):
        table3.export("urscript", tmp_path / "x.script", configuration="Left-Up-Unfold")


def test_wrong_scenarios_have_the_lines_and_hints_of_the_command_line(
    command_line: CommandLine, scenarios: Path, tmp_path: Path
) -> None:
    text = (scenarios / "table3.toml").read_text()
    file = tmp_path / "wrong.toml"
    file.write_text(text.replace("[robot]", "[robot]\nbase_rpy_degrees = [0, 0, 0]", 1))
    with pytest.raises(nb.InputError) as raised:
        nb.Scenario.load(file)
    told = command_line("check", file, status=2).stderr
    assert str(raised.value).strip() == told.strip()
    (finding,) = raised.value.findings
    assert finding.file == str(file) and finding.line and "base_rpy_degrees" in str(finding)
    assert finding.hint and finding.hint in told


def test_unknown_engines_and_files_are_refused(table3: nb.Scenario) -> None:
    with pytest.raises(nb.InputError, match="there is no engine `bullet`"):
        table3.run(["bullet"])
    with pytest.raises(nb.InputError, match="recordings as `bag`"):
        table3.run(record="bag")
    with pytest.raises(nb.InputError, match=r"nowhere\.toml"):
        nb.Scenario.load("nowhere.toml")
    with pytest.raises(KeyError):
        table3.plan()["no such goal"]


def test_criteria_that_are_missed_are_raised_on_request(scenarios: Path, tmp_path: Path) -> None:
    text = (scenarios / "table3.toml").read_text()
    file = tmp_path / "strict.toml"
    file.write_text(text.replace("[criteria]", "[criteria]\nmin_working_configurations = 8", 1))
    assert "min_working_configurations = 8" in file.read_text()
    run = nb.Scenario.load(file).run(["rapier"])
    assert run.verdict == "fail"
    with pytest.raises(nb.CriterionFailed, match="min_working_configurations") as raised:
        run.check()
    assert raised.value.status == 1


def test_progress_is_told_and_what_it_raises_ends_the_run(table3: nb.Scenario) -> None:
    told: list[tuple[str, int, int]] = []
    table3.run(["rapier"], progress=lambda message, done, total: told.append((message, done, total)))
    assert told and told[-1][1] == told[-1][2] > 0

    class Enough(Exception):
        pass

    def raising(*_: object) -> None:
        raise Enough

    with pytest.raises(Enough):
        table3.run(["rapier"], progress=raising)


def test_an_interrupt_keeps_what_is_finished(scenarios: Path) -> None:
    suite = nb.Scenario.load(scenarios / "supine_suite.toml")

    def interrupt() -> None:
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(1.0, interrupt)
    timer.start()
    with pytest.raises(nb.Interrupted) as raised:
        suite.run(["rapier"], jobs=1)
    timer.join()
    assert isinstance(raised.value, KeyboardInterrupt) and raised.value.status == 130
    assert isinstance(raised.value.result, nb.Run)
    assert any("interrupted" in note for note in raised.value.result.report["notes"])
