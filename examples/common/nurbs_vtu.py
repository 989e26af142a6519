"""Reads the files of dump nurbs/vtk with VTK and evaluates their rational Bezier patches with numpy."""

from math import comb

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy


class Patch:
    """One Bezier patch: control points (p+1, q+1, 3), weights (p+1, q+1), and the cell data of its body."""

    def __init__(self, points, weights, data):
        self.points, self.weights, self.data = points, weights, data

    def evaluate(self, u, v):
        """Points and unit normals (outward for the bodies written by the dump) on the grid u x v, (n, m, 3) each."""
        basis = lambda degree, t: np.array(
            [comb(degree, i) * t**i * (1 - t) ** (degree - i) for i in range(degree + 1)])

        def slope(degree, t):
            lower = basis(degree - 1, t)
            zero = np.zeros((1, len(t)))
            return degree * (np.vstack([zero, lower]) - np.vstack([lower, zero]))

        p, q = (n - 1 for n in self.weights.shape)
        net = np.dstack([self.points * self.weights[..., None], self.weights])
        blend = lambda a, b: np.einsum("ia,jb,ijk->abk", a, b, net)
        h, hu, hv = (blend(basis(p, u), basis(q, v)), blend(slope(p, u), basis(q, v)), blend(basis(p, u), slope(q, v)))
        position = h[..., :3] / h[..., 3:]
        tangent = [(d[..., :3] - position * d[..., 3:]) / h[..., 3:] for d in (hu, hv)]
        normal = np.cross(*tangent)
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        return position, normal / np.where(length > 0, length, 1)


def read_grid(file):
    """The file as a vtkUnstructuredGrid; fails when it isn't readable."""
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(file))
    if not reader.CanReadFile(str(file)):
        raise OSError(f"{file} is not a VTK unstructured grid")
    reader.Update()
    return reader.GetOutput()


def read_time(grid):
    return grid.GetFieldData().GetArray("TimeValue").GetValue(0)


def read_patches(grid):
    """All Bezier patches of a grid."""
    points = vtk_to_numpy(grid.GetPoints().GetData())
    weights = vtk_to_numpy(grid.GetPointData().GetRationalWeights())
    degrees = vtk_to_numpy(grid.GetCellData().GetHigherOrderDegrees()).astype(int)
    arrays = [grid.GetCellData().GetArray(k) for k in range(grid.GetCellData().GetNumberOfArrays())]
    patches = []
    for cell in range(grid.GetNumberOfCells()):
        ids = vtk.vtkIdList()
        grid.GetCellPoints(cell, ids)
        p, q = degrees[cell][:2]
        order = np.array([[ids.GetId(vtk.vtkHigherOrderQuadrilateral.PointIndexFromIJK(i, j, [p, q]))
                           for j in range(q + 1)] for i in range(p + 1)])
        data = {a.GetName(): np.array(a.GetTuple(cell)) for a in arrays}
        patches.append(Patch(points[order], weights[order], data))
    return patches
