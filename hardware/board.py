#!/usr/bin/python3
"""Lays the board out with KiCad's Python module: parts by placement.txt, areas of copper by copper.txt, tracks by
the router beside it. Writes palpate-one.kicad_pcb.

    hardware/board.py    needs KiCad 9 with its footprints, and rustc; half a minute
"""
import pathlib
import subprocess
import tempfile

import pcbnew

from make import FOLDER, NAME, symbol_id
from netlist import Netlist

LIBRARY = pathlib.Path("/usr/share/kicad/footprints")
WIDTH, HEIGHT = 104, 62
HOLES = [(3.7, 27), (3.7, 58.3), (100.3, 58.3), (82, 4.5)]
LAYERS = {"F": pcbnew.F_Cu, "1": pcbnew.In1_Cu, "2": pcbnew.In2_Cu, "B": pcbnew.B_Cu}


def at(x, y):
    return pcbnew.VECTOR2I_MM(50 + float(x), 50 + float(y))


def lines(name):
    for line in open(FOLDER / name, encoding="utf-8"):
        words = line.split("#")[0].split()
        if words:
            yield words


def net_of(board, nets, name):
    if name not in nets:
        nets[name] = pcbnew.NETINFO_ITEM(board, name)
        board.Add(nets[name])
    return nets[name]


def add_parts(board, netlist, nets):
    places = {ref: (x, y, angle) for ref, x, y, angle in lines("placement.txt")}
    missing = netlist.parts.keys() ^ places.keys()
    assert not missing, f"without a place, or without a part: {missing}"
    for part in netlist.parts.values():
        library, name = part.footprint.split(":")
        footprint = pcbnew.FootprintLoad(str(LIBRARY / f"{library}.pretty"), name)
        footprint.SetFPID(pcbnew.LIB_ID(library, name))
        footprint.SetReference(part.ref)
        footprint.SetValue(part.value)
        footprint.SetDNP(not part.fitted)
        footprint.SetExcludedFromBOM(False)
        footprint.SetPath(pcbnew.KIID_PATH(f"/{symbol_id(part.ref)}"))
        x, y, angle = places[part.ref]
        footprint.SetPosition(at(x, y))
        footprint.SetOrientationDegrees(float(angle))
        for pad in footprint.Pads():
            names = [name for number, name, _ in netlist.kinds[part.kind] if number == pad.GetNumber()]
            if names:
                # KiCad's own name for a pin that leads to nothing
                alone = f"unconnected-({part.ref}-{names[0]}-Pad{pad.GetNumber()})"
                pad.SetNet(net_of(board, nets, netlist.pads.get((part.ref, pad.GetNumber()), alone)))
        footprint.Value().SetVisible(False)
        footprint.Reference().SetTextSize(pcbnew.VECTOR2I_MM(0.7, 0.7))
        footprint.Reference().SetTextThickness(pcbnew.FromMM(0.12))
        board.Add(footprint)


def add_outline(board):
    corners = [(0, 0), (WIDTH, 0), (WIDTH, HEIGHT), (0, HEIGHT)]
    for start, end in zip(corners, corners[1:] + corners[:1]):
        edge = pcbnew.PCB_SHAPE(board, pcbnew.SHAPE_T_SEGMENT)
        edge.SetLayer(pcbnew.Edge_Cuts)
        edge.SetStart(at(*start))
        edge.SetEnd(at(*end))
        edge.SetWidth(pcbnew.FromMM(0.1))
        board.Add(edge)
    for index, place in enumerate(HOLES, 1):
        hole = pcbnew.FootprintLoad(str(LIBRARY / "MountingHole.pretty"), "MountingHole_3.2mm_M3")
        hole.SetReference(f"H{index}")
        hole.Reference().SetVisible(False)
        hole.SetBoardOnly(True)
        hole.SetPosition(at(*place))
        board.Add(hole)


def add_copper(board, nets):
    for words in lines("copper.txt"):
        if words[0] == "area":
            _, net, layer, priority, solid, *numbers = words
            zone = pcbnew.ZONE(board)
            zone.SetLayer(LAYERS[layer])
            zone.SetNet(nets[net])
            zone.SetAssignedPriority(int(priority))
            zone.SetLocalClearance(pcbnew.FromMM(0.25))
            zone.SetMinThickness(pcbnew.FromMM(0.25))
            zone.SetPadConnection(pcbnew.ZONE_CONNECTION_FULL if solid == "solid" else pcbnew.ZONE_CONNECTION_THERMAL)
            zone.SetThermalReliefGap(pcbnew.FromMM(0.3))
            zone.SetThermalReliefSpokeWidth(pcbnew.FromMM(0.4))
            zone.SetIslandRemovalMode(pcbnew.ISLAND_REMOVAL_MODE_ALWAYS)
            points = [at(x, y) for x, y in zip(numbers[::2], numbers[1::2])]
            zone.AddPolygon(pcbnew.VECTOR_VECTOR2I(points))
            board.Add(zone)
        elif words[0] == "vias":
            # vias NET x0 x1 step y0 y1 step: a field of vias
            _, net, x0, x1, dx, y0, y1, dy = words
            x = float(x0)
            while x < float(x1) + 1e-6:
                y = float(y0)
                while y < float(y1) + 1e-6:
                    via = pcbnew.PCB_VIA(board)
                    via.SetPosition(at(x, y))
                    via.SetDrill(pcbnew.FromMM(0.4))
                    via.SetWidth(pcbnew.FromMM(0.8))
                    via.SetNet(nets[net])
                    via.SetLocked(True)
                    board.Add(via)
                    y += float(dy)
                x += float(dx)


def place(out):
    """Writes the board without tracks, and reads it back: KiCad then knows its nets."""
    netlist = Netlist(FOLDER / "netlist.txt")
    board = pcbnew.NewBoard(out)
    board.SetCopperLayerCount(4)
    nets = {}
    add_outline(board)
    add_parts(board, netlist, nets)
    add_copper(board, nets)
    pcbnew.SaveBoard(out, board)
    return pcbnew.LoadBoard(out)


def millimetres(box):
    """Corners of a box on the board, in millimetres from its upper left corner."""
    edges = (box.GetLeft(), box.GetTop(), box.GetRight(), box.GetBottom())
    return " ".join(f"{pcbnew.ToMM(edge) - 50:.3f}" for edge in edges)


def text_for_router(board):
    out = [f"size {WIDTH} {HEIGHT}"]
    for words in lines("copper.txt"):
        if words[0] == "area" and words[2] in "FB" and words[1] != "GND":
            out.append(" ".join(["area", words[1], words[2], *words[5:]]))
        elif words[0] in ("sense", "plane"):
            out.append(" ".join(words))
    for footprint in board.GetFootprints():
        for pad in footprint.Pads():
            layers = pad.IsOnLayer(pcbnew.F_Cu) + 2 * pad.IsOnLayer(pcbnew.B_Cu)
            if layers:
                name = f"{footprint.GetReference()}.{pad.GetNumber()}"
                out.append(f"pad {pad.GetNetname() or '-'} {layers} {millimetres(pad.GetBoundingBox())} {name}")
        for area in footprint.Zones():
            out.append(f"pad - 3 {millimetres(area.GetBoundingBox())} keepout")
    for via in board.GetTracks():
        out.append(f"pad {via.GetNetname()} 3 {millimetres(via.GetBoundingBox())} via")
    return "\n".join(out)


def add_tracks(board, routed):
    for line in routed.splitlines():
        kind, net, *words = line.split()
        if kind == "track":
            layer, x0, y0, x1, y1 = words
            item = pcbnew.PCB_TRACK(board)
            item.SetLayer(LAYERS[layer])
            item.SetStart(at(x0, y0))
            item.SetEnd(at(x1, y1))
            item.SetWidth(pcbnew.FromMM(0.2))
        else:
            item = pcbnew.PCB_VIA(board)
            item.SetPosition(at(*words))
            item.SetDrill(pcbnew.FromMM(0.3))
            item.SetWidth(pcbnew.FromMM(0.6))
        item.SetNet(board.FindNet(net))
        board.Add(item)


def main():
    out = FOLDER / f"{NAME}.kicad_pcb"
    with tempfile.TemporaryDirectory() as folder:
        router = pathlib.Path(folder) / "route"
        source = pathlib.Path(__file__).parent / "route.rs"
        subprocess.run(["rustc", "--edition", "2024", "-O", source, "-o", router], check=True)
        board = place(f"{folder}/{NAME}.kicad_pcb")
        routed = subprocess.run([router], input=text_for_router(board), capture_output=True, text=True, check=True)
        print(routed.stderr.splitlines()[-1])
        add_tracks(board, routed.stdout)
        pcbnew.ZONE_FILLER(board).Fill(board.Zones())
        pcbnew.SaveBoard(f"{folder}/{NAME}.kicad_pcb", board)
        out.write_bytes((pathlib.Path(folder) / f"{NAME}.kicad_pcb").read_bytes())


main()
