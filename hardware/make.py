#!/usr/bin/env python3
"""Writes the KiCad schematic and the list of parts of a board from its netlist.txt; needs Python 3 alone.

    hardware/make.py            writes palpate-one.kicad_sch, .kicad_pro and parts.csv
    hardware/make.py --check    fails if the files in the folder differ from what it would write
"""
import csv
import io
import json
import pathlib
import sys
import uuid

from netlist import Netlist

FOLDER = pathlib.Path(__file__).parent / "palpate-one"
NAME = "palpate-one"
GRID = 2.54
PAGE = (594.0, 420.0)  # A2
SPACE = uuid.UUID("7d5a3f0e-2f5b-4a53-9a49-5c8b3a1d0b11")


def symbol_id(*key):
    return uuid.uuid5(SPACE, "/".join(map(str, key)))


def uid(*key):
    return f'(uuid "{symbol_id(*key)}")'


def text_size(size=1.27, more=""):
    return f"(effects (font (size {size} {size})){more})"


def prop(name, value, x, y, hide=False, size=1.27):
    hidden = " (hide yes)" if hide else ""
    return f'(property "{name}" "{value}" (at {x:g} {y:g} 0) {text_size(size, hidden)})'


def line(*points):
    pts = " ".join(f"(xy {x:g} {y:g})" for x, y in points)
    return f"(polyline (pts {pts}) (stroke (width 0.254) (type default)) (fill (type none)))"


def rectangle(x, y):
    return (f"(rectangle (start {-x:g} {y:g}) (end {x:g} {-y:g}) (stroke (width 0.254) (type default))"
            " (fill (type none)))")


# Bodies of the parts with two pins, which are drawn upright with pin 1 at the top.
BODIES = {
    "R": rectangle(1.016, 2.54), "FUSE": rectangle(1.016, 2.54) + line((0, 2.54), (0, -2.54)),
    "FB": rectangle(1.5, 2.54),
    "C": line((0, 2.54), (0, 0.6)) + line((-2, 0.6), (2, 0.6)) + line((-2, -0.6), (2, -0.6)) + line((0, -0.6), (0, -2.54)),
    "D": line((0, 2.54), (0, -2.54)) + line((-1.5, 1.2), (1.5, 1.2)) + line((0, 1.2), (-1.5, -1.2), (1.5, -1.2), (0, 1.2)),
}
BODIES["CP"] = BODIES["C"] + line((-2.4, 1.6), (-1.4, 1.6)) + line((-1.9, 2.1), (-1.9, 1.1))


class Symbol:
    """Drawing of a kind of part: the place of each pin, and the text for the library of the schematic."""

    def __init__(self, kind, pins):
        self.places = {}
        self.two = kind in BODIES
        if self.two:
            self.half_width, self.half_height = GRID, 2 * GRID
            for (number, _, _), y, angle in zip(pins, (2 * GRID, -2 * GRID), (270, 90)):
                self.places[number] = (0.0, y, angle)
            body = BODIES[kind]
        else:
            rows = (len(pins) + 1) // 2
            self.half_width, self.half_height = (5 if len(pins) > 3 else 3) * GRID, (rows + 1) // 2 * GRID + GRID
            top = (rows - 1) // 2 * GRID
            for index, (number, _, _) in enumerate(pins):
                left = index < rows
                row = index if left else len(pins) - 1 - index
                x = -self.half_width if left else self.half_width
                self.places[number] = (x, top - row * GRID, 0 if left else 180)
            body = rectangle(self.half_width - GRID, self.half_height)
        hidden = "(pin_names (offset 0) (hide yes)) (pin_numbers (hide yes))" if self.two else "(pin_names (offset 0.5))"
        drawn = "".join(
            f'(pin {kind_of_pin} line (at {x:g} {y:g} {angle}) (length {GRID:g}) (name "{name}" {text_size(1)})'
            f' (number "{number}" {text_size(0.8)}))'
            for (number, name, kind_of_pin), (x, y, angle) in zip(pins, self.places.values()))
        self.text = (
            f'(symbol "palpate:{kind}" {hidden} (exclude_from_sim no) (in_bom yes) (on_board yes)'
            + prop("Reference", "U", 0, 0) + prop("Value", kind, 0, 0)
            + prop("Footprint", "", 0, 0, True) + prop("Datasheet", "", 0, 0, True)
            + f'(symbol "{kind}_0_1" {body}) (symbol "{kind}_1_1" {drawn}))\n')


FLAG = ('(symbol "palpate:driven" (power) (pin_names (offset 0) (hide yes)) (pin_numbers (hide yes))'
        ' (exclude_from_sim no) (in_bom no) (on_board no)' + prop("Reference", "#FLG", 0, 0, True)
        + prop("Value", "driven", 0, 3) + prop("Footprint", "", 0, 0, True) + prop("Datasheet", "", 0, 0, True)
        + f'(symbol "driven_0_1" {line((0, 0), (0, 1.27), (-1, 2), (0, 2.6), (1, 2), (0, 1.27))})'
        + f'(symbol "driven_1_1" (pin power_out line (at 0 0 90) (length 0) (name "driven" {text_size()})'
        + f' (number "1" {text_size()}))))\n')


class Sheet:
    def __init__(self, netlist):
        self.netlist = netlist
        self.root = uuid.uuid5(SPACE, NAME)
        self.symbols = {kind: Symbol(kind, pins) for kind, pins in netlist.kinds.items()}
        self.out = []

    def label(self, net, x, y, angle, key):
        justify = "(justify left)" if angle in (0, 90) else "(justify right)"
        self.out.append(f'(global_label "{net}" (shape passive) (at {x:g} {y:g} {angle}) {text_size(1.27, justify)} {uid("label", key)})\n')

    def instance(self, ref, library, x, y, value, fitted, fields, pins):
        self.out.append(
            f'(symbol (lib_id "palpate:{library}") (at {x:g} {y:g} 0) (unit 1) (exclude_from_sim no) (in_bom yes)'
            f' (on_board yes) (dnp {"no" if fitted else "yes"}) {uid(ref)}' + fields
            + "".join(f'(pin "{n}" {uid(ref, n)})' for n in pins)
            + f'(instances (project "{NAME}" (path "/{self.root}" (reference "{ref}") (unit 1)))))\n')

    def part(self, part, x, y):
        """Draws a part with its centre at x, y, and the name of a net at each of its pins."""
        symbol = self.symbols[part.kind]
        side = 2.5 if symbol.two else -symbol.half_width + GRID
        above = -1.27 if symbol.two else -symbol.half_height - 3.2
        fields = (prop("Reference", part.ref, x + side, y + above, size=1.27)
                  + prop("Value", part.value, x + side, y + above + 2, size=1)
                  + prop("Footprint", part.footprint, x, y, True) + prop("Datasheet", "", x, y, True)
                  + prop("Source 1", part.sources[0], x, y, True) + prop("Source 2", part.sources[1], x, y, True))
        fields = fields.replace(text_size(1.27), text_size(1.27, "(justify left)")).replace(
            text_size(1), text_size(1, "(justify left)"))
        self.instance(part.ref, part.kind, x, y, part.value, part.fitted, fields, symbol.places)
        for number, (px, py, angle) in symbol.places.items():
            net = self.netlist.pads.get((part.ref, number))
            if net is None:
                self.out.append(f"(no_connect (at {x + px:g} {y - py:g}) {uid('open', part.ref, number)})\n")
            else:
                self.label(net, x + px, y - py, {0: 180, 180: 0, 270: 90, 90: 270}[angle], f"{part.ref}.{number}")

    def block(self, title, parts, x, y, width):
        """Draws a block in rows from x, y; returns its height."""
        self.out.append(f'(text "{title}" (exclude_from_sim no) (at {x:g} {y:g} 0)'
                        f' {text_size(2.5, "(justify left)")} {uid("title", title)})\n')
        left, row_top, row_height = x, y + 3 * GRID, 0.0
        for part in parts:
            symbol = self.symbols[part.kind]
            w, h = 2 * symbol.half_width + 10 * GRID, 2 * symbol.half_height + 10 * GRID
            if symbol.two:
                w = 8 * GRID
            if left + w > x + width and left > x:
                left, row_top, row_height = x, row_top + row_height, 0.0
            cx = round((left + w / 2) / GRID) * GRID
            cy = round((row_top + h / 2) / GRID) * GRID
            self.part(part, cx, cy)
            left, row_height = left + w, max(row_height, h)
        return row_top + row_height - y

    def text(self):
        x, y, width = 10 * GRID, 8 * GRID, 68 * GRID
        blocks = {}
        for part in self.netlist.parts.values():
            blocks.setdefault(part.block, []).append(part)
        for title, parts in blocks.items():
            height = self.block(title, parts, x, y, width)
            y += height + 4 * GRID
            if y > PAGE[1] - 60 * GRID:
                x, y = x + width + 6 * GRID, 8 * GRID
        for index, net in enumerate(self.netlist.driven):
            fx, fy = PAGE[0] - (40 - 7 * index) * GRID, PAGE[1] - 24 * GRID
            fx, fy = round(fx / GRID) * GRID, round(fy / GRID) * GRID
            fields = prop("Reference", f"#FLG{index}", fx, fy, True) + prop("Value", "driven", fx, fy - 4)
            self.instance(f"#FLG{index}", "driven", fx, fy, "driven", True, fields, ["1"])
            self.label(net, fx, fy, 270, f"flag {net}")
        library = "".join(s.text for k, s in self.symbols.items() if any(p.kind == k for p in self.netlist.parts.values()))
        return (f'(kicad_sch (version 20250114) (generator "palpate") (generator_version "1")\n(uuid "{self.root}")\n'
                f'(paper "A2")\n(title_block (title "{NAME}") (comment 1 "made from netlist.txt; not built yet"))\n'
                f"(lib_symbols\n{library}{FLAG})\n" + "".join(self.out)
                + '(sheet_instances (path "/" (page "1")))\n(embedded_fonts no))\n')


def project():
    """Rules. The symbols live in the schematic, so that no library is looked for."""
    rules = {"min_clearance": 0.15, "min_track_width": 0.15, "min_via_diameter": 0.5, "min_through_hole_diameter": 0.3,
             "min_copper_edge_clearance": 0.4, "min_hole_to_hole": 0.25, "min_resolved_spokes": 1,
             "min_text_height": 0.6, "min_text_thickness": 0.1}
    netclass = {"name": "Default", "clearance": 0.2, "track_width": 0.2, "via_diameter": 0.6, "via_drill": 0.3}
    return json.dumps({
        "board": {"design_settings": {"rules": rules, "rule_severities": {
            # Names of parts lie under pads and on each other where parts are close.
            "silk_over_copper": "ignore", "silk_overlap": "ignore"}}},
        "erc": {"rule_severities": {"lib_symbol_issues": "ignore", "footprint_link_issues": "ignore"}},
        "net_settings": {"classes": [netclass], "meta": {"version": 3}},
        "meta": {"filename": f"{NAME}.kicad_pro", "version": 3}}, indent=1) + "\n"


def parts_list(netlist):
    """What to order for one board: fitted parts, those of the same value, place and source in one row."""
    rows = {}
    for part in netlist.parts.values():
        if not part.fitted or part.kind == "TP":
            continue
        sources = [netlist.parts[source[3:]].sources[index] if source.startswith("as ") else source
                   for index, source in enumerate(part.sources)]
        rows.setdefault((part.value, part.footprint.split(":")[1], *sources), []).append(part.ref)
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["references", "quantity", "value", "footprint", "first source", "second source"])
    for (value, *rest), references in rows.items():
        table.writerow([" ".join(references), len(references), value, *rest])
    return out.getvalue()


def main():
    netlist = Netlist(FOLDER / "netlist.txt")
    files = {FOLDER / f"{NAME}.kicad_sch": Sheet(netlist).text(), FOLDER / f"{NAME}.kicad_pro": project(),
             FOLDER / "parts.csv": parts_list(netlist)}
    if "--check" in sys.argv:
        stale = [path.name for path, text in files.items()
                 if not path.exists() or path.read_text(encoding="utf-8") != text]
        sys.exit(f"run hardware/make.py, these are not of netlist.txt: {', '.join(stale)}" if stale else 0)
    for path, text in files.items():
        path.write_text(text, encoding="utf-8")
    print(f"{len(netlist.parts)} parts, {len(netlist.nets)} nets")


if __name__ == "__main__":
    main()
