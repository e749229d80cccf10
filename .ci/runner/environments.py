"""Python environments of checks: one for each file of exact versions, made by uv where it can be had, else by pip."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from . import checks, tree
from .tree import TOP

# uv as a wheel, where it is not installed. It makes in seconds what pip makes in minutes.
INSTALLER = TOP / ".ci/installer-requirements.txt"


def root() -> Path:
    return checks.target_folder() / "ci/environments"


@functools.cache
def uv() -> str | None:
    """The program, installed beside the environments if need be; `NEEDLEBENCH_CI_PIP=1` does without."""
    if os.environ.get("NEEDLEBENCH_CI_PIP"):
        return None
    found = shutil.which("uv")
    if found:
        return found
    own = root() / "uv"
    if not (own / "bin/uv").exists():
        made = subprocess.run([sys.executable, "-m", "venv", own], capture_output=True, check=False).returncode == 0
        command = [own / "bin/pip", "install", "--quiet", "--disable-pip-version-check", *exactly(INSTALLER)]
        if not made or subprocess.run(command, capture_output=True, check=False).returncode:
            shutil.rmtree(own, ignore_errors=True)
            return None
    return str(own / "bin/uv")


def prepared(name: str) -> Path:
    """The folder of an environment, made anew where its file has changed."""
    requirements = TOP / checks.environments()[name].requirements
    folder = root() / name
    stamp = folder / "requirements.sha256"
    wanted = tree.digest(requirements.read_bytes())
    if stamp.exists() and stamp.read_text() == wanted:
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    program = uv()
    if program:
        run(program, "venv", "--quiet", "--python", sys.executable, str(folder))
        command = [program, "pip", "install", "--quiet", *found_by_pip(), "--python", str(folder / "bin/python")]
    else:
        run(sys.executable, "-m", "venv", str(folder))
        command = [str(folder / "bin/pip"), "install", "--quiet", "--disable-pip-version-check"]
    run(*command, *exactly(requirements))
    with tempfile.NamedTemporaryFile("w", dir=folder, delete=False) as partial:
        partial.write(wanted)
    Path(partial.name).replace(stamp)
    return folder


def exactly(requirements: Path) -> list[str]:
    """Options for what a file names, with its hashes, and nothing else."""
    return ["--require-hashes", "--requirement", str(requirements)]


def found_by_pip() -> list[str]:
    """What a machine tells pip of where packages are, for uv, which reads variables of its own."""
    words = []
    if "UV_DEFAULT_INDEX" not in os.environ and "UV_INDEX_URL" not in os.environ:
        asked = subprocess.run(
            [sys.executable, "-m", "pip", "config", "get", "global.index-url"],
            capture_output=True,
            text=True,
            check=False,
        )
        index = os.environ.get("PIP_INDEX_URL") or asked.stdout.strip()
        if index:
            words += ["--default-index", index]
    for folder in os.environ.get("PIP_FIND_LINKS", "").split():
        words += ["--find-links", folder]
    return words


def run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise tree.MistakeError(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
