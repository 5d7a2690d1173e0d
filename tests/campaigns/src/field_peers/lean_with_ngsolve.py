"""The leanest deck of NGSolve for one case: `lean_with_ngsolve.py CASE.json`.

Points and lines by netgen's SplineGeometry, without OpenCASCADE: only lines at which the material changes or
the mean is taken, each once, with the material on either side. Cubic or quartic elements for A_phi on the
half-plane (r, x), inner unknowns condensed, the exterior by Kelvin's transform as in with_ngsolve.py. With
saturation Newton's method begins with quadratic elements on the same mesh. The mean field in the core is all that
is computed. CASE.json has the `settings` to run, sizes in mm; prints one JSON line for each. Times leave out the
import of the libraries.
"""

import json
import math
import sys
import time

from netgen.geom2d import SplineGeometry
from ngsolve import (
    H1, BilinearForm, CoefficientFunction, GridFunction, Integrate, LinearForm, Mesh, Periodic, Projector,
    SetNumThreads, TaskManager, dx, grad, pi, sqrt, x, y,
)

MU_0 = 4e-7 * pi
# Numbers of netgen's domains; 0 is outside.
DOMAINS = ["air", "ring", "plate", "core", "mse", "exterior"]
AIR, RING, PLATE, CORE, MSE, EXTERIOR = range(1, 7)
# Points are compared in nanometres.
DIGITS = 6
# How far beside a line its materials are asked for, mm.
BESIDE = 1e-4
# Arcs of half a spheroid: netgen's curve is a circle's, and exact for a spheroid only as its pieces become short.
ARCS = 24
ANY = 1e99


class Parts:
    """What lies where, in mm."""

    def __init__(self, case):
        self.radius, self.centre = case["radius"], case["centre"]
        box = lambda part: (*part["r"], *part["x"])
        # The first that holds a point has it. Boards are not magnetic: they are air.
        self.boxes = [(RING, box(part)) for part in case["rings"]]
        self.boxes += [(PLATE, box(part)) for part in case["plates"]]
        self.boxes += [(AIR, box(part)) for part in case["boards"]]
        r, z = case["core"]
        self.boxes.append((CORE, (*r, *z)))
        self.semi = None
        for part in case["bodies"]:
            if "semi" in part:
                self.semi, self.middle = part["semi"], part["centre"]
            else:
                self.boxes.append((MSE, box(part)))

    def at(self, r, z):
        if r < 0:
            return 0
        for domain, (r0, r1, z0, z1) in self.boxes:
            if r0 < r < r1 and z0 < z < z1:
                return domain
        if self.semi and math.hypot(r / self.semi[0], (z - self.middle) / self.semi[1]) < 1:
            return MSE
        return AIR

    def on_spheroid(self, angle):
        """From its lower pole upwards."""
        a, c = self.semi
        return a * math.sin(angle), self.middle - c * math.cos(angle)

    def crossings(self, vertical, line):
        """Where the spheroid crosses a line: the other coordinate."""
        if not self.semi:
            return []
        a, c = self.semi
        share = line / a if vertical else (line - self.middle) / c
        if abs(share) >= 1:
            return []
        root = math.sqrt(1 - share * share)
        return [self.middle - c * root, self.middle + c * root] if vertical else [a * root]

    def straight(self):
        """Pieces of lines between points where anything meets them: `(from, to, left, right)`."""
        lines = {}
        for _, (r0, r1, z0, z1) in self.boxes:
            for line in ((True, r0, z0, z1), (True, r1, z0, z1), (False, z0, r0, r1), (False, z1, r0, r1)):
                lines.setdefault(line[:2], []).append(line[2:])
        lines[(True, 0.0)] = [(self.centre - self.radius, self.centre + self.radius)]
        pieces = []
        for (vertical, place), spans in lines.items():
            across = {end for span in spans for end in span}
            across |= {other for (crossed, other), _ in lines.items() if crossed != vertical}
            across |= set(self.crossings(vertical, place))
            if vertical and place == 0.0 and self.semi:
                across |= {self.middle - self.semi[1], self.middle + self.semi[1]}
            stops = sorted({round(stop, DIGITS) for stop in across})
            for low, high in zip(stops, stops[1:]):
                middle = 0.5 * (low + high)
                if not any(span[0] < middle < span[1] for span in spans):
                    continue
                if vertical:
                    sides = self.at(place - BESIDE, middle), self.at(place + BESIDE, middle)
                else:
                    # Left of a line towards greater r lies greater z.
                    sides = self.at(middle, place + BESIDE), self.at(middle, place - BESIDE)
                if sides[0] == sides[1]:
                    continue
                point = (lambda v: (place, v)) if vertical else (lambda v: (v, place))
                pieces.append((point(low), point(high), *sides))
        return pieces

    def curved(self):
        """Where the spheroid shows: `(from, to, left, right)` by angles."""
        if not self.semi:
            return []
        a, c = self.semi
        stops = {0.0, math.pi}
        for _, (r0, r1, z0, z1) in self.boxes:
            for z in (z0, z1):
                share = (self.middle - z) / c
                if abs(share) < 1:
                    stops.add(round(math.acos(share), 12))
            for r in (r0, r1):
                if 0 < r < a:
                    angle = math.asin(r / a)
                    stops |= {round(angle, 12), round(math.pi - angle, 12)}
        stops = sorted(stops)
        pieces = []
        for low, high in zip(stops, stops[1:]):
            r, z = self.on_spheroid(0.5 * (low + high))
            into, out = (self.at(share * r, self.middle + share * (z - self.middle))
                         for share in (1 - BESIDE, 1 + BESIDE))
            if out == into:
                continue
            if pieces and pieces[-1][1] == low and pieces[-1][2:] == (into, out):
                low = pieces.pop()[0]
            pieces.append((low, high, into, out))
        return pieces


def joined(pieces):
    """Straight pieces in one line, between the same materials, with nothing else at their joint: as one."""
    ends = {}
    for piece in pieces:
        for end in piece[:2]:
            ends.setdefault(end, []).append(piece)
    done = []
    for piece in pieces:
        last = done[-1] if done else None
        if (last and last[1] == piece[0] and last[2:] == piece[2:] and len(ends[piece[0]]) == 2
                and (last[0][0] == piece[1][0] or last[0][1] == piece[1][1])):
            done[-1] = (last[0], *piece[1:])
        else:
            done.append(piece)
    return done


def geometry(case, setting):
    parts = Parts(case)
    geo = SplineGeometry()
    numbers = {}
    corners = {(round(r, DIGITS), round(z, DIGITS))
               for part in case["plates"] + case["boards"]
               for r in part["r"] for z in part["x"] if r > 0}

    def number(point):
        key = round(point[0], DIGITS), round(point[1], DIGITS)
        if key not in numbers:
            numbers[key] = geo.AppendPoint(*key, maxh=setting["corner"] if key in corners else ANY)
        return numbers[key]

    curved = parts.curved()
    straight = parts.straight()
    touched = {tuple(round(v, DIGITS) for v in parts.on_spheroid(angle)) for arc in curved for angle in arc[:2]}
    # A joint at an end of an arc stays.
    for point in touched:
        straight.append((point, point, -1, -1))
    straight = [piece for piece in joined(straight) if piece[0] != piece[1]]
    near = {CORE: setting["core"], PLATE: setting["plate"]}
    for start, end, left, right in straight:
        name = "axis" if start[0] == 0 and end[0] == 0 else "inner"
        size = min(near.get(left, ANY), near.get(right, ANY))
        geo.Append(["line", number(start), number(end)], leftdomain=left, rightdomain=right, bc=name, maxh=size)
    for low, high, left, right in curved:
        count = math.ceil(ARCS * (high - low) / math.pi)
        step = (high - low) / count
        for k in range(count):
            at, to = low + k * step, low + (k + 1) * step
            r, z = parts.on_spheroid(0.5 * (at + to))
            stretch = 1 / math.cos(0.5 * step)
            tip = geo.AppendPoint(stretch * r, parts.middle + stretch * (z - parts.middle))
            geo.Append(["spline3", number(parts.on_spheroid(at)), tip, number(parts.on_spheroid(to))],
                       leftdomain=left, rightdomain=right, bc="inner")
    # The half-disc's arc, and that of the exterior, whose points are its images.
    radius, centre, shift = parts.radius, parts.centre, 3 * parts.radius
    arc = lambda point: geo.AppendPoint(*point)
    top = [number((0.0, centre - radius)), arc((radius, centre - radius)), arc((radius, centre)),
           arc((radius, centre + radius)), number((0.0, centre + radius))]
    image = [arc((r, z + shift)) for r, z in ((0, centre - radius), (radius, centre - radius), (radius, centre),
                                              (radius, centre + radius), (0, centre + radius))]
    for k in (0, 2):
        master = geo.Append(["spline3", *top[k:k + 3]], leftdomain=AIR, rightdomain=0, bc="kelvin", maxh=setting["far"])
        geo.Append(["spline3", *image[k:k + 3]], leftdomain=EXTERIOR, rightdomain=0, bc="image",
                   copy=master, maxh=setting["far"])
    middle = geo.AppendPoint(0, centre + shift)
    geo.Append(["line", image[4], middle], leftdomain=EXTERIOR, rightdomain=0, bc="axis", maxh=setting["far"])
    geo.Append(["line", middle, image[0]], leftdomain=EXTERIOR, rightdomain=0, bc="axis", maxh=setting["far"])
    for k, name in enumerate(DOMAINS, 1):
        geo.SetMaterial(k, name)
    for domain, size in ((CORE, "core"), (PLATE, "plate"), (MSE, "mse"), (AIR, "far"), (EXTERIOR, "far")):
        geo.SetDomainMaxH(domain, setting[size])
    return geo


def plate_reluctivity(law, b2):
    """nu/nu0 of B^2."""
    t = (b2 / law["knee"] ** 2) ** (law["exponent"] / 2)
    return 1 / law["mu"] + (1 - 1 / law["mu"]) * t / (1 + t)


def newton(case, space, curl, fixed, rhs, field):
    """From the field that is there; ends at a residual that is worth 1e-6 of it. The number of steps."""
    mesh, mse = space.mesh, case["mse"]
    plates = mesh.MaterialCF({"plate": 1.0}, default=0.0)
    powder = mesh.MaterialCF({"mse": 1.0, "core": 1.0}, default=0.0)
    form = BilinearForm(space, symmetric=True)
    u, v = space.TnT()
    b2 = curl(u) * curl(u) + 1e-30
    b = sqrt(b2)
    chi, sat = mse["mu"] - 1, mse["saturation"] * MU_0
    q = sat * (1 + chi) - chi * b
    soft = 2 * sat / (q + sqrt(q * q + 4 * chi * b * sat))
    nu = fixed * (1 - plates) * (1 - powder) + plates * plate_reluctivity(case["plate"], b2) + powder * soft
    form += nu * (curl(u) * curl(v)) * x * dx
    residual, step, old = (field.vec.CreateVector() for _ in range(3))
    free = Projector(space.FreeDofs(), True)

    def norm():
        form.Apply(field.vec, residual)
        residual.data -= rhs.vec
        residual.data = free * residual
        return residual.Norm()

    load = rhs.vec.CreateVector()
    load.data = free * rhs.vec
    size = norm()
    for steps in range(1, 40):
        form.AssembleLinearization(field.vec)
        step.data = form.mat.Inverse(space.FreeDofs(), "sparsecholesky") * residual
        share, old.data = 1.0, field.vec
        while True:
            field.vec.data = old - share * step
            now = norm()
            if now < size or share < 1e-3:
                break
            share /= 2
        size = now
        if size < 1e-6 * load.Norm():
            break
    return steps


def solve(case, setting):
    start = time.perf_counter()
    mesh = Mesh(geometry(case, setting).GenerateMesh(
        maxh=setting["far"], grading=setting["grading"], optsteps2d=0, delaunay2d=setting["delaunay"]))
    mesh.Curve(setting["order"])
    meshed = time.perf_counter() - start
    # Lengths are in mm, A in T mm, so that B is in T; the equation is divided by nu0.
    radius, centre = case["radius"], case["centre"]
    rho2 = x * x + (y - centre - 3 * radius) ** 2
    mse, plate = case["mse"], case["plate"]
    elastomer = 1 / mse["mu"] if case["bodies"] else 1.0
    fixed = mesh.MaterialCF(
        {"mse": elastomer, "core": elastomer, "plate": 1 / plate["mu"], "exterior": rho2 / radius**2}, default=1.0)
    density = case["current"] / case["ring_area"]

    def curl(w):
        return CoefficientFunction((-grad(w)[1], grad(w)[0] + w / x))

    steps, field = [], None
    with TaskManager():
        # With saturation from elements of second order on the same mesh.
        for order in [2, setting["order"]] if case["saturates"] else [setting["order"]]:
            space = Periodic(H1(mesh, order=order, dirichlet="axis"))
            u, v = space.TnT()
            # mu0 is 1e3 MU_0 in T mm/A.
            rhs = LinearForm(space)
            rhs += 1e3 * MU_0 * density * v * x * dx(definedon=mesh.Materials("ring"))
            rhs.Assemble()
            before, field = field, GridFunction(space)
            if before is None:
                condense = order > 1
                form = BilinearForm(space, symmetric=True, condense=condense)
                form += fixed * (curl(u) * curl(v)) * x * dx
                form.Assemble()
                load = rhs.vec.CreateVector()
                load.data = rhs.vec
                if condense:
                    load.data += form.harmonic_extension_trans * rhs.vec
                field.vec.data = form.mat.Inverse(space.FreeDofs(condense), "sparsecholesky") * load
                if condense:
                    field.vec.data += form.harmonic_extension * field.vec
                    field.vec.data += form.inner_solve * load
            else:
                field.Set(before)
            if case["saturates"]:
                steps.append(newton(case, space, curl, fixed, rhs, field))
        b = curl(field)
        size = sqrt(b * b + 1e-60)
        core = mesh.Materials("core")
        mean = Integrate(size * x, mesh, definedon=core) / Integrate(x, mesh, definedon=core)
    return {
        "setting": setting, "unknowns": space.ndof, "elements": mesh.ne, "mesh_s": meshed,
        "wall_s": time.perf_counter() - start, "core_mean_T": mean, "steps": steps,
    }


def main():
    with open(sys.argv[1]) as file:
        case = json.load(file)
    for setting in case["settings"]:
        SetNumThreads(setting["threads"])
        print(json.dumps(solve(case, setting)), flush=True)


main()
