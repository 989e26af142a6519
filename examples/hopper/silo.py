#!/usr/bin/python3
"""Writes silo.stl (a cylinder whose flat bottom has a hole) and lid.stl (the hole's lid): silo.py RADIUS HOLE HEIGHT, in metres."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "common"))
import stl  # noqa: E402

radius, hole, height = map(float, sys.argv[1:])
rim, top = stl.circle(48), np.array([0, 0, height])
stl.write("silo.stl", [hole * rim, radius * rim, radius * rim + top])
stl.write("lid.stl", [0 * rim, hole * rim])
