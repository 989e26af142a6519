#!/usr/bin/python3
"""dump nurbs/vtk, read back by Debian's VTK: the cells are the exact surfaces, placed as the particles are."""
import json
import math
import pathlib
import re
import sys
import unittest
import xml.etree.ElementTree

import numpy as np
import vtk

import deck

sys.path.insert(0, str(deck.ROOT / "examples" / "common"))
from nurbs_vtu import read_grid, read_patches, read_time  # noqa: E402

AXES = np.array([1.0, 1.5, 0.7])
TURN = np.array([1.0, 2.0, 3.0, 4.0]) / math.sqrt(30)
DECK = """
units si
newton off
communicate single vel yes
atom_style nurbs ellipsoid.json pebble.json
atom_modify map array sort 0 0
boundary f f f
read_data in.data
neighbor 0.1 bin
fix motion all nve/nurbs
timestep 1e-3
dump scene all nurbs/vtk 10 {file}
run 20
"""
# Written with the second particle first and far apart: two ranks own one each.
ATOMS = [(2, 1, 2, 0.25, 1000.0, 3.0, 0.0, -5.0, 1.0, 0.0, 0.0, 0.0),
         (1, 1, 1, 2.0, 1000.0, 1.0, -2.0, 5.0, *map(float, TURN))]
VELOCITIES = [(1, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0), (2, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0)]


def rotation(q):
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def evaluate(cell, u, v):
    """A point of a cell by VTK's own evaluation."""
    point, weights = [0.0] * 3, [0.0] * cell.GetNumberOfPoints()
    cell.EvaluateLocation(vtk.reference(0), [u, v, 0], point, weights)
    return np.array(point)


def area(grid, level):
    """Area of VTK's own tessellation of a grid, each cell cut `level` times."""
    surface = vtk.vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.SetNonlinearSubdivisionLevel(level)
    triangles = vtk.vtkTriangleFilter()
    triangles.SetInputConnection(surface.GetOutputPort())
    mass = vtk.vtkMassProperties()
    mass.SetInputConnection(triangles.GetOutputPort())
    mass.Update()
    return mass.GetSurfaceArea()


def cells_of(grid, body):
    """The grid's cells of one particle, as a grid."""
    chosen = vtk.vtkThreshold()
    chosen.SetInputData(grid)
    chosen.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_CELLS, "id")
    chosen.SetLowerThreshold(body)
    chosen.SetUpperThreshold(body)
    chosen.Update()
    return chosen.GetOutput()


class DumpVtk(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.files = {"ellipsoid.json": deck.shape_file("ellipsoid", *AXES), "pebble.json": deck.shape_file("pebble"),
                     "in.data": deck.data_file(ATOMS, VELOCITIES)}
        cls.result = deck.run_ok(DECK.format(file="out/scene-*.vtu"), ranks=2, files=cls.files)
        cls.grid = read_grid(cls.result.path / "out/scene-0.vtu")

    def test_cells_are_rational_bezier_quadrilaterals(self):
        self.assertEqual(self.grid.GetNumberOfCells(), 12)
        for k in range(12):
            self.assertEqual(self.grid.GetCellType(k), vtk.VTK_BEZIER_QUADRILATERAL)
            order = [self.grid.GetCell(k).GetOrder(axis) for axis in range(2)]
            self.assertEqual(order, [4, 4] if k < 6 else [3, 3])

    def test_weights_and_degrees_are_attributes(self):
        """ParaView and VTK use only arrays that are named as attributes."""
        weights = self.grid.GetPointData().GetRationalWeights()
        self.assertIsNotNone(weights)
        self.assertIsNotNone(self.grid.GetCellData().GetHigherOrderDegrees())
        values = np.array([weights.GetValue(k) for k in range(weights.GetNumberOfTuples())])
        self.assertGreater(np.ptp(values[:150]), 0.1)  # six biquartic rational patches
        self.assertEqual(set(values[150:]), {1.0})     # six bicubic polynomial ones

    def test_cell_data_is_that_of_the_particle(self):
        patches = read_patches(self.grid)
        for k, patch in enumerate(patches):
            first = k < 6
            self.assertEqual(patch.data["id"][0], 1 if first else 2)
            self.assertEqual(patch.data["shape"][0], 1 if first else 2)
            self.assertEqual(patch.data["type"][0], 1)
            self.assertEqual(patch.data["patch"][0], k % 6)
            np.testing.assert_array_equal(patch.data["velocity"], [1, 2, 3] if first else [0, 0, 0])
            np.testing.assert_allclose(patch.data["omega"], [0, 0, 0] if first else [0, 0, 5], atol=1e-14)

    def test_ellipsoid_evaluated_by_vtk_is_exact_and_placed(self):
        last = read_grid(self.result.path / "out/scene-20.vtu")
        for grid, time in ((self.grid, 0.0), (last, 0.02)):
            center = np.array(ATOMS[1][5:8]) + time * np.array([1.0, 2.0, 3.0])
            worst = 0
            for k in range(6):
                cell = grid.GetCell(k)
                for u in np.linspace(0, 1, 6):
                    for v in np.linspace(0, 1, 6):
                        local = rotation(TURN).T @ (evaluate(cell, u, v) - center) / (2 * AXES)
                        worst = max(worst, abs(local @ local - 1))
            self.assertLess(worst, 1e-13)

    def test_normals_point_out(self):
        t = np.linspace(0.1, 0.9, 4)
        for k, patch in enumerate(read_patches(self.grid)):
            x, n = patch.evaluate(t, t)
            center = np.array(ATOMS[1 if k < 6 else 0][5:8])
            self.assertGreater(np.min(np.sum((x - center) * n, axis=-1)), 0)

    def test_pebble_is_that_of_its_file(self):
        """Against the control points of the shape file; its origin is not the centre of mass, so up to a shift."""
        data = json.loads(self.files["pebble.json"])["shape"]["data"]
        mine, files = [], []
        for k, surface in enumerate(data):
            net = np.array(surface["control_points"]["points"]).reshape(4, 4, 3)
            for u in (0, 0.3, 1):
                for v in (0, 0.6, 1):
                    basis = [np.array([math.comb(3, i) * s**i * (1 - s) ** (3 - i) for i in range(4)]) for s in (u, v)]
                    files.append(0.25 * np.einsum("i,j,ijk->k", *basis, net))
                    mine.append(evaluate(self.grid.GetCell(6 + k), u, v))
        shift = np.array(mine) - np.array(files)
        self.assertLess(np.max(np.ptp(shift, axis=0)), 1e-14)

    def test_area_converges_to_the_closed_form(self):
        """VTK's triangles on a spheroid: the error falls by four with each cut of the cells."""
        files = {**self.files, "ellipsoid.json": deck.shape_file("ellipsoid", 1, 1, 2)}
        run = deck.run_ok(DECK.format(file="scene-*.vtu"), files=files)
        grid = cells_of(read_grid(run.path / "scene-0.vtu"), 1)
        e = math.sqrt(1 - 1 / 4)
        exact = 4 * (2 * math.pi * (1 + 2 / e * math.asin(e)))
        errors = [1 - area(grid, level) / exact for level in (2, 3, 4)]
        self.assertLess(abs(errors[2]), 2e-3)
        for coarse, fine in zip(errors, errors[1:]):
            self.assertAlmostEqual(coarse / fine, 4, delta=0.3)

    def test_collection_lists_the_times(self):
        folder = self.result.path / "out"
        text = (folder / "scene.pvd").read_text()
        for step in (0, 10, 20):
            self.assertIn(f'file="scene-{step}.vtu"', text)
            self.assertAlmostEqual(read_time(read_grid(folder / f"scene-{step}.vtu")), step * 1e-3, delta=1e-15)
        self.assertEqual(sorted(f.name for f in folder.iterdir()),
                         ["scene-0.vtu", "scene-10.vtu", "scene-20.vtu", "scene.pvd"])

    def test_collection_goes_on_after_a_restart(self):
        """Entries before the restart's step stay, those after it go; a run from step 0 begins anew."""
        first = deck.run_ok(DECK.format(file="scene-*.vtu") + "write_restart half.rst\nrun 20\n", files=self.files)
        steps = [0, 10, 20, 30, 40]
        self.assertEqual(self.listed(first), [(f"scene-{k}.vtu", k * 1e-3) for k in steps])
        text = DECK[DECK.index("neighbor"):].format(file="scene-*.vtu").replace("run 20", "run 10")
        start = "units si\nnewton off\ncommunicate single vel yes\natom_modify sort 0 0\nread_restart half.rst\n"
        kept = {name: first.path / name for name in ("half.rst", "scene.pvd")}
        again = deck.run_ok(start + text, files=kept)
        self.assertEqual(self.listed(again), [(f"scene-{k}.vtu", k * 1e-3) for k in (0, 10, 20, 30)])
        anew = deck.run_ok(DECK.format(file="scene-*.vtu"), files={**self.files, "scene.pvd": kept["scene.pvd"]})
        self.assertEqual([name for name, _ in self.listed(anew)], [f"scene-{k}.vtu" for k in (0, 10, 20)])

    def test_collection_after_reset_timestep(self):
        """Snapshots that are written again, and those later than the present step, give way to the new ones."""
        text = DECK.format(file="scene-*.vtu")
        again = deck.run_ok(text + "reset_timestep 0\nrun 10\n", files=self.files)
        self.assertEqual(self.listed(again), [("scene-0.vtu", 0), ("scene-10.vtu", 0.01)])
        back = deck.run_ok(text + "reset_timestep 10\nrun 20\n", files=self.files)
        self.assertEqual(self.listed(back), [(f"scene-{k}.vtu", k * 1e-3) for k in (0, 10, 20, 30)])

    def test_collection_is_xml_whatever_the_file_is_called(self):
        name = 'a&b<c>"d\'-*.vtu'
        run = deck.run_ok(DECK.format(file=name) + "write_restart half.rst\n", files=self.files)
        start = "units si\nnewton off\ncommunicate single vel yes\natom_modify sort 0 0\nread_restart half.rst\n"
        kept = {file: run.path / file for file in ("half.rst", 'a&b<c>"d\'.pvd')}
        again = deck.run_ok(start + DECK[DECK.index("neighbor"):].format(file=name), files=kept)
        for result, steps in ((run, (0, 10, 20)), (again, (0, 10, 20, 30, 40))):
            listed = xml.etree.ElementTree.parse(result.path / 'a&b<c>"d\'.pvd').iter("DataSet")
            self.assertEqual([entry.get("file") for entry in listed], [name.replace("*", str(step)) for step in steps])

    def listed(self, run):
        entries = re.findall(r'timestep="(.*?)".*file="(.*?)"', run.read("scene.pvd"))
        return [(name, round(float(time), 12)) for time, name in entries]

    def test_same_file_on_one_and_two_ranks(self):
        run = deck.run_ok(DECK.format(file="scene-*.vtu"), ranks=1, files=self.files)
        self.assertEqual((run.path / "scene-0.vtu").read_bytes(), (self.result.path / "out/scene-0.vtu").read_bytes())

    def test_group_without_particles_is_an_empty_grid(self):
        region = "region nowhere block 8 9 8 9 8 9 units box\ngroup nobody region nowhere\n"
        text = DECK.format(file="scene-*.vtu").replace("dump scene all", region + "dump scene nobody")
        run = deck.run_ok(text, files=self.files)
        self.assertEqual(read_grid(run.path / "scene-0.vtu").GetNumberOfCells(), 0)

    def test_bad_file_names_are_refused(self):
        for name in ("scene.vtu", "scene-*.vtk", "scene-%-*.vtu"):
            run = deck.run(DECK.format(file=name), files=self.files)
            self.assertNotEqual(run.status, 0)
            self.assertIn("dump nurbs/vtk", run.errors[0])
            self.assertIn(name, run.errors[0])

    def test_unwritable_place_is_an_error_and_leaves_no_file(self):
        run = deck.run(DECK.format(file="in.data/scene-*.vtu"), ranks=2, files=self.files)
        self.assertNotEqual(run.status, 0)
        self.assertIn("cannot write in.data/scene-0.vtu", run.errors[0])
        self.assertFalse(list(pathlib.Path(run.path).glob("**/*.vtu*")))


if __name__ == "__main__":
    unittest.main()
