#!/usr/bin/python3
"""Draws the particles at the times of the paper's Fig. 3 from the files of dump nurbs/vtk.

Usage: render.py [FOLDER]     reads FOLDER/figure-*.vtu, writes FOLDER/scene.png
"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "common"))
from draw import actor, grab, surface_of  # noqa: E402  (first: starts again under a virtual screen where there is none)
from nurbs_vtu import read_grid, read_patches, read_time  # noqa: E402

import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
import vtk  # noqa: E402

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

TIMES = (0, 0.065, 0.07963, 0.21769)
COLORS = 255 * np.array([(0.84, 0.49, 0.26), (0.33, 0.53, 0.72)])
FLOOR = 0.2
SIZE = (900, 900)
LOOK = {"diffuse": 0.85, "power": 35}


def seams_of(patches, samples=60, lift=1.5e-5):
    """The patch boundaries as lines just above the surface."""
    t, ends = np.linspace(0, 1, samples), np.array([0.0, 1.0])
    append = vtk.vtkAppendPolyData()
    for patch in patches:
        along_v, along_u = patch.evaluate(ends, t), patch.evaluate(t, ends)
        for x, n in ((along_v[0], along_v[1]), (along_u[0].swapaxes(0, 1), along_u[1].swapaxes(0, 1))):
            for side in range(2):
                line = vtk.vtkPolyLineSource()
                line.SetNumberOfPoints(samples)
                for k, point in enumerate(x[side] + lift * n[side]):
                    line.SetPoint(k, *point)
                append.AddInputConnection(line.GetOutputPort())
    tube = vtk.vtkTubeFilter()
    tube.SetInputConnection(append.GetOutputPort())
    tube.SetRadius(1.6e-4)
    tube.SetNumberOfSides(8)
    tube.Update()
    return tube.GetOutput()


def floor_around(center, size=2.4):
    plane = vtk.vtkPlaneSource()
    x, y = center[0] - size / 2, center[1] - size / 2
    plane.SetOrigin(x, y, FLOOR)
    plane.SetPoint1(x + size, y, FLOOR)
    plane.SetPoint2(x, y + size, FLOOR)
    plane.SetResolution(100, 100)
    plane.Update()
    return plane.GetOutput()


def spot(position, focus, intensity, cone=40):
    """A lamp that casts shadows."""
    lamp = vtk.vtkLight()
    lamp.SetPosition(*position)
    lamp.SetFocalPoint(*focus)
    lamp.SetPositional(True)
    lamp.SetConeAngle(cone)
    lamp.SetIntensity(intensity)
    return lamp


def fill(direction, intensity):
    """Light from far away, without shadows."""
    lamp = vtk.vtkLight()
    lamp.SetPosition(*direction)
    lamp.SetFocalPoint(0, 0, 0)
    lamp.SetIntensity(intensity)
    return lamp


def shadow_pass():
    shadows = vtk.vtkShadowMapPass()
    shadows.GetShadowMapBakerPass().SetResolution(2048)
    order = vtk.vtkRenderPassCollection()
    for step in (shadows.GetShadowMapBakerPass(), shadows):
        order.AddItem(step)
    sequence = vtk.vtkSequencePass()
    sequence.SetPasses(order)
    camera_pass = vtk.vtkCameraPass()
    camera_pass.SetDelegatePass(sequence)
    return camera_pass


def picture(patches, focus):
    """The scene as an image array, seen from the front and above."""
    focus = np.array(focus)
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.SetAutomaticLightCreation(False)
    renderer.AddActor(actor(surface_of(patches, 40, COLORS), **LOOK, specular=0.3, ambient=0.2))
    renderer.AddActor(actor(seams_of(patches), color=(0.15, 0.15, 0.17), **LOOK, ambient=0.3, specular=0))
    renderer.AddActor(actor(floor_around(focus), color=(0.96, 0.96, 0.95), **LOOK, ambient=0.42, specular=0))
    renderer.AddLight(spot(focus + (0.35, -0.5, 1.1), focus, 0.6))
    renderer.AddLight(spot(focus + (-0.7, -0.6, 0.9), focus, 0.22))
    renderer.AddLight(fill((-0.3, -1, -0.35), 0.2))
    renderer.SetPass(shadow_pass())
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*(focus + (0.13, -0.5, 0.24)))
    camera.SetFocalPoint(*focus)
    camera.SetViewUp(0, 0, 1)
    camera.SetViewAngle(26)
    renderer.ResetCameraClippingRange()
    return grab(renderer, SIZE, samples=0)


def snapshot_at(grids, time):
    return min(grids, key=lambda grid: abs(read_time(grid) - time))


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    grids = [read_grid(file) for file in sorted(folder.glob("figure-*.vtu"))]
    figure, panels = plt.subplots(1, len(TIMES), figsize=(4 * len(TIMES), 4.2))
    for panel, time in zip(panels, TIMES):
        grid = snapshot_at(grids, time)
        panel.imshow(picture(read_patches(grid), (0.009, 0.007, 0.275)))
        panel.set_title(f"t = {read_time(grid):.5g} s", fontsize=13)
        panel.axis("off")
    figure.subplots_adjust(left=0, right=1, bottom=0, top=0.93, wspace=0.01)
    figure.savefig(folder / "scene.png", dpi=110)


if __name__ == "__main__":
    main()
