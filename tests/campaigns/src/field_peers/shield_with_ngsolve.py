"""Two coils and a copper plane (shield.toml) by NGSolve: L and R of the upper coil, and the coils' mutual inductance.

Elements of fifth order for A_phi on the half-plane (r, x), which ends at 0.4 m, where a dipole's share is
1e-5. Prints two meshes, to show what each is worth. Lengths in mm in the geometry.
"""

import math

from netgen.occ import Glue, OCCGeometry, WorkPlane
from ngsolve import H1, BilinearForm, GridFunction, Integrate, LinearForm, Mesh, TaskManager, grad, dx, x

NU_0 = 1e7 / (4 * math.pi)
SIGMA, TURNS = 5.8e7, 50
REACH = 400


def box(r, z, name, size):
    face = WorkPlane().MoveTo(r[0], z[0]).Rectangle(r[1] - r[0], z[1] - z[0]).Face()
    face.faces.name = name
    face.faces.maxh = size
    return face


def mesh(fine):
    above, below = [box((4, 7), z, name, fine) for z, name in [((1, 2.5), "above"), ((-3, -1.5), "below")]]
    plane = box((0, 15), (-0.035, 0), "plane", fine / 4)
    near = box((0, 25), (-15, 15), "near", 2 * fine) - above - below - plane
    air = WorkPlane().MoveTo(0, -REACH).Direction(1, 0).Arc(REACH, 180).Close().Face()
    air.faces.name = "air"
    air = air - box((0, 25), (-15, 15), "near", 1)
    whole = Glue([above, below, plane, near, air])
    for edge in whole.edges:
        on_axis, far = abs(edge.center.x) < 1e-9, edge.center.x > REACH / 2
        edge.name = "axis" if on_axis else "outer" if far else "inside"
    return Mesh(OCCGeometry(whole, dim=2).GenerateMesh(maxh=60, grading=0.2))


def solve(fine, frequency):
    half_plane = mesh(fine)
    r, omega = x * 1e-3, 2 * math.pi * frequency
    space = H1(half_plane, order=5, complex=True, dirichlet="axis|outer")
    u, v = space.TnT()
    mm = 1e3
    stiff = BilinearForm(space, symmetric=True)
    b = lambda w: (mm * grad(w)[1], w / r + mm * grad(w)[0])
    (ur, ux), (vr, vx) = b(u), b(v)
    stiff += NU_0 * r * (ur * vr + ux * vx) * dx
    stiff += 1j * omega * SIGMA * r * u * v * dx("plane")
    density = TURNS / (3e-3 * 1.5e-3)
    load = LinearForm(density * r * v * dx("above"))
    field = GridFunction(space)
    with TaskManager():
        stiff.Assemble()
        load.Assemble()
        field.vec.data = stiff.mat.Inverse(space.FreeDofs(), "umfpack") * load.vec
    linked = {name: 2 * math.pi * 1e-6 * density * Integrate(r * field, half_plane, order=12,
              definedon=half_plane.Materials(name)) for name in ("above", "below")}
    return space.ndof, linked["above"], linked["below"], omega


for frequency in (1e5, 3e6):
    for fine in (0.6, 0.3):
        count, own, mutual, omega = solve(fine, frequency)
        print(f"{frequency:.0e} Hz, {count} unknowns: L {own.real * 1e6:.6f} uH, "
              f"R of the plane {-own.imag * omega:.6f} ohm, "
              f"mutual {mutual.real * 1e6:.6f} {mutual.imag * 1e6:+.6f}i uH", flush=True)
