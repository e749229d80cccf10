"""Runs the checks of `.ci/checks.toml`.

    .ci/run                all of quick and commit, and of the evidence what does not hold at this tree
    .ci/run --all          everything
    .ci/run NAME...        single checks, or all of a tier by its name
    .ci/run --list         each check: whether it holds at this tree, and why not
    .ci/run --figures      writes the figures of the evidence into README and guide (--check: looks only)

Evidence that passes is recorded in .ci/evidence.lock, to be committed with the change.
"""

from __future__ import annotations

import argparse
import datetime
import math
import os
import platform
import re
import subprocess
import sys
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from . import checks, documents, environments, records, trace
from .checks import TIERS, Check, target_folder
from .tree import TOP, MistakeError

# Lines of a check that failed, shown at the end of it.
SHOWN_LINES = 60
SIDE_BY_SIDE = 2
# What checks print of themselves: `figure NAME VALUE` for documents, `mark NAME VALUE` for what is not to grow.
FIGURE = re.compile(r"^figure ([\w.]+) (\S+)$", re.MULTILINE)
MARK = re.compile(r"^mark ([\w.-]+) (\S+)$", re.MULTILINE)
WORSE = 1.1
# Exit status of a check that could not ask what it is to ask, as a database that cannot be reached. It did not fail and
# it did not pass; with NEEDLEBENCH_CI_COMPLETE=1 that is a failure.
NOT_JUDGED = 75


def say(*words: str) -> None:
    print(*words, flush=True)


@dataclass
class Outcome:
    """What became of a check or a build."""

    name: str
    failure: str = ""
    not_judged: str = ""
    seconds: float = 0.0
    cpu_seconds: float = 0.0


class Run:
    """One call of `.ci/run`."""

    def __init__(self, *, tracing: bool, because: str = "") -> None:
        self.because = because
        self.began = time.monotonic()
        self.tracing = tracing and trace.is_there()
        self.logs = target_folder() / "ci/logs"
        self.logs.mkdir(parents=True, exist_ok=True)
        self.results = target_folder() / "ci/results"
        self.results.mkdir(parents=True, exist_ok=True)
        self.built: dict[str, Outcome] = {}
        self.building = threading.Lock()
        self.records = records.read()
        self.outcomes: list[Outcome] = []

    def variables(self, check: Check | None) -> dict[str, str]:
        release = target_folder() / "release"
        given = {
            **os.environ,
            "CARGO_TERM_COLOR": "never",
            # Everything is compiled once.
            "CARGO_INCREMENTAL": os.environ.get("CARGO_INCREMENTAL", "0"),
            "UV_SYSTEM_CERTS": "1",
            "UV": environments.uv() or "" if check and check.environments else "",
            "TARGET": str(target_folder()),
            "PROGRAM": str(release / "needlebench"),
            "PROGRAMS": str(release),
            "RESULTS": str(self.results),
        }
        for name in check.environments if check else ():
            given[name.upper()] = str(environments.root() / name / "bin")
        return given

    def prepare(self, check: Check) -> str:
        """Environments and builds that a check needs; says what is wrong."""
        with self.building:
            for name in check.environments:
                environments.prepared(name)
            for name in check.builds:
                if name not in self.built:
                    say(f"  building {name}")
                    self.built[name] = self.command(f"build-{name}", checks.builds()[name].run, None)
                    self.built[name].name = name
                    say(f"  built {name}, {self.built[name].seconds:.0f} s")
                if self.built[name].failure:
                    return f"build {name}: {self.built[name].failure}"
        return ""

    def command(self, name: str, script: str, check: Check | None) -> Outcome:
        log = self.logs / f"{name}.log"
        opened = self.logs / f"{name}.opened"
        command = ["bash", "-euo", "pipefail", "-c", script]
        if check is not None and self.traces(check):
            command = trace.traced(command, opened)
        start = time.monotonic()
        with log.open("w") as out:
            child = subprocess.Popen(
                command, cwd=TOP, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT,
                env=self.variables(check),
            )  # fmt: skip
            _, status, used = os.wait4(child.pid, 0)
        child.returncode = status = os.waitstatus_to_exitcode(status)
        failure = f"exit status {status}" if status else ""
        outcome = Outcome(name, failure, seconds=time.monotonic() - start, cpu_seconds=used.ru_utime + used.ru_stime)
        if status == NOT_JUDGED and check is not None and not os.environ.get("NEEDLEBENCH_CI_COMPLETE"):
            lines = log.read_text(errors="replace").splitlines()
            outcome.failure, outcome.not_judged = "", lines[-1] if lines else "it says nothing"
        return outcome

    def traces(self, check: Check) -> bool:
        return self.tracing and check.tier == "evidence" and not check.untraced

    def one(self, check: Check) -> Outcome:
        """Prepares, runs, looks at figures and at what was opened, records."""
        try:
            failure = self.prepare(check)
        except MistakeError as error:
            failure = str(error)
        outcome = Outcome(check.name, failure) if failure else self.command(check.name, check.run, check)
        if not outcome.failure and not outcome.not_judged:
            try:
                self.accept(check, outcome)
            except MistakeError as error:
                outcome.failure = str(error)
        word = "FAILED" if outcome.failure else "NOT JUDGED" if outcome.not_judged else "passed"
        at = f"{time.monotonic() - self.began:.0f} s"
        say(f"{word} {check.name:<22} {outcome.seconds:7.1f} s  (at {at})  {check.title}")
        if outcome.not_judged:
            say(f"    {outcome.not_judged}")
        if outcome.failure:
            self.explain(check, outcome)
        return outcome

    def accept(self, check: Check, outcome: Outcome) -> None:
        figures = self.figures(check)
        marks, bars = self.marks(check)
        if self.traces(check):
            beyond = trace.beyond_inputs(check, self.logs / f"{check.name}.opened")
            (self.logs / f"{check.name}.opened").unlink()
            if beyond:
                listed = "\n  ".join(beyond[:20])
                raise MistakeError(f"it opens what is not among its inputs in .ci/checks.toml:\n  {listed}")
        records.stamp(check, outcome.seconds)
        if check.tier == "evidence":
            record = records.Record(
                check=check.name,
                inputs_sha256=check.digest,
                date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
                machine=machine(),
                seconds=round(outcome.seconds, 1),
                traced=self.traces(check),
                figures=figures,
                marks=marks,
                bars=bars,
                because=self.because,
                groups=check.group_digests(),
            )
            with self.building:
                records.write({check.name: record}, set(checks.checks()))

    def printed(self, check: Check) -> str:
        return (self.logs / f"{check.name}.log").read_text(errors="replace")

    def figures(self, check: Check) -> dict[str, float]:
        """Those that the check printed as such, and the largest of those that its patterns find."""
        text = self.printed(check)
        found: dict[str, float] = {}
        for name, value in FIGURE.findall(text):
            found[name] = max(float(value), found.get(name, -math.inf))
        for name, words in check.figures.items():
            matches = re.findall(words, text, re.MULTILINE)
            if not matches:
                raise MistakeError(f"it printed nothing that figure `{name}` ({words}) could be taken from")
            found[name] = max(float(each) for each in matches)
        return found

    def marks(self, check: Check) -> tuple[dict[str, float], dict[str, float]]:
        """Sizes and counts that are not to grow unnoticed, and the smallest of each that was on record.

        One that is a tenth above what was on record fails, unless the record is to say why.
        """
        seen = {name: float(value) for name, value in MARK.findall(self.printed(check))}
        before = self.records.get(check.name)
        known = before.bars if isinstance(before, records.Record) else {}
        worse = [
            f"{name} is {value:.6g}, on record {known[name]:.6g}"
            for name, value in seen.items()
            if name in known and value > known[name] * WORSE
        ]
        if worse and not self.because:
            raise MistakeError(
                f"more than a tenth worse: {'; '.join(worse)}. Mend it, or say why in the record: "
                f".ci/run {check.name} --because '...'"
            )
        bars = {name: value if self.because else min(value, known.get(name, value)) for name, value in seen.items()}
        # What could not be measured this time keeps what was on record.
        before_marks = before.marks if isinstance(before, records.Record) else {}
        return before_marks | seen, known | bars

    def explain(self, check: Check, outcome: Outcome) -> None:
        build = re.match(r"build (\S+):", outcome.failure)
        log = self.logs / (f"build-{build[1]}.log" if build else f"{check.name}.log")
        if log.exists() and ("exit status" in outcome.failure):
            lines = log.read_text(errors="replace").splitlines()
            say(f"--- the last lines of {log.relative_to(TOP) if log.is_relative_to(TOP) else log}")
            say(*(f"    {line}\n" for line in lines[-SHOWN_LINES:]))
        say(f"error: {check.name}: {outcome.failure}")
        say(f"to see it alone: .ci/run {check.name}")

    def tier(self, chosen: list[Check]) -> bool:
        """Checks of one tier, side by side where they may be; whether all passed."""
        together = [each for each in chosen if not each.alone]
        done: dict[str, Future[Outcome]] = {}

        def after_others(check: Check) -> Outcome:
            # Named earlier in the file, and so begun before.
            for name in check.after:
                if name in done and done[name].result().failure:
                    return Outcome(check.name, f"needs {name}")
            return self.one(check)

        outcomes = []
        side_by_side = SIDE_BY_SIDE if together and together[0].tier != "commit" else 1
        with ThreadPoolExecutor(side_by_side) as pool:
            for check in together:
                done[check.name] = pool.submit(after_others, check)
            outcomes = [each.result() for each in done.values()]
        outcomes += [self.one(check) for check in chosen if check.alone]
        self.outcomes += outcomes
        return not any(each.failure for each in outcomes)


def machine() -> str:
    """The processor and how many of it."""
    try:
        model = re.search(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        model = None
    return f"{model[1].strip() if model else platform.machine()}, {os.cpu_count()} cores"


def chosen(names: list[str]) -> list[Check]:
    known = checks.checks()
    found: dict[str, Check] = {}
    for name in names:
        if name in TIERS:
            found |= {each.name: each for each in known.values() if each.tier == name}
        elif name in known:
            found[name] = known[name]
        else:
            raise MistakeError(f"there is no check `{name}`; .ci/run --list names them")
    return [each for each in known.values() if each.name in found]


def with_what_they_read(selected: list[Check]) -> list[Check]:
    """And before each check those whose results it reads, where they are not there."""
    names = {each.name for each in selected}
    open_ends = list(selected)
    while open_ends:
        for name in open_ends.pop().after:
            if name not in names:
                names.add(name)
                open_ends.append(checks.checks()[name])
    return [each for each in checks.checks().values() if each.name in names]


def listing() -> None:
    known = records.read()
    for check in checks.checks().values():
        holds, why = records.state(check, known)
        say(f"{check.tier:<8} {check.name:<22} {'holds' if holds else 'to run':<6} {why}")


def main() -> int:
    parser = argparse.ArgumentParser(
        prog=".ci/run", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="a check, or a tier: quick, commit, evidence")
    parser.add_argument("--all", action="store_true", help="evidence that holds is made anew, too")
    parser.add_argument("--list", action="store_true", help="say which checks hold at this tree")
    parser.add_argument("--figures", action="store_true", help="write figures of the evidence into the documents")
    parser.add_argument("--check", action="store_true", help="with --figures: fail where they are not current")
    parser.add_argument("--because", default="", metavar="WHY", help="why marks grow: goes into the records")
    parser.add_argument("--no-trace", action="store_true", help="do not look at what checks open")
    options = parser.parse_args()
    os.chdir(TOP)
    if options.list:
        listing()
        return 0
    if options.figures:
        return documents.update(look_only=options.check)

    if options.because and not options.names:
        parser.error("--because goes with the names of the checks whose marks are to grow")
    run = Run(tracing=not options.no_trace, because=options.because)
    if options.names:
        selected = chosen(options.names)
        needed = with_what_they_read(selected)
    else:
        selected = list(checks.checks().values())
        if not options.all:
            selected = [e for e in selected if e.tier != "evidence" or not records.state(e, run.records)[0]]
        needed = with_what_they_read(selected)
        held = len(checks.checks()) - len(needed)
        say(f"{len(needed)} checks to run; {held} hold by their records (.ci/run --list)")
    # What is wrong in the list of checks is said before anything runs.
    for check in needed:
        _ = check.digest
    passed = True
    for tier in TIERS:
        of_tier = [each for each in needed if each.tier == tier]
        if of_tier and passed:
            passed = run.tier(of_tier)
    return summary(run, passed)


def summary(run: Run, passed: bool) -> int:
    failed = [each.name for each in run.outcomes if each.failure]
    slowest = sorted([*run.outcomes, *run.built.values()], key=lambda each: -each.seconds)[:10]
    say("slowest: " + ", ".join(f"{each.name} {each.seconds:.0f} s" for each in slowest))
    if not passed:
        say(f"FAILED: {', '.join(failed)}; to see them alone: .ci/run {' '.join(failed)}")
        return 1
    not_judged = [each.name for each in run.outcomes if each.not_judged]
    if not_judged:
        say(f"NOT JUDGED: {', '.join(not_judged)}")
    count = len(run.outcomes) - len(not_judged)
    say(f"all {count} checks that were judged passed in {time.monotonic() - run.began:.0f} s")
    if any(checks.checks()[each.name].tier == "evidence" for each in run.outcomes):
        say("new records are in .ci/evidence.lock: commit it with the change")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except MistakeError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
