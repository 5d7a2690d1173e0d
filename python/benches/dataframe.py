"""Ten minutes of samples at 1 kHz to a DataFrame: this package beside the public MCAP reader with `json`.

    python python/benches/dataframe.py [MINUTES]

The samples are those of a simulated press, again and again with later times. Both ways read the same file, in
turns, three times each; the shortest time of each counts.
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

import palpate

PERIOD_US = 1000
TURNS = 3


def make(file: Path, count: int) -> None:
    """Writes a recording of so many samples."""
    press = palpate.Simulator("ultrasoft", seed=1).press("spring", stiffness_N_per_m=5e3)
    samples = [record.fields for record in press.records if record.kind == "sample"]
    with file.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start(profile="palpate")
        schema = writer.register_schema("palpate.sample", "jsonschema", b"{}")
        channel = writer.register_channel("/sample", "json", schema)
        for index in range(count):
            header = {"boot_id": 7, "sequence": index, "time_us": PERIOD_US * index, "dropped": 0}
            frame = {"header": header, "message": {"sample": samples[index % len(samples)]}}
            text = json.dumps(frame, separators=(",", ":")).encode()
            time_ns = 1_700_000_000_000_000_000 + 1000 * PERIOD_US * index
            writer.add_message(channel, log_time=time_ns, publish_time=time_ns, data=text, sequence=index)
        writer.finish()


def ours(file: Path) -> pd.DataFrame:
    return palpate.read(file).to_pandas()


def theirs(file: Path) -> pd.DataFrame:
    rows: list[dict[str, Any]] = []
    with file.open("rb") as stream:
        for _, _, message in make_reader(stream).iter_messages(topics=["/sample"]):
            frame = json.loads(message.data)
            row = frame["message"]["sample"]
            for channel in row.pop("channels"):
                number = channel.pop("channel")
                row.update({f"channels_{number}_{name}": value for name, value in channel.items()})
            row.update(frame["header"], host_time=message.log_time, device_time=message.publish_time)
            rows.append(row)
    return pd.DataFrame(rows)


def timed(read: Callable[[Path], pd.DataFrame], file: Path) -> tuple[float, pd.DataFrame]:
    began = time.perf_counter()
    frame = read(file)
    return time.perf_counter() - began, frame


def main() -> None:
    count = round(60e6 * float(sys.argv[1] if len(sys.argv) > 1 else 10) / PERIOD_US)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "long.mcap"
        make(file, count)
        print(f"{count} samples, {file.stat().st_size / 1e6:.0f} MB")
        took_s: dict[str, list[float]] = {"palpate": [], "mcap with json": []}
        for _ in range(TURNS):
            for name, read in [("palpate", ours), ("mcap with json", theirs)]:
                seconds, frame = timed(read, file)
                assert len(frame) == count and frame["current_a"].notna().any()
                took_s[name].append(seconds)
                del frame
    for name, times_s in took_s.items():
        print(f"{name}: {min(times_s):.2f} s (all: {', '.join(f'{of:.2f}' for of in times_s)})")
    print(f"ratio: {min(took_s['palpate']) / min(took_s['mcap with json']):.2f}")


if __name__ == "__main__":
    main()
