#!/usr/bin/env python3
"""Load cell on a serial amplifier that prints grams, as a gauge of `palpate calibrate sensor`.

    pip install pyserial
    palpate calibrate sensor --force "python3 read-cell.py /dev/ttyUSB0" ...
"""
import sys
import time

import serial

with serial.Serial(sys.argv[1], 115200, timeout=1) as port:
    for line in port:
        try:
            grams = float(line)
        except ValueError:
            continue  # A greeting, or a line cut off.
        print(time.monotonic(), grams * 9.80665e-3, flush=True)
