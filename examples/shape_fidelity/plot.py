#!/usr/bin/python3
"""Packing fraction over cost of the runs of in.shape_fidelity: plot.py FOLDER. Reads FOLDER/SHAPE-SEED/log.shape_fidelity
and times (CPU time of the run, by the shell's `times`)."""
import pathlib
import re
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

SHAPES = ("sphere", "ellipsoid", "fit-5", "fit-2", "fit-1", "fit-0.3")


def last(folder):
    """Packing fraction, contacts a grain, and us of CPU time per grain and step."""
    rows = [line.split() for line in (folder / "log.shape_fidelity").read_text().splitlines()
            if re.match(r"^ +\d+ +\d+ +\S+ +0\.\d+ ", line)]
    step, atoms, fraction, contacts = (float(rows[-1][k]) for k in (0, 1, 3, 4))
    user, system = re.findall(r"(\d+)m([\d.]+)s", (folder / "times").read_text())[2:4]
    seconds = sum(60 * float(m) + float(s) for m, s in (user, system))
    return fraction, contacts, 1e6 * seconds / (step * atoms)


def mean(x):
    """With its standard error."""
    return x.mean(), x.std(ddof=1) / len(x)**0.5 if len(x) > 1 else float("nan")


def main(folder):
    found = {}
    for shape in SHAPES:
        runs = [last(log.parent) for log in sorted(folder.glob(f"{shape}-[0-9]*/times"))]
        if runs:
            found[shape] = np.array(runs)
    figure, axes = plt.subplots(figsize=(7, 4.2))
    with open(folder / "shape_fidelity.csv", "w") as f:
        print("shape,runs,fraction,error,contacts,us_per_grain_step,error", file=f)
        for number, (shape, runs) in enumerate(found.items()):
            (fraction, df), (contacts, _), (cost, dc) = (mean(x) for x in runs.T)
            print(f"{shape},{len(runs)},{fraction:.4f},{df:.4f},{contacts:.2f},{cost:.3f},{dc:.3f}", file=f)
            print(f"{shape:10} fraction {fraction:.4f} +- {df:.4f}, {contacts:.1f} contacts a grain, {cost:.2f} +- {dc:.2f} us "
                  f"a grain and step ({len(runs)} seeds)")
            axes.errorbar(cost, fraction, df, dc, "o", capsize=3)
            axes.annotate(shape.replace("fit-", "fit of ") + (" %" if "fit" in shape else ""), (cost, fraction),
                          textcoords="offset points", xytext=(0, (-16, 9)[number % 2]), ha="center")
    axes.set_xlabel("CPU time per grain and step (us), one core")
    axes.set_ylabel("packing fraction, with standard error")
    axes.margins(0.12)
    axes.set_xlim(left=0)
    axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(folder / "shape_fidelity.png", dpi=110)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
