"""A Slurm of two nodes on this machine: no systemd, no network, all of it in one folder."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from pathlib import Path

PACKAGES = ["slurm-wlm", "munge"]
# Nothing here takes longer on a machine that does other things besides.
PATIENCE_S = 60.0

CONFIGURATION = """\
ClusterName=needlebench
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
# What is put back into the queue waits as long as a credential lasts: two minutes, if nobody says otherwise.
AuthInfo=socket={folder}/munge.socket,cred_expire=10
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,sched_min_interval=0,bf_interval=1,requeue_delay=0
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
ReturnToService=0
SlurmctldTimeout=30
SlurmdTimeout=30
InactiveLimit=0
KillWait=5
MinJobAge=300
{nodes}
PartitionName=work Nodes=node[1-2] Default=YES MaxTime=INFINITE State=UP
"""


def installed(install: bool) -> str | None:
    """Why there is no Slurm here; installs Debian's where it may."""
    if os.geteuid() != 0:
        return "Slurm's daemons are started by root, which this is not"
    if shutil.which("slurmctld") and shutil.which("munged"):
        return None
    if not install or not shutil.which("apt-get"):
        return "there is no Slurm, and no apt-get to install it"
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for command in [["update", "-qq"], ["install", "-y", "-qq", "--no-install-recommends", *PACKAGES]]:
        done = subprocess.run(["apt-get", *command], capture_output=True, text=True, env=environment, timeout=300)
        if done.returncode:
            return f"apt-get {command[0]} failed: {done.stderr.strip().splitlines()[-1:]}"
    return None


def free_ports(count: int) -> list[int]:
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


class Slurm:
    """Two nodes with one core each, of which the machine need not have as many. Ends what it has started."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.daemons: dict[str, subprocess.Popen[bytes]] = {}
        self.environment = {**os.environ, "SLURM_CONF": str(folder / "slurm.conf")}

    def __enter__(self) -> Slurm:
        try:
            self._start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def _start(self) -> None:
        folder = self.folder
        for name in ("state", "spool/node1", "spool/node2"):
            (folder / name).mkdir(parents=True)
        # Munge trusts no socket in a folder that others may write to.
        folder.chmod(0o755)
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        controller, *nodes = free_ports(3)
        host = socket.gethostname().split(".")[0]
        lines = [
            f"NodeName=node{k} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1 State=UNKNOWN"
            for k, port in enumerate(nodes, start=1)
        ]
        text = CONFIGURATION.format(host=host, controller_port=controller, folder=folder, nodes="\n".join(lines))
        (folder / "slurm.conf").write_text(text)
        munge = ["--key-file", key, "--socket", folder / "munge.socket", "--pid-file", folder / "munge.pid"]
        munge += ["--log-file", folder / "munge.log", "--seed-file", folder / "munge.seed"]
        self._daemon("munged", ["munged", "--foreground", "--force", *munge])
        self._until("munge answers", lambda: (folder / "munge.socket").exists())
        self._daemon("slurmctld", ["slurmctld", "-D", "-i"])
        for node in ("node1", "node2"):
            self._daemon(node, ["slurmd", "-D", "-N", node])
        self._until("both nodes are idle", lambda: self.nodes() == {"node1": "idle", "node2": "idle"})

    def _daemon(self, name: str, command: list[str | Path]) -> None:
        log = (self.folder / f"{name}.out").open("wb")
        self.daemons[name] = subprocess.Popen(
            command, env=self.environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
        )

    def _until(self, what: str, holds) -> None:
        begun = time.monotonic()
        while not holds():
            ended = [name for name, each in self.daemons.items() if each.poll() is not None]
            if ended or time.monotonic() - begun > PATIENCE_S:
                logs = [
                    f"{path.name}: {path.read_text(errors='replace')[-1500:]}" for path in self.folder.glob("*.out")
                ]
                raise TimeoutError(f"{what}: not so; ended: {ended}\n" + "\n".join(logs))
            time.sleep(0.1)

    def command(self, *words: str | Path, check: bool = True) -> str:
        done = subprocess.run(
            [str(word) for word in words], env=self.environment, capture_output=True, text=True, timeout=PATIENCE_S
        )
        if check and done.returncode:
            raise RuntimeError(f"{words}: {done.stderr}")
        return done.stdout.strip()

    def nodes(self) -> dict[str, str]:
        lines = self.command("sinfo", "--Node", "--noheader", "--format=%N %T", check=False).splitlines()
        return dict(line.split() for line in lines)

    def tasks(self) -> dict[str, tuple[str, str]]:
        """State and node of every task of an array that has not ended, by its number."""
        lines = self.command("squeue", "--array", "--noheader", "--format=%K|%T|%N", check=False).splitlines()
        return {task: (state, node) for task, state, node in (line.split("|") for line in lines)}

    def __exit__(self, *_: object) -> None:
        if "slurmctld" in self.daemons:
            self.command("scancel", "--user=root", check=False)
            begun = time.monotonic()
            while self.tasks() and time.monotonic() - begun < 15:
                time.sleep(0.2)
        # The reverse of their order.
        for daemon in reversed(self.daemons.values()):
            daemon.terminate()
        for daemon in reversed(self.daemons.values()):
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
