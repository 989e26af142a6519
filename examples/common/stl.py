"""Writes triangles as STL files: surfaces between successive rings of points."""
import numpy as np


def circle(sides, axis=2):
    """Points (sides + 1, 3) on the unit circle about an axis; the last is the first."""
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    points = np.zeros((sides + 1, 3))
    points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = np.cos(turn), np.sin(turn)
    points[-1] = points[0]
    return points


def write(name, rings):
    """`rings`: arrays (n, 3), each joined to the next by two triangles a side; where a ring has shrunk to a point, by one."""
    with open(name, "w") as f:
        print("solid", file=f)
        for low, high in zip(rings, rings[1:]):
            for k in range(len(low) - 1):
                for corners in ((low[k], low[k + 1], high[k + 1]), (low[k], high[k + 1], high[k])):
                    if not np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) > 0:
                        continue
                    print("facet normal 0 0 0\nouter loop", file=f)
                    for corner in corners:
                        print("vertex", *(f"{c:.9g}" for c in corner), file=f)
                    print("endloop\nendfacet", file=f)
        print("endsolid", file=f)
