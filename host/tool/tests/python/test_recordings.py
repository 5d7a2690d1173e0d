"""A recording is read by packages that know nothing of this project."""

import json
from collections import Counter

import pandas
import pyarrow.parquet
from mcap.reader import make_reader


def test_the_mcap_package_reads_every_message(palpate, recording):
    info = palpate.json("info", recording.name)
    counts, sequences = Counter(), []
    with open(recording, "rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            document = json.loads(message.data)
            counts[channel.topic.removeprefix("/")] += 1
            sequences.append(document["header"]["sequence"])
            assert message.sequence == sequences[-1]
    assert counts == info["records"]
    assert len(sequences) == info["boots"][0]["received"] > 1_900
    assert sorted(sequences) == list(range(min(sequences), max(sequences) + 1))


def tables(palpate, recording, kind):
    """A table of a recording in both forms."""
    palpate.run("export", recording.name, "--csv", "tables", "--parquet", "tables")
    folder = palpate.folder / "tables"
    return pandas.read_csv(folder / f"{kind}.csv"), pandas.read_parquet(folder / f"{kind}.parquet")


def test_pandas_reads_the_same_numbers_from_csv_and_parquet(palpate, recording):
    comma, typed = tables(palpate, recording, "sample")
    count = palpate.json("info", recording.name)["records"]["sample"]
    assert len(comma) == len(typed) == count
    times = {"host_time_s": "host_time", "device_time_s": "device_time"}
    assert [times.get(name, name) for name in comma] == list(typed)
    assert str(typed["host_time"].dtype) == "datetime64[ns, UTC]"
    seconds = typed["host_time"].astype("int64") / 1e9
    assert (abs(seconds - comma["host_time_s"]) < 1e-6).all()
    for name in set(comma) - set(times):
        dtype = typed[name].dtype
        if typed[name].isna().all():
            assert comma[name].isna().all(), name
        else:
            # Read as the type of the other one, not as a number that is near.
            assert (comma[name].astype(dtype) == typed[name]).all(), name


def test_parquet_has_types_and_units(palpate, recording):
    _, samples = tables(palpate, recording, "sample")
    assert samples["channels_0_frequency_hz"].dtype == "float64"
    assert samples["current_a"].dtype == "float32"
    assert samples["channels_0_word"].dtype == "uint32"
    units = samples.attrs["units"]
    assert (units["channels_0_frequency_hz"], units["current_a"]) == ("Hz", "A")
    metadata = pyarrow.parquet.read_schema(palpate.folder / "tables" / "sample.parquet").metadata
    assert json.loads(metadata[b"units"]) == units


def test_the_tables_hold_what_decode_prints(palpate, recording):
    """The words of the file's own messages, beside those of the tables."""
    _, samples = tables(palpate, recording, "sample")
    with open(recording, "rb") as file:
        messages = make_reader(file).iter_messages(topics=["/sample"])
        words = [json.loads(message.data)["message"]["sample"]["channels"][0]["word"] for *_, message in messages]
    assert words == list(samples["channels_0_word"])
