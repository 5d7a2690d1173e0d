#!/usr/bin/env python3
"""Checks the board with KiCad 9 (`kicad-cli`): the schematic is of netlist.txt, ERC has no finding, the nets that
KiCad reads from the schematic are those of netlist.txt, and DRC of the board that board.py has made has no finding:
rules, open connections, and board against schematic. Names of parts under pads and on each other are not looked at."""
import pathlib
import re
import subprocess
import sys
import tempfile

from netlist import Netlist

FOLDER = pathlib.Path(__file__).parent / "palpate-one"
SCHEMATIC = FOLDER / "palpate-one.kicad_sch"


def run(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    print(f"{' '.join(str(word) for word in command[1:4])}: {'ok' if done.returncode == 0 else 'fails'}")
    return done.returncode


def nets_of_kicad(path):
    """Returns the pads of each net of a netlist in KiCad's format; nets of one pad are left out."""
    nets = {}
    for net in re.split(r"\(net\s", path.read_text(encoding="utf-8"))[1:]:
        name = re.search(r'\(name "/?([^"]*)"', net)[1]
        pads = {tuple(pad) for pad in re.findall(r'\(node\s*\(ref "([^"]+)"\)\s*\(pin "([^"]+)"', net)}
        if len(pads) > 1:
            nets[name] = pads
    return nets


def main():
    stale = run(sys.executable, pathlib.Path(__file__).parent / "make.py", "--check")
    with tempfile.TemporaryDirectory() as folder:
        report, exported = pathlib.Path(folder) / "erc.rpt", pathlib.Path(folder) / "nets"
        findings = run("kicad-cli", "sch", "erc", "--severity-all", "--exit-code-violations", "-o", report, SCHEMATIC)
        if findings:
            print(report.read_text(encoding="utf-8"))
        run("kicad-cli", "sch", "export", "netlist", "-o", exported, SCHEMATIC)
        of_kicad = nets_of_kicad(exported)
        rules = run("kicad-cli", "pcb", "drc", "--schematic-parity", "--severity-all", "--exit-code-violations",
                    "-o", report, SCHEMATIC.with_suffix(".kicad_pcb"))
        if rules:
            print(report.read_text(encoding="utf-8"))
    ours = {}
    for pad, net in Netlist(FOLDER / "netlist.txt").pads.items():
        ours.setdefault(net, set()).add(pad)
    differ = [net for net in sorted(ours.keys() | of_kicad.keys()) if ours.get(net) != of_kicad.get(net)]
    print(f"{len(ours)} nets, {sum(map(len, ours.values()))} pads; different in KiCad: {', '.join(differ) or 'none'}")
    sys.exit(bool(stale or findings or rules or differ))


main()
