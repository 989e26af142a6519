#!/usr/bin/python3
"""Writes floor.stl, a floor from the y-z plane on with a lip at its end: floor.py LENGTH WIDTH LIP, in metres."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "common"))
import stl  # noqa: E402

length, width, lip = map(float, sys.argv[1:])
line = np.array([[0, -width / 2, 0], [0, width / 2, 0]])
stl.write("floor.stl", [line, line + [length, 0, 0], line + [length, 0, lip]])
