"""What `palpate live` and `watch` take: memory over an hour with a page that reads nothing, and processor time."""

import json
import os
import signal
import socket
import threading
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from made_board import MadeBoard

HOUR_S = 3600
# Of one core, at 1 kHz.
GREATEST_LOAD = 0.2
GREATEST_LOAD_OF_WATCH = 0.1


def memory_kb(process) -> int:
    status = Path(f"/proc/{process.pid}/status").read_text()
    (line,) = [line for line in status.splitlines() if line.startswith("VmRSS")]
    return int(line.split()[1])


def processor_s(process) -> float:
    fields = Path(f"/proc/{process.pid}/stat").read_text().split()
    return (int(fields[13]) + int(fields[14])) / os.sysconf("SC_CLK_TCK")


def read_on(page: socket.socket):
    """Reads what comes until the end."""
    while page.recv(65536):
        pass


def stopped_page(url: str) -> socket.socket:
    """A page that is connected, and reads nothing."""
    address = urlsplit(url)
    page = socket.create_connection((address.hostname, address.port))
    request = f"GET {address.path}socket HTTP/1.1\r\nHost: {address.netloc}\r\n"
    request += "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    page.sendall((request + "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n").encode())
    assert page.recv(12) == b"HTTP/1.1 101"
    return page


@pytest.mark.slow
def test_an_hour_takes_no_more_memory_than_its_first_minutes(palpate, tmp_path_factory):
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))
    board = MadeBoard(HOUR_S)
    process = palpate.start("live", "--json", "--port", "0", "--board", board.address)
    page = stopped_page(json.loads(process.stdout.readline())["url"])
    board.go_on.set()
    began = time.monotonic()
    taken = []
    while board.sent < board.count:
        # A page that held up the link would end this.
        assert time.monotonic() < began + 1200
        time.sleep(1)
        taken.append((board.sent / 1000, memory_kb(process)))
    after_minutes = next(kb for seconds, kb in taken if seconds > 300)
    print(f"{taken[0]} {after_minutes} {taken[-1]} in {time.monotonic() - began:.0f} s")
    assert taken[-1][1] - after_minutes < 4_000, taken
    page.close()
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 0


def load_at_1_khz(process, board) -> float:
    """Part of a core that a program takes while it is sent a thousand samples a second."""
    board.go_on.set()
    time.sleep(2)
    began, sent, used_s = time.monotonic(), board.sent, processor_s(process)
    time.sleep(20)
    passed_s = time.monotonic() - began
    rate, load = (board.sent - sent) / passed_s, (processor_s(process) - used_s) / passed_s
    print(f"{rate:.0f} samples/s take {100 * load:.1f} % of a core")
    assert rate > 900
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 0
    return load


@pytest.mark.slow
def test_a_thousand_samples_a_second_take_little_of_a_core(palpate, tmp_path_factory):
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))
    board = MadeBoard(60, keeps_pace=True)
    process = palpate.start("live", "--json", "--port", "0", "--board", board.address)
    page = stopped_page(json.loads(process.stdout.readline())["url"])
    threading.Thread(target=read_on, args=[page], daemon=True).start()
    assert load_at_1_khz(process, board) < GREATEST_LOAD


@pytest.mark.slow
def test_to_watch_a_thousand_samples_a_second_takes_less(palpate):
    board = MadeBoard(60, keeps_pace=True)
    process = palpate.start("watch", "--json", "--board", board.address)
    threading.Thread(target=process.stdout.read, daemon=True).start()
    assert load_at_1_khz(process, board) < GREATEST_LOAD_OF_WATCH
