#!/usr/bin/env python3
"""Checks what `palpate field export` and `palpate plan-touch --kicad` write with programs of others: KiCad loads each footprint and finds nothing by
its design rules, ezdxf reads the drawings, trimesh finds the STL watertight, shapely no turns that touch. From the
tracks as KiCad has read them come length, resistance, inductance and field once more, by formulas of this file.

    hardware/check_exports.py PALPATE    its packages: hardware/requirements.txt; /usr/bin/python3 has KiCad 9's module
"""
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import ezdxf
import numpy as np
import shapely
import trimesh

HERE = pathlib.Path(__file__).parent
# The three designs with the most different circuits, the sensing coil alone, and all of it in one.
DESIGNS = ["A", "pot", "closed", "sensing", "closed-sensing"]
LAYOUTS = ["three-around-one", "seven"]
# Boards of an array: from one to the next, and from front to back, m.
APART, FILM = 0.25e-3, 0.1e-3
# Height of the front's copper in the designs, m, and of the core's middle.
HEIGHTS = {"lower": 1.605e-3, "upper": 8.245e-3, "sensing": 0.0}
CORE = np.array([0, 0, 4.14e-3])
RESISTIVITY = 1.72e-8
# Most that tracks may be off the design, relative.
MOST = {"resistance at 20 C ohm": 0.02, "L in air uH": 0.01, "core mean in air uT/A": 0.01, "L uH": 0.01,
        "core mean uT/A": 0.01}


def run(*command):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


class Copper:
    """Straight pieces of track as KiCad has read them, in m, in the direction of the current."""

    def __init__(self, read, depth, height):
        self.read = read
        lines = [line for line in read["lines"] if line[0].endswith(".Cu")]
        z = {"F.Cu": height, "B.Cu": height - depth}
        ends = np.array([[[*place, 0] for place in line[1:3]] for line in lines]) * 1e-3
        ends[:, :, 2] = np.array([z[line[0]] for line in lines])[:, None]
        self.start, self.end = ends[:, 0], ends[:, 1]
        self.width = np.array([line[3] for line in lines]) * 1e-3
        self.length = np.linalg.norm(self.end - self.start, axis=1)

    def joined(self):
        """Whether the pieces lead from pad 1 over the via to pad 2."""
        jump = np.abs(self.start[1:] - self.end[:-1])
        pads = [np.array(self.read["pads"][number][0]) * 1e-3 for number in "132"]
        changes = np.flatnonzero(jump[:, 2] > 1e-9)
        ends = [self.start[0], self.end[changes[0]], self.end[-1]]
        return len(changes) == 1 and jump[:, :2].max() < 1e-6 and all(
            np.abs(end[:2] - pad).max() < 1e-6 for end, pad in zip(ends, pads))

    def touching(self, clearance):
        """Whether turns of a layer come nearer than the clearance: their widened copper then encloses a hole."""
        for height in set(self.start[:, 2]):
            layer = self.start[:, 2] == height
            path = shapely.LineString(np.concatenate([self.start[layer][:1], self.end[layer]])[:, :2])
            if path.buffer((self.width[layer][0] + 0.95 * clearance) / 2, quad_segs=32).interiors:
                return True
        return False


def inductance(coppers, thickness):
    """L in H by Neumann's sum: three strips abreast, pieces of two widths, midpoints, mean distances (Grover)."""
    parts = []
    for copper in coppers:
        count = np.maximum(2, np.ceil(copper.length / copper.width / 2)).astype(int)
        line = np.repeat(np.arange(len(count)), count)
        share = (np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[line]
        way = (copper.end - copper.start)[line]
        aside = np.cross([0, 0, 1], way) / copper.length[line, None] * copper.width[line, None] / 3
        own = 0.2235 * (copper.width[line] / 3 + thickness)
        middle = copper.start[line] + share[:, None] * way
        parts += [(middle + side * aside, way / count[line, None], own) for side in (-1, 0, 1)]
    middle, way, own = (np.concatenate(column) for column in zip(*parts))
    length, total = np.linalg.norm(way, axis=1), 0.0
    for at in range(len(middle)):
        apart = ((middle - middle[at]) ** 2).sum(axis=1) + own * own[at]
        kernel = way @ way[at] / np.sqrt(apart)
        # The same piece, of this strip and of the strips beside it: parallel filaments of a length, at a distance.
        near = apart < (0.5 * length[at]) ** 2
        ratio = np.sqrt(apart[near]) / length[at]
        kernel[near] = 2 * length[at] * (np.arcsinh(1 / ratio) + ratio - np.sqrt(1 + ratio ** 2))
        total += kernel.sum()
    return 1e-7 * total / 9


def field(coppers, place):
    """Field along the axis in T per ampere, by Biot and Savart with midpoints."""
    return sum((1e-7 * np.cross(copper.end - copper.start, place - middle)[:, 2]
                / np.linalg.norm(place - middle, axis=1) ** 3).sum()
               for copper in coppers for middle in [(copper.start + copper.end) / 2])


def read_board(path, clearance, scratch):
    """The footprint as KiCad's module reads it, which belongs to the system's Python; DRC of a board with it."""
    board, report = scratch / "board.kicad_pcb", scratch / "drc.json"
    read = run("/usr/bin/python3", HERE / "read_footprint.py", path.parent, path.stem, 0.95 * clearance, board)
    run("kicad-cli", "pcb", "drc", "--severity-error", "--format", "json", "-o", report, board)
    found = json.loads(report.read_text(encoding="utf-8"))
    # A track at a pad of its own net tie is no short, but KiCad 9.0.8 calls some so, others in each run.
    errors = [error for error in found["violations"] if error["type"] != "shorting_items"]
    assert not errors and not found["unconnected_items"], f"{path.stem}: DRC: {str(errors)[:2000]}"
    # Messages of the module stand before the JSON.
    return json.loads(read.splitlines()[-1])


def check_board(path, parts, height, scratch):
    name = path.stem.split("_")[-1]
    clearance = parts[name, "clearance"]
    copper = Copper(read_board(path, clearance, scratch), 1e-3 * parts[name, "between the layers"], height)
    assert copper.joined(), f"{path.stem}: the tracks do not lead from pad 1 to pad 2"
    assert not copper.touching(1e-3 * clearance), f"{path.stem}: turns touch"
    thickness = 1e-6 * parts[name, "thickness of the copper"]
    found = RESISTIVITY * (copper.length / copper.width).sum() / thickness
    assert abs(found / parts[name, "resistance at 20 C"] - 1) < 5e-3, f"{path.stem}: resistance is {found} ohm"
    drawing = ezdxf.readfile(path.parent.parent / "d" / f"{path.stem}.dxf")
    lines = [line for line in drawing.modelspace().query("POLYLINE") if line.dxf.layer in ("FRONT", "BACK")]
    steps = [np.diff([tuple(vertex.dxf.location) for vertex in line.vertices], axis=0) for line in lines]
    drawn = 1e-3 * sum(np.linalg.norm(step, axis=1).sum() for step in steps)
    assert not drawing.audit().errors, f"{path.stem}.dxf: {drawing.audit().errors}"
    assert abs(drawn / copper.length.sum() - 1) < 1e-4, f"{path.stem}.dxf: the tracks are {drawn} m long"
    return copper, thickness


def stated(text, title):
    """Rows of a round trip: the tracks' value and the design's."""
    rows = re.findall(r"^  (\S.+?) +([\d.]+) +([\d.]+) +[+-][\d.]+$", text.split(f"{title}\n")[1].split("field across")[0], re.M)
    return {row: (float(tracks), float(design)) for row, tracks, design in rows}


def check_design(palpate, design, folder, known):
    text = run(palpate, "field", "export", design, "--kicad", folder / "k", "--dxf", folder / "d", "--stl",
               folder / "s", "--parts", folder / "parts.csv")
    print(f"{design}\n{text.split('written: ' + str(folder / 'k'))[0].rstrip()}")
    with open(folder / "parts.csv", encoding="utf-8") as file:
        parts = {(row["part"], row["quantity"]): float(row["value"]) for row in csv.DictReader(file)}
    section = ezdxf.readfile(folder / "d" / f"{design}_section.dxf")
    assert not section.audit().errors and len(section.modelspace()), f"{design}: the section cannot be read"
    for path in (folder / "d").glob("*_slots.dxf"):
        slots = ezdxf.readfile(path)
        outlines = [np.array([vertex.dxf.location.vec2 for vertex in line.vertices]) for line in
                    slots.modelspace().query("POLYLINE") if line.dxf.layer == "SLOT"]
        assert not slots.audit().errors and outlines, f"{path.name} cannot be read"
        print(f"  {path.name}: {len(outlines)} slots, {np.linalg.norm(outlines[0][1] - outlines[0][2]):.2f} mm wide")
    boards = {path.stem.split("_")[-1]: path for path in (folder / "k").glob("*.kicad_mod")}
    series = {"lower and upper in series": ["lower", "upper"], "sensing": ["sensing"]}
    for title, names in series.items():
        if names[0] not in boards:
            continue
        read = [check_board(boards[name], parts, HEIGHTS[name], folder) for name in names]
        coppers, thickness = [copper for copper, _ in read], read[0][1]
        # Designs with the same tracks have the same sum.
        key = tuple(copper.start.tobytes() for copper in coppers)
        if key not in known:
            known[key] = inductance(coppers, thickness)
        found = known[key]
        rows = stated(text, title)
        print(f"  by this script: L in air {1e6 * found:.4f} uH, core's middle {1e6 * field(coppers, CORE):.2f} uT/A")
        assert abs(1e6 * found / rows["L in air uH"][0] - 1) < 0.01, f"{title}: L is {found} H"
        for row, most in MOST.items():
            tracks, of_design = rows[row]
            assert abs(tracks / of_design - 1) < most, f"{title}: {row} is {tracks}, the design has {of_design}"
    for path in sorted((folder / "s").glob("*.stl")):
        solid = trimesh.load(path)
        assert solid.is_watertight and solid.is_winding_consistent and solid.volume > 0, f"{path.name}: not closed"
        print(f"  {path.name}: watertight, {solid.volume / 1e3:.3f} cm3, {np.round(solid.extents, 2)} mm")


def coils_of(read, height):
    """The coils of a board, whose pieces of track follow each other from pad to pad."""
    groups = []
    for line in (line for line in read["lines"] if line[0].endswith(".Cu")):
        if not groups or np.abs(np.subtract(groups[-1][-1][2], line[1])).max() > 1e-4:
            groups.append([])
        groups[-1].append(line)
    return [Copper({"lines": group}, FILM, height) for group in groups]


def check_array(palpate, layout, folder):
    text = run(palpate, "plan-touch", layout, "--kicad", folder / "k", "--dxf", folder / "d")
    print(f"{layout}\n{text.split('written: ')[0].rstrip()}")
    rows = [row.split() for row in text.splitlines() if re.fullmatch(r" +\d+ +\d+( +[\d.]+){4} +[+-][\d.]+", row)]
    pairs = {(int(a), int(b)): float(k) for a, b, k in re.findall(r"^ +(\d+) (\d+) +([-\d.]+) +[-\d.]+$", text, re.M)}
    found = {}
    for path in sorted((folder / "k").glob("*.kicad_mod")):
        board = int(path.stem.split("_")[-1])
        on_it = [row for row in rows if int(row[1]) == board]
        clearance = min(float(row[2]) for row in on_it)
        coils = coils_of(read_board(path, clearance, folder), -APART * (board - 1))
        assert len(coils) == len(on_it), f"{path.stem}: {len(coils)} conductors for {len(on_it)} coils"
        for row, copper in zip(on_it, coils):
            assert not copper.touching(1e-3 * clearance), f"{path.stem}: turns touch"
            henry = inductance([copper], 35e-6)
            print(f"  by this script: L of coil {row[0]} is {1e6 * henry:.4f} uH")
            assert abs(1e6 * henry / float(row[4]) - 1) < 0.02, f"{layout}: L of coil {row[0]} is {henry} H"
            found[int(row[0])] = copper, henry
        drawing = ezdxf.readfile(folder / "d" / f"{path.stem}.dxf")
        assert not drawing.audit().errors and len(drawing.modelspace()), f"{path.stem}.dxf cannot be read"
    assert len(found) == len(rows) and rows and pairs, f"{layout}: {len(found)} coils are on the boards"
    for (one, other), stated_k in list(pairs.items())[:3]:
        (a, a_henry), (b, b_henry) = found[one], found[other]
        k = (inductance([a, b], 35e-6) - a_henry - b_henry) / 2 / np.sqrt(a_henry * b_henry)
        print(f"  by this script: k of {one} and {other} is {k:.3f}")
        assert abs(k - stated_k) < 0.01, f"{layout}: k of {one} and {other} is {k}"


def main():
    for layout in LAYOUTS:
        with tempfile.TemporaryDirectory() as folder:
            check_array(sys.argv[1], layout, pathlib.Path(folder))
    known = {}
    for design in DESIGNS:
        with tempfile.TemporaryDirectory() as folder:
            check_design(sys.argv[1], design, pathlib.Path(folder), known)


main()
