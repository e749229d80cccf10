"""What a shard costs beside its cases, by engine, and how a study scales: the figures of the guide.

    tests/cluster/measure.py --program target/release/needlebench [--python PYTHON]

Shards of a study that is complete return at once: what is left is what starting them costs. CPU seconds are what
counts on a machine that does other things. Weak scaling: the cases grow with the processes.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import Study, wait_for
from slurm import Slurm, installed

SHARDS = 96


def cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def processes(study: Study, launch: Path) -> dict[str, float]:
    """Shards that are there already, one after the other."""
    begun, cpu = time.monotonic(), cpu_s()
    for shard in range(1, SHARDS + 1):
        environment = {**os.environ, "NEEDLEBENCH_SHARD": str(shard)}
        subprocess.run([launch / "shard.sh"], check=True, env=environment, capture_output=True)
    return {"wall_s": (time.monotonic() - begun) / SHARDS, "cpu_s": (cpu_s() - cpu) / SHARDS}


def resident_mb(study: Study, launch: Path) -> float:
    nothing = subprocess.DEVNULL
    environment = {**os.environ, "NEEDLEBENCH_SHARD": "1"}
    process = subprocess.Popen([launch / "shard.sh"], env=environment, stdout=nothing, stderr=nothing)
    return os.wait4(process.pid, 0)[2].ru_maxrss / 1000


def on_slurm(study: Study, launch: Path, folder: Path) -> dict[str, float]:
    with Slurm(folder) as cluster:
        begun = time.monotonic()
        cluster.command("sbatch", launch / "job.sh")
        wait_for("all tasks", lambda: not cluster.tasks(), patience_s=600, every_s=0.1)
        wall = time.monotonic() - begun
        cpu = 0.0
        for daemon in cluster.daemons.values():
            fields = Path(f"/proc/{daemon.pid}/stat").read_text().rsplit(")", 1)[1].split()
            # Of the daemon and of all that it has waited for.
            cpu += sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
    return {"wall_s": wall / SHARDS, "cpu_s": cpu / SHARDS}


DASK = """
import json, sys, time
from distributed import Client, LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        from needlebench._cluster import study_on
        for _ in range(2):
            begun = time.monotonic()
            study_on(client, sys.argv[1], sys.argv[2], int(sys.argv[3]), 1, {}, None)
        print(json.dumps({"wall_s": time.monotonic() - begun}))
"""


def on_dask(study: Study, python: Path, folder: Path) -> dict[str, float]:
    script = folder / "measure_dask.py"
    script.write_text(DASK)
    said = subprocess.run(
        [python, script, study.file, study.folder / "dask", str(SHARDS)], check=True, capture_output=True, text=True
    )
    measured = json.loads(said.stdout)
    return {name: value / SHARDS for name, value in measured.items()}


def weak_scaling(program: Path, folder: Path) -> list[dict[str, float]]:
    """As many shards of 1/2 of the study as processes, at the same time."""
    found = []
    study = Study(program, folder)
    for count in (1, 2):
        begun, cpu = time.monotonic(), cpu_s()
        running = [
            subprocess.Popen(
                [
                    program,
                    "study",
                    "study.toml",
                    "--shard",
                    f"{k}/2",
                    "--out",
                    f"weak{count}/{k}",
                    "--jobs",
                    "1",
                    "--quiet",
                ],
                cwd=study.folder,
                stdout=subprocess.DEVNULL,
            )
            for k in range(1, count + 1)
        ]
        if any(each.wait() for each in running):
            raise RuntimeError("a shard failed")
        found.append({"processes": count, "wall_s": time.monotonic() - begun, "cpu_s": cpu_s() - cpu})
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--python", type=Path)
    arguments = parser.parse_args()
    program = arguments.program.resolve()
    folder = Path(tempfile.mkdtemp(prefix="needlebench-measure-"))
    try:
        study = Study(program, folder / "overhead")
        launch = study.launch(f"slurm:{SHARDS}", "out")
        first = processes(study, launch)
        answer: dict[str, object] = {"first time, with cases": first, "there already": processes(study, launch)}
        answer["resident MB"] = resident_mb(study, launch)
        if installed(False) is None:
            answer["slurm, there already"] = on_slurm(study, launch, folder / "slurm")
        if arguments.python:
            answer["dask, there already"] = on_dask(study, arguments.python.absolute(), folder)
        answer["weak scaling"] = weak_scaling(program, folder / "weak")
        json.dump(answer, sys.stdout, indent=2)
        print()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
