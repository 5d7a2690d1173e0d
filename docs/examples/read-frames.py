#!/usr/bin/env python3
"""Frames of the protocol, read without any library: kind and contents of each sound frame.

    python3 read-frames.py < records.bin
"""
import sys


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def unstuff(coded):
    data, at = bytearray(), 0
    while at < len(coded):
        code = coded[at]
        data += coded[at + 1 : at + code]
        at += code
        if code < 255 and at < len(coded):
            data.append(0)
    if at != len(coded):
        raise ValueError("frame ends within a COBS block")
    return bytes(data)


def contents(stream):
    """Version, kind, header and payload of every sound frame."""
    for coded in stream.split(b"\0")[:-1]:
        try:
            data = unstuff(coded)
        except ValueError:
            continue
        if len(data) > 4 and crc32c(data[:-4]).to_bytes(4, "little") == data[-4:]:
            yield data[:-4]


for frame in contents(sys.stdin.buffer.read()):
    print(f"kind 0x{frame[1]:02x}: {frame.hex(' ')}")
