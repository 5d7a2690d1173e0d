"""Magnetic fields: the very figures of `palpate field`."""

import csv
import io
import json

import pytest
from conftest import Tool

import palpate

EFFORT = ["--accuracy", "1e-3"]


def test_figures_are_those_of_the_tool(tool: Tool) -> None:
    theirs = json.loads(tool.run("field", "solve", "A", "--current", "10", "--json", *EFFORT))
    per_ampere = palpate.field.solve("A", accuracy=1e-3).figures
    assert per_ampere.items() <= theirs.items()
    at_current = palpate.field.solve("A", current_a=10, accuracy=1e-3).figures
    assert at_current.items() <= theirs["at_current"].items()
    assert at_current["centre_T"] != per_ampere["centre_T_per_A"]


def test_a_profile_is_that_of_the_tool(tool: Tool) -> None:
    text = tool.run("field", "profile", "A", "--along", "axis", "--from", "0", "--to", "8", "--points", "5", "--csv")
    rows = list(csv.DictReader(io.StringIO(text)))
    at_m, radial_t, axial_t = palpate.field.solve("A").profile("axis", 0, 8, points=5)
    assert len(rows) == 5
    for row, x_m, br_t, bx_t in zip(rows, at_m, radial_t, axial_t, strict=True):
        assert row["mm"] == f"{1e3 * x_m:.6f}"
        assert float(row["Bx_T_per_A"]) == float(f"{bx_t:.9e}")
        assert float(row["Br_T_per_A"]) == float(f"{br_t:.9e}")


def test_a_changed_number_changes_the_field_and_points_are_on_the_map() -> None:
    field = palpate.field.solve("air", accuracy=1e-2)
    low, high = field.core_x_m
    [(radial_t, axial_t)] = field.at([(0.0, 0.5 * (low + high))])
    # Figures have a solution of their own: both are within the accuracy.
    assert axial_t == pytest.approx(field.figures["centre_T_per_A"], rel=2e-2)
    assert abs(radial_t) < 1e-9
    assert field.core_r_m == pytest.approx(8e-3)


def test_failures_have_the_text_of_the_tool(tool: Tool) -> None:
    assert "pot" in palpate.field.designs()
    with pytest.raises(palpate.PalpateError) as raised:
        palpate.field.solve("nowhere")
    assert str(raised.value) == tool.refused("field", "solve", "nowhere")
    with pytest.raises(palpate.PalpateError, match="PATH=NUMBER|path to a number"):
        palpate.field.solve("A", changes={"no.such": 1})
    with pytest.raises(palpate.PalpateError, match="0.1"):
        palpate.field.solve("A", accuracy=2)
    with pytest.raises(palpate.PalpateError, match="axis, radius"):
        palpate.field.solve("air", accuracy=1e-2).profile("sideways")
