"""Solves one case with NGSolve on ever finer meshes: `ngsolve.py CASE.json`.

Cubic elements for A_phi on the half-plane (r, x), the exterior folded in by Kelvin's transform:
with nu = nu0 (rho/R)^2 there, psi = r A is the same on the arc that both half-discs share.
Prints one JSON line for each mesh. Times leave out the import of the libraries.
"""

import json
import sys
import time

from netgen.occ import IdentificationType, Glue, OCCGeometry, WorkPlane, gp_Trsf, gp_Vec
from ngsolve import (
    H1, BilinearForm, CoefficientFunction, GridFunction, IfPos, Integrate, LinearForm, Mesh,
    Periodic, Projector, TaskManager, grad, dx, pi, sqrt, x, y,
)

MU_0 = 4e-7 * pi
ORDER = 3


def box(r, z):
    return WorkPlane().MoveTo(r[0], z[0]).Rectangle(r[1] - r[0], z[1] - z[0]).Face()


def half_disc(radius, centre):
    return WorkPlane().MoveTo(0, centre - radius).Direction(1, 0).Arc(radius, 180).Close().Face()


def body(shape):
    if "semi" in shape:
        (a, c), centre = shape["semi"], shape["centre"]
        whole = WorkPlane().MoveTo(0, centre).Ellipse(a, c).Face()
        return whole * box((0, 2 * a), (centre - 2 * c, centre + 2 * c))
    return box(shape["r"], shape["x"])


def geometry(case, h):
    """All faces, named; lengths in mm, as the mesher's tolerances want them."""
    radius, centre = case["radius"], case["centre"]
    rings = [box(ring["r"], ring["x"]) for ring in case["rings"]]
    plates = [box(plate["r"], plate["x"]) for plate in case["plates"]]
    boards = [box(board["r"], board["x"]) for board in case["boards"]]
    bodies = [body(shape) for shape in case["bodies"]]
    core = box(*case["core"])
    faces = []

    def add(face, name, size):
        face.faces.name = name
        face.faces.maxh = size
        faces.append(face)

    for plate in plates:
        core = core - plate
    solid = rings + plates
    for ring in rings:
        add(ring, "ring", h)
    for plate in plates:
        add(plate, "plate", h / 2)
    for board in boards:
        for other in rings:
            board = board - other
        add(board, "board", h)
    add(core, "core", h / 2)
    air = half_disc(radius, centre)
    for shape in bodies:
        for other in solid + boards + [core]:
            shape = shape - other
        add(shape, "mse", h)
    for other in solid + boards + [core] + bodies:
        air = air - other
    add(air, "air", 6 * h)
    inside = Glue(faces)
    shift = 3 * radius
    outside = half_disc(radius, centre + shift)
    outside.faces.name = "exterior"
    outside.faces.maxh = 6 * h
    # Only where permeable parts have corners is the field singular.
    sharp = {(r, z) for part in case["plates"] + case["boards"] for r in part["r"] for z in part["x"]}
    for corner in inside.vertices:
        if any(abs(corner.p[0] - r) + abs(corner.p[1] - z) < 1e-6 for r, z in sharp):
            corner.maxh = h / case["corner_grading"]
    # The arc is the longest line of either half-disc.
    arc, image = (max(half.edges, key=lambda edge: edge.mass) for half in (inside, outside))
    move = gp_Trsf.Translation(gp_Vec(0, shift, 0))
    arc.Identify(image, "kelvin", IdentificationType.PERIODIC, move)
    for shape in (inside, outside):
        for edge in shape.edges:
            if abs(edge.center.x) < 1e-9:
                edge.name = "axis"
    return OCCGeometry(Glue([inside, outside]), dim=2)


def plate_reluctivity(law, b2):
    """nu/nu0 of B^2."""
    t = (b2 / law["knee"] ** 2) ** (law["exponent"] / 2)
    return 1 / law["mu"] + (1 - 1 / law["mu"]) * t / (1 + t)


def solve(case, h):
    start = time.perf_counter()
    mesh = Mesh(geometry(case, h).GenerateMesh(maxh=6 * h, grading=case["grading"]))
    mesh.Curve(ORDER)
    meshed = time.perf_counter() - start
    # Lengths are in mm, A in T mm, so that B is in T; the equation is divided by nu0.
    space = Periodic(H1(mesh, order=ORDER, dirichlet="axis"))
    u, v = space.TnT()
    radius, centre = case["radius"], case["centre"]
    shift = 3 * radius
    rho2 = x * x + (y - centre - shift) ** 2
    mse = case["mse"]
    plate = case["plate"]
    nonlinear = case["saturates"]
    fixed = mesh.MaterialCF(
        {"mse": 1 / mse["mu"], "core": 1 / mse["mu"] if case["bodies"] else 1.0,
         "plate": 1 / plate["mu"], "exterior": rho2 / radius**2},
        default=1.0,
    )
    density = case["current"] / case["ring_area"]
    ring = mesh.MaterialCF({"ring": density}, default=0.0)

    def curl(w):
        return CoefficientFunction((-grad(w)[1], grad(w)[0] + w / x))

    rhs = LinearForm(space)
    # mu0 is 1e3 MU_0 in T mm/A.
    rhs += 1e3 * MU_0 * ring * v * x * dx
    field = GridFunction(space)
    steps = 0
    with TaskManager():
        rhs.Assemble()
        if not nonlinear:
            form = BilinearForm(space, symmetric=True)
            form += fixed * (curl(u) * curl(v)) * x * dx
            form.Assemble()
            inverse = form.mat.Inverse(space.FreeDofs(), "sparsecholesky")
            field.vec.data = inverse * rhs.vec
            steps = 1
        else:
            form = BilinearForm(space, symmetric=True)
            others = mesh.MaterialCF({"plate": 0.0}, default=1.0) * fixed
            in_plate = mesh.MaterialCF({"plate": 1.0}, default=0.0)
            powder = mesh.MaterialCF({"mse": 1.0, "core": 1.0}, default=0.0) * mse.get("saturates", 0)
            b2 = curl(u) * curl(u) + 1e-30
            nu = others * (1 - powder) + in_plate * plate_reluctivity(plate, b2)
            if mse.get("saturates", 0):
                chi, sat = mse["mu"] - 1, mse["saturation"] * MU_0
                b = sqrt(b2)
                q = sat * (1 + chi) - chi * b
                nu = nu + powder * 2 * sat / (q + sqrt(q * q + 4 * chi * b * sat))
            form += nu * (curl(u) * curl(v)) * x * dx
            residual, step = field.vec.CreateVector(), field.vec.CreateVector()

            def norm(state):
                form.Apply(state, residual)
                residual.data -= rhs.vec
                residual.data = Projector(space.FreeDofs(), True) * residual
                return residual.Norm()

            first = None
            for steps in range(1, 60):
                form.AssembleLinearization(field.vec)
                size = norm(field.vec)
                first = first or size
                step.data = form.mat.Inverse(space.FreeDofs(), "sparsecholesky") * residual
                share = 1.0
                old = field.vec.CreateVector()
                old.data = field.vec
                while True:
                    field.vec.data = old - share * step
                    if norm(field.vec) < size or share < 1e-3:
                        break
                    share /= 2
                if norm(field.vec) < 1e-9 * first:
                    break
        b = curl(field)
        size = sqrt(b * b + 1e-60)
        core = mesh.Materials("core")
        volume = Integrate(x, mesh, definedon=core)
        mean = Integrate(size * x, mesh, definedon=core) / volume
        linkage = Integrate(
            2 * pi * x * field * mesh.MaterialCF({"ring": 1 / case["ring_area"]}, default=0.0), mesh
        )
        r = 1e-4 * radius
        at_centre = mesh(r, case["middle"])
        centre_field = b[1](at_centre)
    return {
        "h": h,
        "unknowns": space.ndof,
        "mesh_s": meshed,
        "wall_s": time.perf_counter() - start,
        "core_mean_T": mean,
        "centre_T": centre_field,
        "inductance_H": 1e-6 * linkage / case["current"],
        "steps": steps,
    }


def main():
    with open(sys.argv[1]) as file:
        case = json.load(file)
    for h in case["sizes"]:
        print(json.dumps(solve(case, h)), flush=True)


main()
