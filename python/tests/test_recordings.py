"""Recordings: the very numbers of the tool's exports, and its failures."""

import json
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet
import pytest
from conftest import Tool

import palpate


@pytest.fixture(scope="session")
def exported(tool: Tool, recording: str) -> Path:
    tool.run("export", recording, "--parquet", "tables")
    return tool.folder / "tables"


def test_every_table_is_that_of_the_export_to_the_bit(recording: str, exported: Path) -> None:
    tables = palpate.read(recording)
    assert set(tables) == {file.stem for file in exported.iterdir()}
    assert {"sample", "estimate", "stiffening_curve"} < set(tables)
    for kind in tables:
        theirs = pyarrow.parquet.read_table(exported / f"{kind}.parquet")
        ours = pa.table(tables[kind])
        assert ours.column_names == theirs.column_names
        for name in ours.column_names:
            column = theirs[name].cast(ours[name].type)
            # Equal bits: Arrow compares NaN as unequal, and none occurs.
            assert ours[name].combine_chunks().equals(column.combine_chunks()), f"{kind}.{name}"
            # No conversion hides a difference of types.
            assert ours[name].type == theirs[name].type or pa.types.is_timestamp(theirs[name].type)


def test_a_difference_of_one_bit_would_be_seen(recording: str) -> None:
    ours = pa.table(palpate.read(recording))["force_n"].combine_chunks()
    present = [index for index in range(len(ours)) if ours[index].is_valid]
    bits = bytearray(ours.buffers()[1].to_pybytes())
    bits[4 * present[0]] ^= 1
    changed = pa.Array.from_buffers(ours.type, len(ours), [ours.buffers()[0], pa.py_buffer(bytes(bits))])
    assert not ours.equals(changed)


def test_units_are_metadata_of_the_fields_and_attributes_of_the_frame(recording: str, exported: Path) -> None:
    tables = palpate.read(recording)
    schema = pa.table(tables).schema
    assert schema.field("force_n").metadata == {b"unit": b"N"}
    frame = tables.to_pandas()
    assert isinstance(frame, pd.DataFrame) and len(frame) == len(tables.samples)
    theirs = pd.read_parquet(exported / "sample.parquet")
    assert frame.attrs["units"] == theirs.attrs["units"] == tables.samples.units
    assert frame["device_time"].dt.tz is not None


def test_rows_are_counted_as_info_counts_them(tool: Tool, recording: str) -> None:
    counted = json.loads(tool.run("info", recording, "--json"))
    kinds = palpate.read(recording).kinds
    kinds.pop("modulus", None)
    assert kinds == counted["records"]


def test_estimates_are_computed_again_to_the_bit(tool: Tool, recording: str) -> None:
    [estimate] = palpate.estimate(recording)
    [row] = pa.table(palpate.read(recording)["estimate"]).to_pylist()
    assert estimate.kind == "estimate" and estimate.matches is True
    for name, value in estimate.fields.items():
        assert row[name] == (pa.scalar(value, pa.float32()).as_py() if isinstance(row[name], float) else value), name
    replayed = json.loads(tool.run("replay", recording, "--json"))
    assert replayed["first_difference"] is None
    assert replayed["kinds"]["estimate"]["identical"] == 1


def test_a_cut_recording_is_read_as_far_as_it_goes(recording: str, tmp_path: Path) -> None:
    whole = Path(recording).read_bytes()
    cut = tmp_path / "cut.mcap"
    # A recording, and the beginning of another one in the same file.
    cut.write_bytes(whole + whole[: len(whole) // 2])
    with pytest.warns(UserWarning, match="the file is cut off"):
        tables = palpate.read(cut)
    assert tables.kinds == palpate.read(recording).kinds


@pytest.mark.parametrize("content", [None, b"", b"no recording"])
def test_failures_have_the_text_of_the_tool(tool: Tool, tmp_path: Path, content: bytes | None) -> None:
    file = tmp_path / "bad.mcap"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(palpate.PalpateError) as raised:
        palpate.read(file)
    assert str(raised.value) == tool.refused("export", str(file), "--csv", "nowhere")
    with pytest.raises(palpate.PalpateError) as raised:
        palpate.estimate(file)
    assert str(raised.value) == tool.refused("replay", str(file))


def test_a_missing_table_is_named_with_those_that_are_there(recording: str) -> None:
    with pytest.raises(KeyError, match="sample"):
        palpate.read(recording)["touches"]
