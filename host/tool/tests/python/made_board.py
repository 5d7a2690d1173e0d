"""A board at a TCP port that sends made samples, by docs/protocol.md alone."""

import contextlib
import json
import socket
import struct
import threading
import time
from pathlib import Path

# Records of every kind, as a board sends them.
RECORDS = Path(__file__).parents[4] / "firmware/wire/fixture/v2-records"

VERSION, BOOT_ID = 2, 7
HELLO, SAMPLE, FAULT, ACKNOWLEDGEMENT = 0x01, 0x03, 0x09, 0x0B
NOT_SET = 12
PERIOD_US = 1000

TABLE = []
for index in range(256):
    for _ in range(8):
        index = index >> 1 ^ (0x82F63B78 if index & 1 else 0)
    TABLE.append(index)


def crc32c(data: bytes) -> int:
    crc = 0xFFFFFFFF
    for byte in data:
        crc = crc >> 8 ^ TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


def varint(value: int) -> bytes:
    coded = bytearray()
    while value > 0x7F:
        coded.append(value & 0x7F | 0x80)
        value >>= 7
    coded.append(value)
    return bytes(coded)


def read_varint(data: bytes, at: int) -> tuple[int, int]:
    """The value, and where the next one begins."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, at


def stuff(data: bytes) -> bytes:
    """COBS of fewer than 254 bytes."""
    return b"".join(bytes([len(part) + 1]) + part for part in data.split(b"\0")) + b"\0"


def unstuff(coded: bytes) -> bytes:
    data, at = bytearray(), 0
    while at < len(coded):
        data += coded[at + 1 : at + coded[at]]
        at += coded[at]
        if at < len(coded):
            data.append(0)
    return bytes(data)


def hello() -> bytes:
    numbers = bytes([2]) + b"".join(map(varint, [0, 0, 1, 0, 0]))
    return numbers + bytes([0, 1, 1]) + varint(0) + bytes([1, 1, 1]) + varint(0)


def sample(deformation_m: float) -> bytes:
    channel = bytes([0]) + varint(0) + varint(123) + struct.pack("<df", 3e6 - 1e9 * deformation_m, 1.0)
    channel += struct.pack("<BfBfB", 1, deformation_m, 1, 2e-7, 0)
    values = struct.pack("<BfBfBfB", 1, 6e3 * deformation_m, 1, 1e-3, 1, 0.01, 0)
    return bytes([0, 0, 0, 1]) + channel + bytes([2]) + values


def recorded(name: str) -> tuple[int, bytes]:
    """Kind and payload of a record."""
    lines = map(json.loads, RECORDS.with_suffix(".jsonl").read_text().splitlines())
    line = next(line for line in lines if name in line["message"])
    frame = RECORDS.with_suffix(".bin").read_bytes()[line["offset"] :][: line["length"]]
    data, at = unstuff(frame.strip(b"\0")), 2
    for _ in line["header"]:
        _, at = read_varint(data, at)
    return data[1], data[at:-4]


class MadeBoard:
    """
    Serves one program: an answer to each command, and samples of so many seconds, as fast as they are taken or
    at the pace of real time.
    """

    def __init__(self, seconds: int, keeps_pace: bool = False):
        self.keeps_pace = keeps_pace
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = "tcp:127.0.0.1:%d" % self.listener.getsockname()[1]
        self.count = seconds * 1_000_000 // PERIOD_US
        self.sent = 0
        self.sequence = 0
        self.lock = threading.Lock()
        self.go_on = threading.Event()
        threading.Thread(target=self.run, daemon=True).start()

    def run(self):
        """Ends with the program."""
        with contextlib.suppress(ConnectionError):
            self.serve()

    def serve(self):
        self.program, _ = self.listener.accept()
        self.program.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        threading.Thread(target=self.answer, daemon=True).start()
        self.go_on.wait()
        # Half a period of a triangle, for plots that have something to show.
        payloads = [sample(1e-7 * abs(index - 500)) for index in range(1000)]
        # A real board's records come one by one.
        several = 1 if self.keeps_pace else 100
        began = time.monotonic()
        while self.sent < self.count:
            with self.lock:
                frames = [self.frame(SAMPLE, payloads[(self.sent + index) % 1000], index) for index in range(several)]
                self.program.sendall(b"".join(frames))
                self.sent += several
            due_s = self.sent * PERIOD_US * 1e-6
            if self.keeps_pace:
                time.sleep(max(0, began + due_s - time.monotonic()))

    def received(self) -> bytes:
        """Bytes of the program; none once it is gone."""
        try:
            return self.program.recv(4096)
        except ConnectionError:
            return b""

    def frame(self, kind: int, payload: bytes, index: int = 0) -> bytes:
        time_us = (self.sent + index) * PERIOD_US
        data = bytes([VERSION, kind]) + varint(BOOT_ID) + varint(self.sequence) + varint(time_us) + b"\0" + payload
        self.sequence += 1
        return stuff(data + crc32c(data).to_bytes(4, "little"))

    def begin_fault(self, code: int, value: float):
        with self.lock:
            self.program.sendall(self.frame(FAULT, bytes([code, 1, 1]) + struct.pack("<BfB", 1, value, 0)))

    def send(self, name: str):
        """Sends a record of a kind."""
        with self.lock:
            self.program.sendall(self.frame(*recorded(name)))

    def answer(self):
        """A hello for an `identify`, and an acknowledgement for every command: nothing is set."""
        waiting = b""
        while received := self.received():
            *coded, waiting = (waiting + received).split(b"\0")
            for command in filter(None, coded):
                data = unstuff(command)
                _, at = read_varint(data, 2)
                sequence, _ = read_varint(data, at)
                with self.lock:
                    if data[1] == 0x81:
                        self.program.sendall(self.frame(HELLO, hello()))
                    outcome = varint(sequence) + bytes([data[1], NOT_SET]) + bytes(5)
                    self.program.sendall(self.frame(ACKNOWLEDGEMENT, outcome))
