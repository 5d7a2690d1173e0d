#!/usr/bin/python3
"""Reads a footprint with KiCad's Python module and prints its copper as JSON, in millimetres, x to the right and y
upwards. Puts it on a board, with a net at each pad, for the design rule check.

    hardware/read_footprint.py FOLDER NAME CLEARANCE_MM BOARD
"""
import json
import pathlib
import sys

import pcbnew

folder, name, clearance, out = sys.argv[1:]
footprint = pcbnew.FootprintLoad(folder, name)
assert footprint, f"KiCad does not load {name}"
board = pcbnew.NewBoard(out)
for pad in footprint.Pads():
    net = pcbnew.NETINFO_ITEM(board, f"N{pad.GetNumber()}")
    board.Add(net)
    pad.SetNet(net)
footprint.SetReference("L1")
board.Add(footprint)
pcbnew.SaveBoard(out, board)
# The rules of the maker: to the edge, between tracks.
pathlib.Path(out).with_suffix(".kicad_dru").write_text(
    f"(version 1)\n(rule edge (constraint edge_clearance (min 0.25mm)))\n"
    f"(rule tracks (constraint clearance (min {clearance}mm)))\n(rule via (constraint annular_width (min 0.12mm)) (constraint hole_size (min 0.2mm)))\n",
    encoding="utf-8")


def mm(point):
    return [pcbnew.ToMM(point.x), -pcbnew.ToMM(point.y)]


shapes = [item for item in footprint.GraphicalItems() if isinstance(item, pcbnew.PCB_SHAPE)]
json.dump({
    "lines": [[shape.GetLayerName(), mm(shape.GetStart()), mm(shape.GetEnd()), pcbnew.ToMM(shape.GetWidth())]
              for shape in shapes],
    "pads": {pad.GetNumber(): [mm(pad.GetPosition()), pcbnew.ToMM(pad.GetSize().x), pcbnew.ToMM(pad.GetDrillSize().x)]
             for pad in footprint.Pads()},
}, sys.stdout)
