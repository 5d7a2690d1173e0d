"""What other programs read of `palpate field export`."""

import csv

import meshio
import numpy as np

# Parts of the design A: the elastomer alone.
MSE = 1


def test_vtk_and_csv_hold_the_field_that_solve_states(palpate):
    palpate.run("field", "export", "A", "--vtk", "A.vtk", "--csv", "A.csv", "--step", "1")
    figures = palpate.json("field", "solve", "A")

    mesh = meshio.read(palpate.folder / "A.vtk")
    triangles = mesh.cells_dict["triangle"]
    corners, field = mesh.points[triangles], mesh.point_data["B_T_per_A"][triangles]
    assert np.abs(field[..., 2]).max() == 0
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = 0.5 * (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
    assert areas.min() > 0
    middles = corners.mean(axis=1)
    # The disc between the boards, by which the mean is defined.
    core = (middles[:, 0] < 8e-3) & (middles[:, 1] > 1.64e-3) & (middles[:, 1] < 6.64e-3)
    weights = (areas * middles[:, 0])[core]
    mean = np.average(np.linalg.norm(field, axis=2).mean(axis=1)[core], weights=weights)
    assert abs(mean / figures["core_mean_T_per_A"] - 1) < 2e-3
    assert np.unique(mesh.cell_data["part"][0][core]).tolist() == [MSE]

    with (palpate.folder / "A.csv").open() as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    centre = min(rows, key=lambda row: row["r_mm"] ** 2 + (row["x_mm"] - 4.14) ** 2)
    assert abs(centre["B_x_T_per_A"] / figures["centre_T_per_A"] - 1) < 1e-2
    assert centre["flux_Wb_per_A"] == 0 and centre["part"] == MSE
