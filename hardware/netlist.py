"""Reads netlist.txt: kinds of parts, parts in blocks, and nets. Refuses what does not fit together."""

TYPES = {"i": "input", "o": "output", "b": "bidirectional", "p": "power_in", "w": "power_out",
         "c": "open_collector", "x": "passive", "n": "no_connect"}


class Part:
    def __init__(self, block, fitted, text):
        head, *sources = [field.strip() for field in text.split("|")]
        self.ref, self.kind, self.value, self.footprint = head.split()
        self.block, self.fitted, self.sources = block, fitted, sources


class Netlist:
    def __init__(self, path):
        self.kinds, self.parts, self.nets, self.driven = {}, {}, {}, []
        block = None
        for number, line in enumerate(open(path, encoding="utf-8"), 1):
            word, _, rest = line.strip().partition(" ")
            rest = rest.strip()
            if word == "kind":
                name, *pins = rest.split()
                self.kinds.setdefault(name, []).extend(self.pin(pin) for pin in pins)
            elif word == "block":
                block = rest
            elif word in ("part", "-part"):
                part = Part(block, word == "part", rest)
                assert part.ref not in self.parts, f"{path}:{number}: {part.ref} is there twice"
                assert part.kind in self.kinds, f"{path}:{number}: unknown kind {part.kind}"
                assert len(part.sources) == 2, f"{path}:{number}: {part.ref} needs two sources"
                self.parts[part.ref] = part
            elif word == "net":
                name, *pins = rest.split()
                self.nets.setdefault(name, []).extend(pins)
            elif word == "driven":
                self.driven += rest.split()
            else:
                assert word in ("", "#") or word.startswith("#"), f"{path}:{number}: unknown word {word}"
        self.pads = self.connect(path)

    @staticmethod
    def pin(text):
        number, _, name = text.partition("=")
        name, _, kind = name.partition(":")
        return number, name, TYPES[kind or "x"]

    def connect(self, path):
        """Returns the net of each (part, pad number)."""
        pads = {}
        for net, pins in self.nets.items():
            assert len(pins) > 1, f"{path}: net {net} has one pin"
            for pin in pins:
                ref, name = pin.split(".")
                numbers = [n for n, known, _ in self.kinds[self.parts[ref].kind] if known == name]
                assert numbers, f"{path}: {pin} of net {net} does not exist"
                for number in numbers:
                    assert (ref, number) not in pads, f"{path}: {pin} is in two nets"
                    pads[ref, number] = net
        return pads
