"""The recipe for dask.distributed: a campaign in shards prints what one run prints, whichever workers are killed."""

import os
import signal
import threading
from pathlib import Path

import shards_with_dask
from conftest import Tool
from distributed import Client, LocalCluster

PLANTS = 4
KILLED = 3


def kill_workers(cluster: LocalCluster, killed: list[int], end: threading.Event) -> None:
    """Kills up to three workers, one after the other, each with a shard."""
    scheduler = cluster.scheduler
    assert scheduler is not None
    while len(killed) < KILLED and not end.wait(0.5):
        busy = [address for address, worker in list(scheduler.workers.items()) if worker.processing]
        pids = [nanny.pid for nanny in cluster.workers.values() if nanny.worker_address in busy]
        new = [pid for pid in pids if pid is not None and pid not in killed]
        if new:
            os.kill(new[0], signal.SIGKILL)
            killed.append(new[0])


def test_a_campaign_survives_the_death_of_its_workers(tool: Tool, tmp_path: Path) -> None:
    one = tool.run("campaign", "--seed", "40", "--plants", str(PLANTS), "--loads", "1")
    palpate = [tool.program, "campaign", "--loads", "1"]
    killed: list[int] = []
    end = threading.Event()
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        killer = threading.Thread(target=kill_workers, args=(cluster, killed, end))
        killer.start()
        try:
            merged = shards_with_dask.campaign(client, tmp_path, PLANTS, seed=40, size=1, palpate=palpate)
        finally:
            end.set()
            killer.join()
        assert merged.returncode == 0
        assert merged.stdout == one
        assert killed
        # Nothing is computed again.
        shards = {file: file.stat().st_mtime_ns for file in tmp_path.glob("*.jsonl")}
        assert len(shards) == PLANTS
        again = shards_with_dask.campaign(client, tmp_path, PLANTS, seed=40, size=1, palpate=palpate)
        assert again.stdout == one
        assert {file: file.stat().st_mtime_ns for file in tmp_path.glob("*.jsonl")} == shards
    assert len(list(tmp_path.iterdir())) == PLANTS, "no lock and no temporary file is left"
