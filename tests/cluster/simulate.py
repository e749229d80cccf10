"""Weak scaling beyond the machines that there are: simulated, from measured figures. Same figures, same table.

    tests/cluster/simulate.py

Every worker computes as many cases of 6 ms. A scheduler starts one shard after the other and takes `START_S` for each;
a worker pays `OVERHEAD_S` for every shard beside its cases, and shards are as unlike as measured. Efficiency is the time
that the cases alone would take over that until the last worker is done. Merging is not in it.
"""

from __future__ import annotations

import heapq
import random

CASE_S = 0.006
CASES_PER_WORKER = [25_000, 250_000]
# One shard: start of the program, its scenario, the journal. Seen with `measure.py`.
OVERHEAD_S = 0.09
# Of the time of a shard, between shards of one study: 0.57 to 0.78 s in eight.
SPREAD = 0.1
# What the scheduler does for one shard, during which it does nothing for another: Slurm's is measured, the others are
# assumed.
START_S = {"Slurm": 0.5, "Dask": 0.007, "local": 0.002}
SHARDS_PER_WORKER = [1, 4, 16]
WORKERS = [1, 10, 100, 1000]


def efficiency(start_s: float, workers: int, shards_per_worker: int, cases_per_worker: int) -> float:
    drawn = random.Random(1)
    shards = workers * shards_per_worker
    shard_s = CASE_S * cases_per_worker / shards_per_worker
    free = [0.0] * workers
    scheduler = last = work = 0.0
    for _ in range(shards):
        scheduler = max(scheduler, heapq.heappop(free)) + start_s
        cases_s = shard_s * max(0.0, drawn.gauss(1.0, SPREAD))
        work += cases_s
        end = scheduler + OVERHEAD_S + cases_s
        heapq.heappush(free, end)
        last = max(last, end)
    return work / workers / last


def main() -> None:
    print("simulated, not measured")
    print("| Engine | Shards a worker, each | " + " | ".join(f"{n} workers" for n in WORKERS) + " |")
    print("|---|---|" + "---|" * len(WORKERS))
    for engine, start_s in START_S.items():
        for cases in CASES_PER_WORKER:
            for count in SHARDS_PER_WORKER:
                each = CASE_S * cases / count
                found = [efficiency(start_s, workers, count, cases) for workers in WORKERS]
                cells = " | ".join(f"{value:.2f}" for value in found)
                print(f"| {engine} | {count}, {each:.0f} s | {cells} |")


if __name__ == "__main__":
    main()
