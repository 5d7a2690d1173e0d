"""Presses rigid indenters on elastic layers with ContactMechanics: `with_contactmechanics.py CASES.json`.

Its layer is bonded to a rigid base, on a periodic grid; without a thickness it is a half-space that does not repeat.
Prints one JSON line for each case, with a list of results on ever finer grids. Lengths in m, forces in N.
"""

import json
import sys

import numpy as np
from ContactMechanics import FreeFFTElasticHalfSpace, PeriodicFFTElasticHalfSpace
from ContactMechanics.Systems import NonSmoothContactSystem
from SurfaceTopography import Topography

BEYOND_M = -1.0


def sphere(radius, x, y):
    square = radius**2 - x**2 - y**2
    return np.where(square > 0, np.sqrt(np.maximum(square, 0)) - radius, BEYOND_M)


def heights(case, x, y):
    """Height of the indenter's face: none above the point whose depth counts, except of a tilted one."""
    kind = case["kind"]
    if kind == "ball":
        return sphere(case["radius_m"], x, y)
    if kind == "pin":
        return np.where(np.hypot(x, y) <= case["radius_m"], 0.0, BEYOND_M)
    sine, cosine = np.sin(case["toward_rad"]), np.cos(case["toward_rad"])
    along, across = cosine * x + sine * y, cosine * y - sine * x
    if kind == "tilted":
        return np.where(np.hypot(x, y) <= case["radius_m"], np.tan(case["tilt_rad"]) * along, BEYOND_M)
    if kind == "bar":
        inside = (abs(along) <= case["length_m"] / 2) & (abs(across) <= case["width_m"] / 2)
        return np.where(inside, 0.0, BEYOND_M)
    half = case["apart_m"] / 2
    one, other = (sphere(case["radius_m"], along + side * half, across) for side in (-1, 1))
    return np.maximum(one, other)


def substrate(case, cells, side):
    poisson = case["poisson"]
    young = 2 * case["shear_modulus_pa"] * (1 + poisson)
    if case["thickness_m"] is None:
        return FreeFFTElasticHalfSpace((cells,) * 2, young / (1 - poisson**2), (side,) * 2)
    return PeriodicFFTElasticHalfSpace(
        (cells,) * 2, young, (side,) * 2, thickness=case["thickness_m"], poisson=poisson
    )


def round_area(force, square, radius, cell):
    """Area up to where the square of the pressure vanishes, from the cells before the rim. Cells that are
    in contact in part count as a whole, by which their sum is too large by two tenths of a cell along the rim."""
    inner = max(0.6 * radius, radius - 12 * cell)
    near = (square > inner**2) & (square < (radius - 1.5 * cell) ** 2)
    roots = np.roots(np.polyfit(square[near], force[near] ** 2, 2))
    return np.pi * min(roots.real, key=lambda root: abs(root - radius**2))


def press(case, cells):
    side = case["side_m"]
    place = (np.arange(cells) + 0.5) * side / cells - side / 2
    x, y = np.meshgrid(place, place, indexing="ij")
    surface = Topography(heights(case, x, y), (side,) * 2)
    system = NonSmoothContactSystem(substrate(case, cells, side), surface)
    depth = case["depth_m"]
    result = system.minimize_proxy(offset=depth, pentol=1e-6 * depth, maxiter=3000)
    if not result.success:
        sys.exit(f"{case}: {result.message}")
    force = np.asarray(result.jac)[:cells, :cells]
    area = float((force > 0).sum()) * (side / cells) ** 2
    if case["kind"] == "ball":
        area = round_area(force, x**2 + y**2, np.sqrt(area / np.pi), side / cells)
    return {
        "force_n": force.sum(),
        "area_m2": area,
        "centre_m": (force * x).sum() / force.sum(),
    }


def main():
    with open(sys.argv[1]) as file:
        cases = json.load(file)
    for case in cases:
        print(json.dumps([press(case, cells) for cells in case["cells"]]), flush=True)


main()
