"""The recipe for dask.distributed: a campaign in shards prints what one run prints, whichever workers are killed."""

import os
import signal
import threading
import time
from pathlib import Path

import shards_with_dask
from conftest import Tool
from distributed import Client, LocalCluster

PLANTS = 4
KILLED = 3


def kill_workers(client: Client, killed: list[int]) -> None:
    """Kills three workers, one after the other, each while it computes."""
    while len(killed) < KILLED:
        pids = [pid for pid in client.run(os.getpid).values() if pid not in killed]
        time.sleep(0.5)
        if pids and any(client.processing().values()):
            os.kill(pids[0], signal.SIGKILL)
            killed.append(pids[0])


def test_a_campaign_survives_the_death_of_its_workers(tool: Tool, tmp_path: Path) -> None:
    one = tool.run("campaign", "--seed", "40", "--plants", str(PLANTS), "--loads", "1")
    palpate = [tool.program, "campaign", "--loads", "1"]
    killed: list[int] = []
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
        Client(cluster) as other,
    ):
        killer = threading.Thread(target=kill_workers, args=(other, killed), daemon=True)
        killer.start()
        merged = shards_with_dask.campaign(client, tmp_path, PLANTS, seed=40, size=1, palpate=palpate)
        killer.join()
        assert merged.returncode == 0
        assert merged.stdout == one
        assert len(killed) == KILLED
        # Nothing is computed again.
        shards = {file: file.stat().st_mtime_ns for file in tmp_path.glob("*.jsonl")}
        assert len(shards) == PLANTS
        again = shards_with_dask.campaign(client, tmp_path, PLANTS, seed=40, size=1, palpate=palpate)
        assert again.stdout == one
        assert {file: file.stat().st_mtime_ns for file in tmp_path.glob("*.jsonl")} == shards
    assert len(list(tmp_path.iterdir())) == PLANTS, "no lock and no temporary file is left"
