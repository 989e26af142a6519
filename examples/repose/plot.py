#!/usr/bin/python3
"""Angle of repose of the runs of in.repose, and a picture: plot.py FOLDER. Reads FOLDER/SHAPE-SEED/repose.dump."""
import pathlib
import sys

import numpy as np

LENGTH, NEAR_WALL, NEAR_LIP, STRIPS = 0.06, 0.006, 0.006, 6


def angle(file):
    """Of a line through the topmost grains of strips of the floor, in degrees, and how many grains are left on it."""
    rows = file.read_text().split("ITEM: ATOMS", 1)[1].splitlines()[1:]
    x, z = np.array([[float(v) for v in row.split()[1:4]] for row in rows])[:, [0, 2]].T
    strips = np.linspace(NEAR_WALL, LENGTH - NEAR_LIP, STRIPS + 1)
    which = np.digitize(x, strips)
    top = [(x[which == k].mean(), np.sort(z[which == k])[-4:].mean()) for k in range(1, STRIPS + 1) if (which == k).any()]
    return np.degrees(np.arctan(-np.polyfit(*np.array(top).T, 1)[0])), ((x < LENGTH) & (z > 0)).sum()


def main(folder):
    runs = {}
    for file in sorted(folder.glob("*-*/repose.dump")):
        runs.setdefault(file.parent.name.split("-")[0], []).append(angle(file))
    with open(folder / "angles.csv", "w") as f:
        print("shape,angle_degrees,error,seeds", file=f)
        for shape in ("sphere", "flat", "long", "pebble"):
            if shape in runs:
                a, left = np.array(runs[shape]).T
                error = a.std(ddof=1) / np.sqrt(len(a)) if len(a) > 1 else float("nan")
                print(f"{shape},{a.mean():.2f},{error:.2f},{len(a)}", file=f)
                print(f"{shape:8} angle of repose {a.mean():.1f} +- {error:.1f} degrees ({len(a)} seeds), {left.mean():.0f} grains left")
    show = min(folder.glob("pebble-*"))
    draw(show / "repose-14000.vtu", folder / "repose.png", towards=(0.25, -1, 0.3), walls=[show / "floor.stl"],
         keep=lambda x: x[2] > 0, size=(800, 480), zoom=1.45)


if __name__ == "__main__":
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "common"))
    from draw import draw  # starts again under a virtual screen where there is none

    main(pathlib.Path(sys.argv[1]))
