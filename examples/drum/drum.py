#!/usr/bin/python3
"""Writes drum.stl, a tube about y: drum.py RADIUS LENGTH, in metres."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "common"))
import stl  # noqa: E402

radius, length = map(float, sys.argv[1:])
rim, half = radius * stl.circle(60, axis=1), np.array([0, length / 2, 0])
stl.write("drum.stl", [rim - half, rim + half])
