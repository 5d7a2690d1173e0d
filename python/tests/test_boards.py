"""Boards: the emulated one, a recording, a port; settings, measurements, Ctrl-C."""

import importlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import Tool

import palpate


def emulated(image: str, folder: Path, **options: float) -> palpate.Board:
    return palpate.connect("emulated", image=image, state=folder / "board.flash", **options)  # type: ignore[arg-type]


def test_records_and_settings_of_the_emulated_board(tool: Tool, image: str, tmp_path: Path) -> None:
    with emulated(image, tmp_path) as board:
        assert (board.name, board.hello["board"]) == ("the emulated board", "pico")
        records = [next(board) for _ in range(50)]
        assert {"sample"} <= {record.kind for record in records}
        sequences = [record.sequence for record in records]
        assert sequences == sorted(sequences)
        board.settings.change(rate_hz=500, automatic=True)
        assert board.settings["rate_hz"] == 500 and board.settings["automatic"] is True
        board.settings["drift"] = "linear"
        assert dict(board.settings)["drift"] == "linear"
        with pytest.raises(palpate.PalpateError) as raised:
            board.settings["rate_hz"] = 9000
        assert str(raised.value) == "rate_hz is 9000 Hz; allowed are 1 to 5000 Hz"
        with pytest.raises(palpate.PalpateError, match="there is no setting colour"):
            board.settings["colour"] = 1
        assert board.store()["succeeded"] is True
        board.send("identify")
        with pytest.raises(palpate.PalpateError, match="a command of docs/protocol.md"):
            board.send("dance")
    # What was stored is there for the tool.
    arguments = ["--board", "emulated", "--image", image, "--state", str(tmp_path / "board.flash")]
    line = json.loads(tool.run("settings", "get", "--json", *arguments))
    assert line["settings"]["rate_hz"] == 500 and line["settings"]["drift"] == "linear"


def test_a_measurement_is_refused_as_the_tool_refuses_it(tool: Tool, image: str, tmp_path: Path) -> None:
    with emulated(image, tmp_path) as board, pytest.raises(palpate.PalpateError) as raised:
        board.measure()
    arguments = ["--board", "emulated", "--image", image, "--state", str(tmp_path / "board.flash")]
    assert str(raised.value) == tool.refused("measure", *arguments)
    assert "not calibrated" in str(raised.value)


@pytest.fixture(scope="session")
def calibrated(tool: Tool, image: str) -> Path:
    """The flash of a calibrated emulated board, of seed 11."""
    calibration = Path(__file__).parents[2] / "host/tool/tests/fixture/ultrasoft-11.jsonl"
    state = tool.folder / "calibrated.flash"
    board = ["--board", "emulated", "--image", image, "--seed", "11", "--state", str(state)]
    tool.run("settings", "import", str(calibration), "--store", *board)
    return state


def test_a_measurement_is_that_of_the_tool(tool: Tool, image: str, calibrated: Path, tmp_path: Path) -> None:
    """The emulated board's time is its own: the same commands give the same bits."""
    ours, theirs = (shutil.copy(calibrated, tmp_path / name) for name in ["ours.flash", "theirs.flash"])
    with palpate.connect("emulated", image=image, seed=11, state=ours, load=1.5) as board:
        measured = board.measure()
    arguments = ["--board", "emulated", "--image", image, "--seed", "11", "--state", str(theirs)]
    assert measured == json.loads(tool.run("measure", "--load", "1.5", "--json", *arguments))
    assert measured["lower_n_per_m"] < measured["true_n_per_m"] < measured["upper_n_per_m"]


def test_a_recording_in_place_of_a_board_ends(recording: str) -> None:
    with palpate.connect(recording) as board:
        played = [record.kind for record in board]
        with pytest.raises(palpate.PalpateError, match="it takes no commands"):
            board.measure()
    assert len(played) == sum(palpate.read(recording).kinds.values())


def test_a_closed_board_and_wrong_names_say_what_to_do(tool: Tool, recording: str) -> None:
    with palpate.connect(recording) as board:
        pass
    with pytest.raises(palpate.PalpateError, match="closed"):
        next(board)
    for name in ["probe:nonsense", "tcp:127.0.0.1:1", "/dev/no-such-port"]:
        with pytest.raises(palpate.PalpateError) as raised:
            palpate.connect(name)
        assert str(raised.value) == tool.refused("measure", "--board", name)


def test_records_are_read_while_python_computes_and_a_lost_board_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "host/tool/tests/python"))
    made = importlib.import_module("made_board").MadeBoard(seconds=60)
    with palpate.connect(made.address) as board:
        assert board.name == made.address.removeprefix("tcp:")
        made.go_on.set()
        # A minute of samples, as fast as they are taken: 4 MB, more than the connection itself holds.
        deadline = time.monotonic() + 20
        while made.sent < 60_000 and time.monotonic() < deadline:
            time.sleep(0.01)
        assert made.sent == 60_000
        sequences: list[int] = []
        while len(sequences) < 60_000:
            record = next(board)
            if record.kind == "sample":
                sequences.append(record.sequence)
        assert sequences == list(range(sequences[0], sequences[0] + 60_000))
        made.program.shutdown(socket.SHUT_RDWR)
        made.listener.close()
        with pytest.raises(palpate.PalpateError, match="the board was disconnected"):
            while True:
                next(board)


PROGRAM = """
import signal, sys, time
import palpate

# A shell's background job ignores Ctrl-C, and its children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
with palpate.connect("emulated", image=sys.argv[1], state=sys.argv[2], seed=11, load=1.5) as board:
    print("ready", flush=True)
    try:
        WAIT
    except KeyboardInterrupt:
        print(time.time(), flush=True)
        raise
"""


@pytest.mark.parametrize("wait", ["for record in board: pass", "while True: board.measure()"])
def test_ctrl_c_is_a_keyboard_interrupt_within_a_fifth_of_a_second(
    image: str, calibrated: Path, tmp_path: Path, wait: str
) -> None:
    state = shutil.copy(calibrated, tmp_path / "board.flash")
    arguments = [sys.executable, "-c", PROGRAM.replace("WAIT", wait), image, str(state)]
    child = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "ready\n"
    time.sleep(0.5)
    sent = time.time()
    os.kill(child.pid, signal.SIGINT)
    out, err = child.communicate(timeout=20)
    assert "KeyboardInterrupt" in err
    assert float(out.split()[-1]) - sent < 0.2
    assert child.returncode == -signal.SIGINT
