"""What the parts share: a study with the bytes that one process gives, and its shards as processes."""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

ROOT = Path(__file__).resolve().parents[2]
SHARDS = 8
CASES = 384
# Nothing here takes longer on a machine that does other things besides.
PATIENCE_S = 150.0


T = TypeVar("T")


class Failure(Exception):
    """Something is not as it has to be."""


def wait_for(what: str, found: Callable[[], T | None], patience_s: float = PATIENCE_S, every_s: float = 0.02) -> T:
    begun = time.monotonic()
    while True:
        value = found()
        if value is not None and value is not False:
            return value
        if time.monotonic() - begun > patience_s:
            raise Failure(f"after {patience_s:.0f} s still waiting: {what}")
        time.sleep(every_s)


class Study:
    """A study in a folder of its own, and its table as one process computes it."""

    def __init__(self, program: Path, folder: Path) -> None:
        self.program = program
        # A name that scripts have to quote.
        self.folder = folder / "jo's study"
        self.folder.mkdir(parents=True)
        self.file = self.folder / "study.toml"
        scenario = ROOT / "scenarios/studies/chest.toml"
        text = (ROOT / "tests/cluster/study.toml").read_text().replace("SCENARIO", str(scenario))
        self.file.write_text(text)

    @functools.cached_property
    def table(self) -> bytes:
        """As one process computes it."""
        self.run("study", "study.toml", "--out", "whole", "--no-page", "--quiet")
        return (self.folder / "whole/cluster/results.parquet").read_bytes()

    def run(self, *words: str, status: int = 0) -> str:
        done = subprocess.run(
            [str(self.program), *words], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE_S
        )
        if done.returncode != status:
            raise Failure(f"needlebench {' '.join(words)} ended with {done.returncode}: {done.stdout}{done.stderr}")
        return done.stdout

    def launch(self, what: str, out: str) -> Path:
        """The folder of the scripts."""
        self.run("study", "study.toml", "--launch", what, "--out", out)
        return self.folder / out / "cluster/launch"

    def merged(self, out: str) -> None:
        """Merges the shards of a launch by its script and compares the table."""
        shards = f"{out}/cluster/shards"
        self.run("study", "study.toml", "--status", shards)
        script = self.folder / out / "cluster/launch/merge.sh"
        done = subprocess.run([script, "--no-page", "--quiet"], capture_output=True, text=True, timeout=PATIENCE_S)
        if done.returncode:
            raise Failure(f"{script} ended with {done.returncode}: {done.stdout}{done.stderr}")
        if (self.folder / out / "cluster/results.parquet").read_bytes() != self.table:
            raise Failure(f"the table of {out} differs from that of one process")

    def cases_of(self, shards: Path, shard: int) -> int:
        """Blocks of a shard that are surely in its journal, from its length: about 1 kB each."""
        journal = shards / str(shard) / "cluster/journal.nbj"
        return journal.stat().st_size // 2000 if journal.exists() else 0

    def is_complete(self, shards: Path, shard: int) -> bool:
        manifest = shards / str(shard) / "cluster/study.json"
        return manifest.exists() and '"status": "complete"' in manifest.read_text()


def processes(shards: Path) -> dict[int, int]:
    """Processes that compute shards in a folder: the shard by the process's number."""
    found: dict[int, int] = {}
    for process in Path("/proc").iterdir():
        if not process.name.isdigit():
            continue
        try:
            line = (
                os.fsdecode((process / "cmdline").read_bytes())
                .replace("--out=", "--out\0")
                .replace("--shard=", "--shard\0")
            )
            words = line.split("\0")
            if not {"study", "--shard", "--out"} <= set(words):
                continue
            out = Path(os.readlink(process / "cwd")) / words[words.index("--out") + 1]
            shard = words[words.index("--shard") + 1]
            if shard == "auto":
                environment = os.fsdecode((process / "environ").read_bytes()).split("\0")
                variables = dict(each.split("=", 1) for each in environment if "=" in each)
                shard = variables.get("NEEDLEBENCH_SHARD") or variables.get("SLURM_ARRAY_TASK_ID") or "0"
                out = out / shard
            if out.parent.resolve() == shards.resolve():
                found[int(process.name)] = int(shard.split("/")[0])
        except OSError:
            continue
    return found


def kill(process: int) -> bool:
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True
