"""Simulated sensors: the very results and records of `palpate simulate`, with the truth."""

import json
import threading
import time
from typing import Any

import pyarrow as pa
import pytest
from conftest import SCENARIO, Tool

import palpate


def test_result_and_records_are_those_of_the_tool(press: palpate.Press, simulated: dict[str, Any]) -> None:
    assert press.result == simulated["result"]
    assert press.result["estimate"] is not None
    records = [(of.time_us, of.sequence, {of.kind: of.fields}) for of in press.records]
    theirs = [(of["header"]["time_us"], of["header"]["sequence"], of["message"]) for of in simulated["records"]]
    assert len(records) > 1000 and records == theirs


def test_the_truth_stands_beside_the_samples(press: palpate.Press, simulator: palpate.Simulator) -> None:
    truth = pa.table(press.truth)
    assert truth.schema.field("force_n").metadata == {b"unit": b"N"}
    rows = truth.to_pylist()
    times_s = [row["time_s"] for row in rows]
    assert times_s == sorted(times_s) and times_s[-1] > 1
    last = rows[-1]
    # Springs in series: displacements add up to that of the press, and to the growth.
    taken_m = last["load_m"] + last["frame_m"] + last["sensing_m"] + last["actuated_m"]
    assert taken_m == pytest.approx(last["press_m"] + last["growth_m"] + last["opening_m"], abs=1e-9)
    result = press.result
    assert last["load_spring_n_per_m"] == pytest.approx(result["true_n_per_m"], rel=1e-6)
    deformed_m = max(row["sensing_m"] for row in rows)
    assert deformed_m == pytest.approx(simulator.depth_m, rel=0.3)


def test_the_description_is_that_of_the_tool(tool: Tool, simulator: palpate.Simulator) -> None:
    (tool.folder / "same.toml").write_text(SCENARIO)
    printed = tool.run("simulate", "same.toml", "--seed", "3")
    assert simulator.description == "\n".join(printed.splitlines()[:2])


def test_a_wrong_key_or_value_is_refused_with_what_is_allowed(simulator: palpate.Simulator) -> None:
    with pytest.raises(palpate.PalpateError, match="allowed: 1 to 1e10 N/m"):
        simulator.press("spring", stiffness_N_per_m=-1)
    with pytest.raises(palpate.PalpateError, match="stiffness"):
        simulator.press("spring", stiffness=1)
    with pytest.raises(palpate.PalpateError, match="ultrasoft"):
        palpate.Simulator("no-such-stack")


def test_other_threads_run_while_a_press_is_computed(simulator: palpate.Simulator) -> None:
    counts: list[float] = []
    ended = threading.Event()

    def count() -> None:
        while not ended.is_set():
            counts.append(time.monotonic())
            time.sleep(0.002)

    counter = threading.Thread(target=count)
    counter.start()
    began = time.monotonic()
    simulator.press("rigid")
    took_s = time.monotonic() - began
    ended.set()
    counter.join()
    within = [at for at in counts if began <= at <= began + took_s]
    # With the interpreter's lock held it would be none.
    assert took_s > 0.02 and len(within) > 3, (took_s, len(within))


def test_a_press_is_saved_once(press: palpate.Press, recording: str) -> None:
    with pytest.raises(palpate.PalpateError, match="exists already"):
        press.save(recording)


def test_records_are_json(press: palpate.Press) -> None:
    first = press.records[0]
    assert json.loads(json.dumps(first.fields)) == first.fields
    assert first.kind in repr(first)
