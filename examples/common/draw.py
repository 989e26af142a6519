"""Draws the surfaces of a file of dump nurbs/vtk, and what stands beside them, with VTK off screen.

    from draw import draw
    draw("bed.vtu", "bed.png", towards=(0, -1, 0.3), walls=["silo.stl"], keep=lambda x: x[1] > 0)
"""

import os
import sys

if not os.environ.get("DISPLAY"):  # Debian's VTK draws through X; a virtual screen will do
    os.execvp("xvfb-run", ["xvfb-run", "-a", "-s", "-screen 0 1600x1200x24", sys.executable, *sys.argv])

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from nurbs_vtu import read_grid, read_patches

COLORS = np.array([(214, 125, 66), (84, 135, 184), (222, 184, 96), (120, 160, 110), (150, 110, 150)])


def surface_of(patches, samples=9, colors=COLORS):
    """All patches as one mesh with exact normals, `samples` points a side; a body's colour goes by its id, from 1."""
    t = np.linspace(1e-6, 1 - 1e-6, samples)  # normals vanish where an edge has collapsed to a point
    grid = np.arange(samples**2).reshape(samples, samples)
    corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
    points, normals, shades, quads = [], [], [], []
    for k, patch in enumerate(patches):
        x, n = patch.evaluate(t, t)
        points.append(x.reshape(-1, 3))
        normals.append(n.reshape(-1, 3))
        shades.append(np.tile(colors[(int(patch.data["id"][0]) - 1) % len(colors)], (samples**2, 1)))
        quads.append(corners + k * samples**2)
    data, cells = vtk.vtkPolyData(), vtk.vtkCellArray()
    data.SetPoints(vtk.vtkPoints())
    data.GetPoints().SetData(numpy_to_vtk(np.vstack(points), deep=True))
    faces = np.vstack(quads)
    cells.ImportLegacyFormat(numpy_to_vtk(np.hstack([np.full((len(faces), 1), 4), faces]).ravel(), deep=True,
                                          array_type=vtk.VTK_ID_TYPE))
    data.SetPolys(cells)
    data.GetPointData().SetNormals(numpy_to_vtk(np.vstack(normals), deep=True))
    data.GetPointData().SetScalars(numpy_to_vtk(np.vstack(shades).astype(np.uint8), deep=True))
    return data


def actor(data, color=None, opacity=1.0, ambient=0.25, diffuse=0.75, specular=0.2, power=30):
    """`color`: red, green, blue up to 1; None: the mesh's own."""
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.SetScalarVisibility(color is None)
    shown = vtk.vtkActor()
    shown.SetMapper(mapper)
    look = shown.GetProperty()
    look.SetInterpolationToPhong()
    look.SetAmbient(ambient)
    look.SetDiffuse(diffuse)
    look.SetSpecular(specular)
    look.SetSpecularPower(power)
    look.SetOpacity(opacity)
    if color is not None:
        look.SetColor(*color)
    return shown


def stl_actor(file, top=np.inf):
    """A wall, up to the height `top`."""
    reader = vtk.vtkSTLReader()
    reader.SetFileName(str(file))
    shown = reader
    if np.isfinite(top):
        plane = vtk.vtkPlane()
        plane.SetOrigin(0, 0, top)
        plane.SetNormal(0, 0, -1)
        shown = vtk.vtkClipPolyData()
        shown.SetInputConnection(reader.GetOutputPort())
        shown.SetClipFunction(plane)
    shown.Update()
    return actor(shown.GetOutput(), color=(0.6, 0.65, 0.7), opacity=0.25)


def grab(renderer, size, samples=8):
    """The scene as an image array (height, width, 3). `samples`: of a pixel, 0 where render passes draw."""
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(samples)
    window.SetSize(*size)
    window.AddRenderer(renderer)
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    image.Update()
    output = image.GetOutput()
    width, height, _ = output.GetDimensions()
    return vtk_to_numpy(output.GetPointData().GetScalars()).reshape(height, width, -1)[::-1]


def draw(vtu, png, towards=(0, -1, 0.35), walls=(), top=np.inf, keep=None, size=(700, 700), zoom=1.25):
    """`towards`: from the bed to the eye. `walls`: STL files, drawn up to the height `top`. `keep`: which bodies, by their
    centre (the mean of their patches)."""
    bodies = {}
    for patch in read_patches(read_grid(vtu)):
        bodies.setdefault(int(patch.data["id"][0]), []).append(patch)
    shown = [p for body in bodies.values()
             if keep is None or keep(np.mean([p.points.reshape(-1, 3).mean(axis=0) for p in body], axis=0)) for p in body]
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.AddActor(actor(surface_of(shown)))
    for wall in walls:
        renderer.AddActor(stl_actor(wall, top))
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*towards)
    camera.SetFocalPoint(0, 0, 0)
    camera.SetViewUp(0, 0, 1)
    renderer.ResetCamera()
    camera.Zoom(zoom)
    import matplotlib.image
    matplotlib.image.imsave(png, np.ascontiguousarray(grab(renderer, size)))
