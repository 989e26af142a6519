#!/usr/bin/python3
"""Draws bodies given as STL files side by side, named by their files, off screen.

Usage: view_shape.py PICTURE.png BODY.stl [BODY.stl ..]
"""
import math
import os
import pathlib
import sys

if not os.environ.get("DISPLAY"):  # Debian's VTK draws through X; a virtual screen will do
    os.execvp("xvfb-run", ["xvfb-run", "-a", "-s", "-screen 0 1600x1600x24", sys.executable, *sys.argv])

import vtk

CELL = 400  # pixels
COLOR = (0.80, 0.62, 0.42)


def body_actor(file):
    reader = vtk.vtkSTLReader()
    reader.SetFileName(file)
    normals = vtk.vtkPolyDataNormals()
    normals.SetInputConnection(reader.GetOutputPort())
    normals.SetFeatureAngle(30)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(normals.GetOutputPort())
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetColor(*COLOR)
    look.SetSpecular(0.25)
    look.SetSpecularPower(30)
    look.SetAmbient(0.15)
    return actor


def renderer_of(file, title, place):
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.SetViewport(*place)
    renderer.AddActor(body_actor(file))
    if title:
        text = vtk.vtkTextActor()
        text.SetInput(title)
        text.SetPosition(12, 10)
        text.GetTextProperty().SetColor(0.1, 0.1, 0.1)
        text.GetTextProperty().SetFontSize(24)
        renderer.AddActor2D(text)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(1, -2.4, 1.1)
    camera.SetViewUp(0, 0, 1)
    camera.SetFocalPoint(0, 0, 0)
    renderer.ResetCamera()
    return renderer


def main(picture, *files):
    columns = math.ceil(math.sqrt(len(files)))
    rows = math.ceil(len(files) / columns)
    size = CELL if len(files) > 1 else 2 * CELL
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(8)
    window.SetSize(columns * size, rows * size)
    for k, file in enumerate(files):
        column, row = k % columns, k // columns
        place = (column / columns, 1 - (row + 1) / rows, (column + 1) / columns, 1 - row / rows)
        window.AddRenderer(renderer_of(file, pathlib.Path(file).stem if len(files) > 1 else "", place))
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(picture)
    writer.SetInputConnection(grab.GetOutputPort())
    writer.Write()


if __name__ == "__main__":
    main(*sys.argv[1:])
