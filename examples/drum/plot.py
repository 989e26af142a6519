#!/usr/bin/python3
"""Dynamic angle of the runs of in.drum, and a picture: plot.py FOLDER. Reads FOLDER/SHAPE-SEED/drum.dump."""
import pathlib
import sys

import numpy as np

RADIUS = 0.04


def angles(file):
    """Of each frame: the surface's slope, by the topmost grains of the middle half, in degrees."""
    for frame in file.read_text().split("ITEM: TIMESTEP\n")[1:]:
        rows = frame.split("ITEM: ATOMS", 1)[1].splitlines()[1:]
        x = np.array([[float(v) for v in row.split()[1:4]] for row in rows])
        bins = np.linspace(-RADIUS / 2, RADIUS / 2, 9)
        which = np.digitize(x[:, 0], bins)
        top = [(x[which == k, 0].mean(), np.sort(x[which == k, 2])[-3:].mean()) for k in range(1, len(bins))
               if (which == k).sum() >= 3]
        if len(top) >= 4:
            yield np.degrees(np.arctan(np.polyfit(*np.array(top).T, 1)[0]))


def main(folder):
    runs = {}
    for file in sorted(folder.glob("*-*/drum.dump")):
        runs.setdefault(file.parent.name.split("-")[0], []).append(np.abs(list(angles(file))).mean())
    with open(folder / "angles.csv", "w") as f:
        print("shape,angle_degrees,error,seeds", file=f)
        for shape in ("sphere", "flat", "long"):
            if shape in runs:
                a = np.array(runs[shape])
                error = a.std(ddof=1) / np.sqrt(len(a)) if len(a) > 1 else float("nan")
                print(f"{shape},{a.mean():.2f},{error:.2f},{len(a)}", file=f)
                print(f"{shape:8} dynamic angle {a.mean():.1f} +- {error:.1f} degrees ({len(a)} seeds)")
    show = min(folder.glob("long-*"))
    draw(sorted(show.glob("drum-*.vtu"), key=lambda p: int(p.stem.split("-")[1]))[-1], folder / "drum.png",
         towards=(0, -1, 0), walls=[show / "drum.stl"], zoom=1.4)


if __name__ == "__main__":
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "common"))
    from draw import draw  # starts again under a virtual screen where there is none

    main(pathlib.Path(sys.argv[1]))
