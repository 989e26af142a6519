#!/usr/bin/python3
"""Writes silo.stl (a cylinder whose flat bottom has a hole) and lid.stl (the hole's lid): silo.py RADIUS HOLE HEIGHT, in metres."""
import sys

import numpy as np

radius, hole, height = map(float, sys.argv[1:])
turn = np.linspace(0, 2 * np.pi, 49)
circle = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)


def write(name, rings):
    """Triangles between successive rings of points; a ring may be one point."""
    with open(name, "w") as f:
        print("solid", file=f)
        for low, high in zip(rings, rings[1:]):
            for k in range(len(turn) - 1):
                for corners in ((low[k], low[k + 1], high[k + 1]), (low[k], high[k + 1], high[k])):
                    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
                    if not np.linalg.norm(normal) > 0:
                        continue
                    print("facet normal 0 0 0\nouter loop", file=f)
                    for corner in corners:
                        print("vertex", *(f"{c:.9g}" for c in corner), file=f)
                    print("endloop\nendfacet", file=f)
        print("endsolid", file=f)


top = np.array([0, 0, height])
write("silo.stl", [hole * circle, radius * circle, radius * circle + top])
write("lid.stl", [0 * circle, hole * circle])
