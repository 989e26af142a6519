#!/usr/bin/python3
"""A rough grain as triangles: grain.py OUT.stl. A ball, its radius a sum of plane waves of falling height, stretched."""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests/decks"))
import meshes  # noqa: E402

points, faces = meshes.grain(2, 4, rough=0.15, axes=(1.3, 1.0, 0.8))
pathlib.Path(sys.argv[1]).write_bytes(meshes.binary_stl(points, faces))
