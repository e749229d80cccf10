"""What a command opens, by strace: a check may open no file of the checkout that is not among its inputs."""

from __future__ import annotations

import functools
import re
import shutil
import subprocess
from pathlib import Path

from . import tree
from .checks import Check
from .tree import TOP

# `-y` names the file behind the descriptor that came back, however it was opened. Programs in the emulator of another
# processor and those that a server started are followed like all others.
STRACE = ["strace", "--follow-forks", "--seccomp-bpf", "--quiet=all", "--decode-fds=path"]
OPENED = re.compile(r"\b(?:open|openat|openat2)\(.*\) = \d+<([^>]*)>$")
EXECUTED = re.compile(r'\bexecve(?:at)?\(.*?"([^"]*)".* = 0$')
PROCESS = re.compile(r"^(\d+) ")
# git compares with its index what was checked out while the index was written: in a fresh clone, any file of the last
# tick of its clock. It is asked whether something was changed, and what else a file says comes to nothing.
COMPARES = "git"
# Every cargo reads the manifests of all members before it knows which it needs; what they say about the crates of
# others is in the lock file. Linters and git look for what to leave out.
READ_BY_TOOLS = re.compile(
    r"(^|/)(Cargo\.toml|\.gitignore|\.gitattributes)$|^(Cargo\.lock|clippy\.toml|rust-toolchain\.toml)$"
)


@functools.cache
def is_there() -> bool:
    """Whether programs can be traced here: strace may be missing, and containers may forbid it."""
    if not shutil.which("strace"):
        return False
    tried = subprocess.run([*STRACE, "--trace=openat", "--output=/dev/null", "true"], capture_output=True, check=False)
    return tried.returncode == 0


def traced(command: list[str], log: Path) -> list[str]:
    return [*STRACE, "--trace=open,openat,openat2,execve", f"--output={log}", *command]


def opened(log: Path) -> set[str]:
    """Files of the checkout that a traced command opened or executed, by their paths from the top."""
    top = f"{TOP.resolve()}/"
    known = tree.files()
    # A symbolic link is opened as what it leads to.
    found = set()
    comparing: set[str] = set()
    with log.open(errors="replace") as lines:
        for each in lines:
            line = each.rstrip("\n")
            executed = EXECUTED.search(line)
            process = PROCESS.match(line)
            if executed and process:
                (comparing.add if Path(executed[1]).name == COMPARES else comparing.discard)(process[1])
            match = OPENED.search(line) or executed
            if match and match[1].startswith(top) and not (process and process[1] in comparing):
                path = match[1].removeprefix(top)
                if path in known:
                    found.add(path)
    return found


def beyond_inputs(check: Check, log: Path) -> list[str]:
    """What a check opened that it does not say it depends on."""
    paths = check.paths
    return sorted(path for path in opened(log) if path not in paths and not READ_BY_TOOLS.search(path))
