"""A campaign of `palpate` in shards, computed by dask.distributed.

    python shards_with_dask.py shards --plants 1000 --workers 2 --stack soft-closed

Prints what `palpate campaign --plants 1000 --stack soft-closed` prints. Without --scheduler the workers are on
this computer. Those of a cluster need `palpate`, the same file as here, and the folder of the shards. A shard that
is complete is not computed again, so the same call goes on with an interrupted campaign.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

import dask
from distributed import Client, LocalCluster, as_completed

dask.config.set(
    {
        # A worker that is killed takes its shard along. Dask gives a shard up when this number of workers ended with
        # it; its default is 3. On a cluster: DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES=100 dask scheduler
        "distributed.scheduler.allowed-failures": 100,
        # The work is done in processes of their own, of which these monitors see nothing. With their defaults they
        # take 8 % of a core for two workers, with these values 1 %.
        "distributed.worker.profile.enabled": False,
        "distributed.worker.memory.monitor-interval": "10s",
        "distributed.admin.system-monitor.interval": "10s",
        "distributed.admin.tick.interval": "10s",
        "distributed.admin.tick.cycle": "10s",
    }
)


def compute(command: list[str], file: str) -> str:
    """Computes a shard on a worker, with one thread, and returns its file."""
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    # Dask sets it for its workers. With it `palpate` returns memory all the time, which takes 4 % of the time.
    environment.pop("MALLOC_TRIM_THRESHOLD_", None)
    # A shard that has lost its worker goes on: its output must not be a pipe to that worker. The next worker waits
    # for it.
    done = subprocess.run(
        [*command, "--shard", file],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return file


def campaign(
    client: Client, folder: Path, plants: int, *, seed: int = 1, size: int = 10, palpate: list[str]
) -> subprocess.CompletedProcess[str]:
    """Computes the shards of `palpate campaign`, of `size` sensors each, and merges them."""
    files: list[str] = []
    tasks = []
    for first in range(seed, seed + plants, size):
        sensors = min(size, seed + plants - first)
        file = str(folder.resolve() / f"{first}-{sensors}.jsonl")
        command = [*palpate, "--seed", str(first), "--plants", str(sensors)]
        tasks.append(client.submit(compute, command, file, pure=False))
    count = len(tasks)
    completed = as_completed(tasks, with_results=True)
    # A result that is here and is referred to no more is not computed again when its worker is killed.
    del tasks
    for _task, file in completed:
        files.append(file)
        print(f"{len(files)} of {count} shards", file=sys.stderr)
    command = [*palpate, "--seed", str(seed), "--plants", str(plants), "--merge", *files]
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)


def main() -> int:
    parser = argparse.ArgumentParser(
        description="palpate campaign, in shards by dask.distributed; takes the options of palpate campaign too",
        allow_abbrev=False,
    )
    parser.add_argument("folder", type=Path, help="for the shards; all workers see it")
    parser.add_argument("--plants", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--size", type=int, default=10, help="sensors of a shard")
    parser.add_argument("--scheduler", help="address of a cluster's scheduler")
    parser.add_argument("--workers", type=int, help="number of workers on this computer; default: one per core")
    parser.add_argument("--palpate", default="palpate", help="the program")
    given, options = parser.parse_known_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    cluster = given.scheduler or LocalCluster(n_workers=given.workers, threads_per_worker=1, dashboard_address=None)
    with Client(cluster) as client:
        palpate = [given.palpate, "campaign", *options]
        merged = campaign(client, given.folder, given.plants, seed=given.seed, size=given.size, palpate=palpate)
    if isinstance(cluster, LocalCluster):
        cluster.close()
    print(merged.stdout, end="")
    return merged.returncode


if __name__ == "__main__":
    sys.exit(main())
