#!/usr/bin/python3
"""Draws the accuracy-speed charts: plot_accuracy_speed.py accuracy_speed.csv OUT_DIRECTORY
One PNG for each of gap, normal, contact points and force; one panel per body; log-log, median error over time."""
import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

TITLES = {
    "ellipsoid": "exact ellipsoid 1 : 0.8 : 0.6",
    "pebble": "pebble",
    "blocky": "blocky (superellipsoid, exponent 4)",
    "disc": "disc 10 : 1",
}
ERRORS = {
    "gap": "error of the gap / bounding radius",
    "normal": "error of the normal (rad)",
    "points": "error of the contact points / bounding radius",
    "force": "error of the force kn overlap n / its size",
}
STYLES = [  # name of the family, how it is drawn
    ("ours-warm", dict(color="#c0392b", marker="o", label="ours, warm (1e-2 .. 1e-14)")),
    ("ours-cold", dict(color="#c0392b", marker="o", mfc="white", ls="--", label="ours, cold")),
    ("cso-warm", dict(color="#2c6fbb", marker="s", label="the paper's method (cso), warm")),
    ("cso-cold", dict(color="#2c6fbb", marker="s", mfc="white", ls="--", label="cso, cold")),
    ("libccd-epa", dict(color="#555555", marker="^", label="libccd GJK+EPA (50 .. 50,000 vertices)")),
    ("libccd-mpr", dict(color="#999999", marker="v", label="libccd MPR")),
    ("bullet-epa", dict(color="#1b7f5c", marker="D", label="Bullet GJK+EPA")),
    ("fcl-epa", dict(color="#8e6bbf", marker="P", label="FCL GJK+EPA (50 .. 2,500)")),
    ("ellipsoid-fit", dict(color="#e08e0b", marker="*", ms=11, ls="", label="best-fitting ellipsoid")),
    ("clump", dict(color="#e08e0b", marker="x", label="sphere clump (10 .. 1,000)")),
]
FLOOR = 1e-16


def read(path):
    with open(path) as f:
        machine = f.readline().lstrip("# ").strip()
        return machine, list(csv.DictReader(f))


def family(row):
    name = row["method"]
    return name if name.startswith(("ours", "cso", "ellipsoid")) else name.rsplit("-", 1)[0]


def draw(rows, machine, error, path):
    bodies = list(dict.fromkeys(r["body"] for r in rows))
    figure, panels = plt.subplots(2, 2, figsize=(12, 9.5), sharex=True, sharey=True)
    for body, panel in zip(bodies, panels.flat):
        for name, style in STYLES:
            mine = [r for r in rows if r["body"] == body and family(r) == name]
            mine = [r for r in mine if float(r["contacts"]) > 0.2 * (float(r["contacts"]) + float(r["failed"]))]
            panel.plot(
                [float(r["ns"]) * 1e-3 for r in mine],
                [max(float(r[error + "_median"]), FLOOR) for r in mine],
                **{"lw": 1.2, "ms": 5, **style},
            )
        panel.set(xscale="log", yscale="log", title=TITLES.get(body, body))
        panel.grid(True, which="major", alpha=0.3)
    for panel in panels[1]:
        panel.set_xlabel("CPU time per contact (µs)")
    for panel in panels[:, 0]:
        panel.set_ylabel("median " + ERRORS[error])
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=4, frameon=False, fontsize=9)
    figure.suptitle(f"Contacts overlapping by 1e-4 .. 1e-2 of their size, turning 2e-3 rad per step\n{machine}", fontsize=10)
    figure.tight_layout(rect=(0, 0.07, 1, 1))
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main():
    machine, rows = read(sys.argv[1])
    for error in ERRORS:
        draw(rows, machine, error, os.path.join(sys.argv[2], f"accuracy_speed_{error}.png"))


main()
