"""The frames of the fixture, read by the tables of docs/protocol.md alone."""

import json
import math
import re
import struct
from pathlib import Path

import pytest
from made_board import crc32c, read_varint, unstuff

ROOT = Path(__file__).parents[4]
SECTIONS = (ROOT / "docs/protocol.md").read_text().split("\n### ")
FIXTURE = ROOT / "firmware/wire/fixture"
HEADER = ["boot_id", "sequence", "time_us", "dropped"]


def fields(text: str) -> list[tuple[str, str]]:
    """Name and type of each row in the first table of a text."""
    table = re.search(r"(\| \d+ \| `.*\n)+", text)
    return re.findall(r"\| \d+ \| `(\w+)` \| (.*?) \|", table[0]) if table else []


KINDS, STRUCTURES, CODES = {}, {}, {}
for section in SECTIONS:
    if kind := re.match(r"`(\w+)`, \w+ 0x(\w\w)", section):
        same = re.search(r"Payload as of the record `(\w+)`", section)
        KINDS[int(kind[2], 16)] = (kind[1], same[1] if same else kind[1])
        if not same:
            STRUCTURES[kind[1]] = fields(section)
    for name, text in re.findall(r"\n`(\w+)`: .*\n((?:.*\n)+?)(?=\n`|\n*\Z)", section):
        STRUCTURES[name] = fields(text)
    numbers = re.findall(r"\n\| (\d+) \| `(\w+)` \|", section)
    CODES[section.split("\n")[0]] = {int(number): name for number, name in numbers}


def read(kind: str, data: bytes, at: int):
    """A value of a type as the tables name it, and where the next one begins."""
    if kind in ("u16", "u32", "u64"):
        return read_varint(data, at)
    if kind in ("u8", "bool"):
        return data[at], at + 1
    if kind in ("f32", "f64"):
        value = struct.unpack_from("<f" if kind == "f32" else "<d", data, at)[0]
        return value, at + int(kind[1:]) // 8
    if code := re.match(r"\[(\w+)\]", kind):
        return CODES[code[1]].get(data[at], data[at]), at + 1
    if kind.startswith("optional "):
        return read(kind.removeprefix("optional "), data, at + 1) if data[at] else (None, at + 1)
    if kind.startswith("text"):
        end = at + 1 + data[at]
        return data[at + 1 : end].decode(), end
    if item := re.match(r"list of up to \d+ (.*)", kind):
        count, at, values = data[at], at + 1, []
        for _ in range(count):
            value, at = read(item[1], data, at)
            values.append(value)
        return values, at
    content = {}
    for name, of in STRUCTURES[kind.strip("`")]:
        content[name], at = read(of, data, at)
    return content, at


def agrees(found, listed) -> bool:
    """Whether a value is the listed one, whose floats have as many digits as an f32 needs."""
    if isinstance(found, dict):
        return found.keys() == listed.keys() and all(agrees(found[key], listed[key]) for key in found)
    if isinstance(found, list):
        return len(found) == len(listed) and all(map(agrees, found, listed))
    if isinstance(found, float):
        return listed is not None and math.isclose(found, listed, rel_tol=1e-6)
    return found == listed


@pytest.mark.parametrize("what", ["records", "commands"])
def test_every_frame_is_what_the_page_says(what):
    stream = (FIXTURE / f"v2-{what}.bin").read_bytes()
    lines = [json.loads(line) for line in (FIXTURE / f"v2-{what}.jsonl").read_text().splitlines()]
    frames = [unstuff(coded) for coded in stream.split(b"\0")[:-1]]
    assert len(frames) == len(lines)
    for data, line in zip(frames, lines):
        assert crc32c(data[:-4]).to_bytes(4, "little") == data[-4:]
        (name, structure), at, header = KINDS[data[1]], 2, {}
        for field in HEADER:
            header[field], at = read_varint(data, at)
        assert (data[0], header) == (2, line["header"])
        content, end = read(structure, data[:-4], at)
        message = line["message"]
        assert agrees({name: content}, {message: {}} if isinstance(message, str) else message)
        assert end == len(data) - 4
