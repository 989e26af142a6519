"""Shape files that nurbs-shape does not make."""
import json


def revolved(profile):
    """The polygon of (radius, height) turned about z, from pole to pole: one patch, sharp where the polygon has corners."""
    root = 0.5**0.5
    circle = [(1, 0, 1), (1, 1, root), (0, 1, 1), (-1, 1, root), (-1, 0, 1), (-1, -1, root), (0, -1, 1), (1, -1, root), (1, 0, 1)]
    last = len(profile) - 1
    surface = {"degree_u": 2, "degree_v": 1, "size_u": 9, "size_v": last + 1,
               "knotvector_u": [0, 0, 0, .25, .25, .5, .5, .75, .75, 1, 1, 1],
               "knotvector_v": [0] + [k / last for k in range(last + 1)] + [1],
               "control_points": {"points": [[r * x, r * y, z] for x, y, _ in circle for r, z in profile],
                                  "weights": [w for _, _, w in circle for _ in profile]}}
    return json.dumps({"shape": {"type": "surface", "count": 1, "data": [surface]}})
