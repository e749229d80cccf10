"""What tests share: the repository's scenarios, and the command line that answers are held against."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Shells start what runs in the background with interrupts ignored, and Python leaves it at that.
signal.signal(signal.SIGINT, signal.default_int_handler)


def program() -> str:
    """The program by itself: that of ``NEEDLEBENCH_PROGRAM``, else the one that the package installs."""
    given = os.environ.get("NEEDLEBENCH_PROGRAM")
    return given or shutil.which("needlebench", path=str(Path(sys.executable).parent)) or "needlebench"


class CommandLine:
    """The command line, as another process."""

    def __call__(self, *arguments: str | Path, status: int = 0) -> subprocess.CompletedProcess[str]:
        done = subprocess.run([program(), *map(str, arguments)], capture_output=True, text=True, check=False, cwd=ROOT)
        assert done.returncode == status, done.stderr
        return done

    def json(self, *arguments: str | Path, status: int = 0) -> Any:
        return json.loads(self(*arguments, "--json", status=status).stdout)


@pytest.fixture(scope="session")
def command_line() -> CommandLine:
    return CommandLine()


@pytest.fixture(scope="session")
def scenarios() -> Path:
    return ROOT / "scenarios"


@pytest.fixture(autouse=True)
def _in_the_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
