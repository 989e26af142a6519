#!/usr/bin/python3
"""Packing fractions of the runs of in.packing, and a picture: plot.py FOLDER. Reads FOLDER/SHAPE-SEED/log.packing."""
import pathlib
import re
import sys

import numpy as np


def last(log):
    """Packing fraction and contacts per particle at the end of a run."""
    rows = [line.split() for line in log.read_text().splitlines() if re.match(r"^ +\d+ +\d+ +[\d.e+-]+ +0\.\d+ ", line)]
    return float(rows[-1][3]), float(rows[-1][4])


def main(folder):
    runs = {}
    for log in sorted(folder.glob("*-*/log.packing")):
        runs.setdefault(log.parent.name.split("-")[0], []).append(last(log))
    published = {"sphere": "0.64", "ellipsoid": "0.735 to 0.74"}
    with open(folder / "packing.csv", "w") as f:
        print("shape,runs,fraction,deviation,contacts", file=f)
        for shape, values in runs.items():
            v = np.array(values)
            spread = v[:, 0].std(ddof=1) if len(v) > 1 else float("nan")
            print(f"{shape},{len(v)},{v[:, 0].mean():.4f},{spread:.4f},{v[:, 1].mean():.2f}", file=f)
            print(f"{shape:10} packing fraction {v[:, 0].mean():.4f} +- {spread:.4f} ({len(v)} seeds; published"
                  f" {published.get(shape, '-')}), {v[:, 1].mean():.1f} contacts a grain")
    draw(next(folder.glob("ellipsoid-*/packing-*.vtu")), folder / "packing.png", towards=(0.6, -1, 0.6))


if __name__ == "__main__":
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "common"))
    from draw import draw  # starts again under a virtual screen where there is none

    main(pathlib.Path(sys.argv[1]))
