"""Draws the particles of a file of dump nurbs/vtk, and the walls beside them, with VTK off screen.

    from draw_bed import draw
    draw("bed.vtu", "bed.png", towards=(0, -1, 0.3), walls=["silo.stl"], keep=lambda x: x[1] > 0)
"""

import os
import pathlib
import sys

if not os.environ.get("DISPLAY"):  # Debian's VTK draws through X; a virtual screen will do
    os.execvp("xvfb-run", ["xvfb-run", "-a", "-s", "-screen 0 1600x1200x24", sys.executable, *sys.argv])

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "two_particles"))
from nurbs_vtu import read_grid, read_patches  # noqa: E402

COLORS = np.array([(214, 125, 66), (84, 135, 184), (222, 184, 96), (120, 160, 110), (150, 110, 150)])
SAMPLES = 9  # a side of a patch


def surfaces(patches):
    """All patches as one mesh with exact normals; a body's colour goes by its id."""
    t = np.linspace(0, 1, SAMPLES)
    grid = np.arange(SAMPLES * SAMPLES).reshape(SAMPLES, SAMPLES)
    corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
    points, normals, colors, quads = [], [], [], []
    for k, patch in enumerate(patches):
        x, n = patch.evaluate(t, t)
        points.append(x.reshape(-1, 3))
        normals.append(n.reshape(-1, 3))
        colors.append(np.tile(COLORS[int(patch.data["id"][0]) % len(COLORS)], (SAMPLES**2, 1)))
        quads.append(corners + k * SAMPLES**2)
    data, cells = vtk.vtkPolyData(), vtk.vtkCellArray()
    data.SetPoints(vtk.vtkPoints())
    data.GetPoints().SetData(numpy_to_vtk(np.vstack(points), deep=True))
    faces = np.vstack(quads)
    cells.ImportLegacyFormat(numpy_to_vtk(np.hstack([np.full((len(faces), 1), 4), faces]).ravel(), deep=True,
                                          array_type=vtk.VTK_ID_TYPE))
    data.SetPolys(cells)
    data.GetPointData().SetNormals(numpy_to_vtk(np.vstack(normals), deep=True))
    data.GetPointData().SetScalars(numpy_to_vtk(np.vstack(colors).astype(np.uint8), deep=True))
    return data


def actor(data, color=None, opacity=1.0):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.SetScalarVisibility(color is None)
    shown = vtk.vtkActor()
    shown.SetMapper(mapper)
    look = shown.GetProperty()
    look.SetAmbient(0.25)
    look.SetDiffuse(0.75)
    look.SetSpecular(0.2)
    look.SetSpecularPower(30)
    look.SetOpacity(opacity)
    if color is not None:
        look.SetColor(*color)
    return shown


def draw(vtu, png, towards=(0, -1, 0.35), walls=(), keep=None, size=(700, 700), zoom=1.25):
    """`towards`: from the bed to the eye. `keep`: which bodies, by their centre (the mean of their patches)."""
    patches = read_patches(read_grid(vtu))
    bodies = {}
    for patch in patches:
        bodies.setdefault(int(patch.data["id"][0]), []).append(patch)
    shown = [p for body in bodies.values()
             if keep is None or keep(np.mean([p.points.reshape(-1, 3).mean(axis=0) for p in body], axis=0)) for p in body]
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.AddActor(actor(surfaces(shown)))
    for wall in walls:
        reader = vtk.vtkSTLReader()
        reader.SetFileName(str(wall))
        reader.Update()
        renderer.AddActor(actor(reader.GetOutput(), color=(0.6, 0.65, 0.7), opacity=0.25))
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*towards)
    camera.SetFocalPoint(0, 0, 0)
    camera.SetViewUp(0, 0, 1)
    renderer.ResetCamera()
    camera.Zoom(zoom)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(8)
    window.SetSize(*size)
    window.AddRenderer(renderer)
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(str(png))
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()
