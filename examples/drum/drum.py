#!/usr/bin/python3
"""Writes drum.stl, a tube about y: drum.py RADIUS LENGTH, in metres."""
import sys

import numpy as np

radius, length = map(float, sys.argv[1:])
turn = np.linspace(0, 2 * np.pi, 61)
rim = np.stack([radius * np.cos(turn), 0 * turn, radius * np.sin(turn)], axis=1)
low, high = rim - [0, length / 2, 0], rim + [0, length / 2, 0]
with open("drum.stl", "w") as f:
    print("solid", file=f)
    for k in range(len(turn) - 1):
        for corners in ((low[k], low[k + 1], high[k + 1]), (low[k], high[k + 1], high[k])):
            print("facet normal 0 0 0\nouter loop", file=f)
            for corner in corners:
                print("vertex", *(f"{c:.9g}" for c in corner), file=f)
            print("endloop\nendfacet", file=f)
    print("endsolid", file=f)
