"""Tests of the checks' runner, in a copy of the checkout: python3 .ci/test_runner.py

That a byte changed in any input makes a check stale, and a file added to a crate; that a record that was edited, a mark
that got worse and a file that is opened without being an input are found.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
# Groups that are no files: an entry of the list of checks, a part of the lock file.
DIGESTS = """
import json, sys
from runner import checks
told = {}
for name, check in checks.checks().items():
    groups = {group: sorted(paths) for group, paths in check.inputs.items()}
    told[name] = {"digest": check.digest, "groups": groups}
print(json.dumps(told))
"""
# A check of its own for what real ones take minutes to show.
SMALL = """
[checks.small]
title = "a check for tests"
tier = "evidence"
files = ["models/README.md"]
run = '''
{run}
'''
"""


class Copy(unittest.TestCase):
    """A copy of the checkout, in which each test finds everything as it was."""

    folder: tempfile.TemporaryDirectory
    top: Path

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        cls.top = Path(cls.folder.name).resolve() / "checkout"
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=TOP, check=True, stdout=subprocess.PIPE, text=True,
        ).stdout  # fmt: skip
        for name in filter(None, listed.split("\0")):
            source, copy = TOP / name, cls.top / name
            if source.is_symlink() or source.is_file():
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source, copy, follow_symlinks=False)
        subprocess.run(["git", "init", "--quiet"], cwd=cls.top, check=True)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()

    def setUp(self) -> None:
        self.undo: list[tuple[Path, bytes | None]] = []
        (self.top / ".ci/evidence.lock").unlink(missing_ok=True)

    def tearDown(self) -> None:
        for path, before in reversed(self.undo):
            if before is None:
                path.unlink()
            else:
                path.write_bytes(before)

    def put(self, name: str, data: bytes) -> None:
        path = self.top / name
        self.undo.append((path, path.read_bytes() if path.exists() else None))
        path.write_bytes(data)

    def digests(self) -> dict:
        told = self.python("-c", DIGESTS)
        self.assertEqual(told.returncode, 0, told.stderr)
        return json.loads(told.stdout)

    def python(self, *words: str) -> subprocess.CompletedProcess:
        environment = {**os.environ, "PYTHONPATH": str(self.top / ".ci"), "CARGO_TARGET_DIR": str(self.top / "target")}
        return subprocess.run(
            [sys.executable, *words], cwd=self.top, env=environment, capture_output=True, text=True, check=False
        )

    def run_checks(self, *words: str) -> subprocess.CompletedProcess:
        return self.python("-m", "runner", *words)

    def small(self, script: str) -> None:
        text = (TOP / ".ci/checks.toml").read_text() + SMALL.format(run=script)
        self.put(".ci/checks.toml", text.encode())

    def state(self) -> str:
        listed = self.run_checks("--list")
        self.assertEqual(listed.returncode, 0, listed.stderr)
        [line] = [line for line in listed.stdout.splitlines() if " small " in line]
        return line


class Inputs(Copy):
    """What checks depend on."""

    def test_a_byte_changed_in_any_group_of_inputs_is_seen_by_the_checks_that_have_it_and_by_no_other(self) -> None:
        before = self.digests()
        tried: dict[str, set[str]] = {}
        for check in before.values():
            for group, paths in check["groups"].items():
                files = [path for path in paths if (self.top / path).is_file() and not (self.top / path).is_symlink()]
                if files and group not in ("Cargo.lock", "**"):
                    tried.setdefault(files[len(files) // 2], set())
        for path in list(tried)[:: max(1, len(tried) // 20)]:
            having = {name for name, check in before.items() if any(path in each for each in check["groups"].values())}
            # Formats that the runner reads itself take a blank, and nothing else does harm to.
            self.put(path, (self.top / path).read_bytes() + b"\n")
            after = self.digests()
            changed = {name for name in before if before[name]["digest"] != after[name]["digest"]}
            self.tearDown()
            self.undo.clear()
            through = {name for name in changed if any(g.startswith("check ") for g in before[name]["groups"])}
            self.assertLessEqual(having, changed, path)
            self.assertLessEqual(changed - through, having, path)

    def test_a_file_added_to_a_crate_makes_every_check_stale_that_is_built_from_it(self) -> None:
        before = self.digests()
        self.put("crates/geometry/src/nobody_told.rs", b"//! New.\n")
        after = self.digests()
        changed = {name for name in before if before[name]["digest"] != after[name]["digest"]}
        built = {name for name, check in before.items() if "crates/geometry" in check["groups"]}
        self.assertIn("coal", built)
        self.assertLessEqual(built, changed)
        self.assertNotIn("workflows", changed)

    def test_tests_of_a_crate_are_no_inputs_of_what_is_built_from_it(self) -> None:
        before = self.digests()
        self.put("crates/geometry/tests/nobody_told.rs", b"//! New.\n")
        after = self.digests()
        self.assertEqual(before["coal"]["digest"], after["coal"]["digest"])
        self.assertNotEqual(before["tests"]["digest"], after["tests"]["digest"])

    def test_an_entry_of_the_lock_file_concerns_what_is_built_with_it(self) -> None:
        before = self.digests()
        lock = (self.top / "Cargo.lock").read_text()
        [checksum] = re.findall(r'name = "axum"\nversion = ".*"\nsource = ".*"\nchecksum = "(\w+)"', lock)
        self.put("Cargo.lock", lock.replace(checksum, checksum[::-1]).encode())
        after = self.digests()
        self.assertEqual(before["coal"]["digest"], after["coal"]["digest"], "cells need no server")
        self.assertNotEqual(before["planning-page"]["digest"], after["planning-page"]["digest"])

    def test_an_input_that_is_not_there_is_a_mistake(self) -> None:
        self.small("true")
        text = (self.top / ".ci/checks.toml").read_text()
        self.put(".ci/checks.toml", text.replace('files = ["models/README.md"]', 'files = ["models/README"]').encode())
        told = self.run_checks("small")
        self.assertEqual(told.returncode, 2)
        self.assertIn("`models/README` names no file", told.stderr)


class Records(Copy):
    """What becomes of a check that ran."""

    def test_evidence_holds_until_a_byte_of_an_input_changes(self) -> None:
        self.small("cat models/README.md > /dev/null; echo worst 2.5 nm; echo worst 1.5 nm; echo figure other 3")
        text = (self.top / ".ci/checks.toml").read_text()
        with_figure = text.replace(
            'files = ["models/README.md"]', "files = [\"models/README.md\"]\nfigures.worst_nm = 'worst (.*) nm'"
        )
        self.put(".ci/checks.toml", with_figure.encode())
        self.assertIn("to run has no record", self.state())
        told = self.run_checks("small")
        self.assertEqual(told.returncode, 0, told.stdout + told.stderr)
        self.assertIn("holds  recorded", self.state())
        [line] = (self.top / ".ci/evidence.lock").read_text().splitlines()[1:]
        self.assertEqual(json.loads(line)["figures"], {"other": 3.0, "worst_nm": 2.5})
        self.put("models/README.md", (self.top / "models/README.md").read_bytes() + b" ")
        self.assertIn("to run changed: models/README.md", self.state())

    def test_a_figure_that_a_document_takes_from_a_record_is_no_input(self) -> None:
        text = (self.top / "models/README.md").read_bytes()
        self.put("models/README.md", text + b"<!-- small.worst_nm .1f -->?<!-- -->")
        self.small("cat models/README.md > /dev/null")
        self.assertEqual(self.run_checks("small").returncode, 0)
        self.put("models/README.md", text + b"<!-- small.worst_nm .1f -->2.5<!-- -->")
        self.assertIn(" holds ", self.state())
        self.put("models/README.md", text + b"<!-- small.worst_nm .1f -->2.5<!-- --> nm")
        self.assertIn("to run changed: models/README.md", self.state())

    def test_a_record_that_was_edited_is_no_record(self) -> None:
        self.small("echo figure apart 3")
        self.assertEqual(self.run_checks("small").returncode, 0)
        lock = self.top / ".ci/evidence.lock"
        lock.write_text(lock.read_text().replace('"apart": 3.0', '"apart": 1.0'))
        self.assertIn("to run its record (.ci/evidence.lock:2) was edited by hand", self.state())
        told = self.run_checks("--figures", "--check")
        self.assertNotEqual(told.returncode, 0)
        self.assertIn("edited by hand", told.stderr)

    def test_a_check_that_fails_is_not_recorded_and_says_what_to_type(self) -> None:
        self.small("echo the reason; exit 3")
        told = self.run_checks("small")
        self.assertEqual(told.returncode, 1)
        self.assertIn("the reason", told.stdout)
        self.assertIn("to see it alone: .ci/run small", told.stdout)
        self.assertIn("to run has no record", self.state())

    def test_a_figure_that_is_not_printed_is_a_failure(self) -> None:
        self.small("true")
        text = (self.top / ".ci/checks.toml").read_text()
        self.put(
            ".ci/checks.toml",
            text.replace('files = ["models/README.md"]', "files = []\nfigures.lost = 'lost (.*)'").encode(),
        )
        told = self.run_checks("small")
        self.assertEqual(told.returncode, 1)
        self.assertIn("figure `lost`", told.stdout)

    def test_a_mark_that_is_a_tenth_worse_fails_unless_the_record_says_why(self) -> None:
        self.small("echo mark bytes $(wc -c < models/README.md)")
        self.assertEqual(self.run_checks("small").returncode, 0)
        before = (self.top / "models/README.md").read_bytes()
        self.put("models/README.md", before + b" " * (len(before) // 20))
        self.assertEqual(self.run_checks("small").returncode, 0, "a twentieth is none")
        self.put("models/README.md", before + b" " * (len(before) // 8))
        told = self.run_checks("small")
        self.assertEqual(told.returncode, 1, "twice a little is held against the least on record")
        self.assertIn("more than a tenth worse: bytes is", told.stdout)
        self.assertEqual(self.run_checks("small", "--because", "it has more to say").returncode, 0)
        [line] = (self.top / ".ci/evidence.lock").read_text().splitlines()[1:]
        self.assertEqual(json.loads(line)["because"], "it has more to say")
        self.assertEqual(json.loads(line)["bars"], json.loads(line)["marks"])

    @unittest.skipUnless(shutil.which("strace"), "programs cannot be traced here")
    def test_a_check_that_opens_what_is_not_its_input_fails(self) -> None:
        self.small("cat models/README.md > /dev/null; (cd scenarios && cat table3.toml > /dev/null)")
        told = self.run_checks("small")
        self.assertEqual(told.returncode, 1)
        self.assertIn("it opens what is not among its inputs in .ci/checks.toml:\n  scenarios/table3.toml", told.stdout)

    @unittest.skipUnless(shutil.which("strace"), "programs cannot be traced here")
    def test_what_git_compares_with_its_index_is_not_opened(self) -> None:
        index = ["git", "-C", str(self.top)]
        subprocess.run([*index, "add", "scenarios/table3.toml"], check=True)
        self.addCleanup(subprocess.run, [*index, "rm", "--quiet", "--cached", "scenarios/table3.toml"], check=True)
        # As its time is not what the index says, its content is looked at.
        os.utime(self.top / "scenarios/table3.toml", (1, 1))
        self.small("GIT_OPTIONAL_LOCKS=0 git status --porcelain --untracked-files=no")
        told = self.run_checks("small")
        self.assertEqual(told.returncode, 0, told.stdout)

    def test_a_name_that_no_check_has_is_said(self) -> None:
        told = self.run_checks("smal")
        self.assertEqual(told.returncode, 2)
        self.assertIn("there is no check `smal`", told.stderr)


if __name__ == "__main__":
    unittest.main()
