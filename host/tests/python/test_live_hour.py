"""What `palpate live` takes over an hour of samples, with a page that reads nothing of them."""

import json
import os
import signal
import socket
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from made_board import MadeBoard

HOUR_S = 3600


def memory_kb(process) -> int:
    status = Path(f"/proc/{process.pid}/status").read_text()
    (line,) = [line for line in status.splitlines() if line.startswith("VmRSS")]
    return int(line.split()[1])


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
