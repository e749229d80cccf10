"""A study on two workers of Dask, one of which is killed in the middle; `run` compares the table."""

from __future__ import annotations

import argparse
import os
import signal
import threading
import time
from pathlib import Path

from common import SHARDS, Failure, processes, wait_for


def main() -> None:
    import needlebench as nb
    from distributed import Client, LocalCluster

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--study", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    shards = arguments.out / "cluster/shards"
    killed: list[tuple[int, int]] = []
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster,
        Client(cluster) as client,
    ):
        workers = client.run(os.getpid)

        def kill_one() -> None:
            """The worker whose process has computed a little."""

            def found() -> tuple[int, int] | None:
                for process, shard in processes(shards).items():
                    journal = shards / str(shard) / "cluster/journal.nbj"
                    try:
                        parent = int(Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[1])
                    except OSError:
                        continue
                    if parent in workers.values() and journal.exists() and journal.stat().st_size > 8000:
                        os.kill(parent, signal.SIGKILL)
                        return parent, shard
                return None

            killed.append(wait_for("a shard of a worker", found, every_s=0.005))

        killer = threading.Thread(target=kill_one)
        killer.start()
        begun = time.monotonic()
        study = nb.study(arguments.study, out=arguments.out, client=client, shards=SHARDS, page=False)
        killer.join()
        # Again: all of it is there.
        again = nb.study(arguments.study, out=arguments.out, client=client, shards=SHARDS, page=False)
    if study.summary != again.summary or not killed:
        raise Failure("asked for again it is another one")
    print(f"worker killed in shard {killed[0][1]}; {time.monotonic() - begun:.0f} s")


if __name__ == "__main__":
    main()
