#!/usr/bin/python3
"""Draws the failure table: plot_failure_table.py failure_table.csv OUT.png
Heat map, families down, methods across: share of the answers that failed."""
import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LinearSegmentedColormap, LogNorm

LEAST = 1e-5
NO_FAILURE = "#d9ecd6"
NAMES = {"ours": "ours", "cso": "the paper's\n(cso)", "libccd": "libccd", "bullet": "Bullet", "fcl": "FCL"}
SHADES = LinearSegmentedColormap.from_list("failures", ["#fff0cf", "#fdb366", "#e8603c", "#a3162e", "#4d0420"])


def read(path):
    with open(path) as f:
        machine = f.readline().lstrip("# ").strip()
        return machine, list(csv.DictReader(f))


def heading(method, rows):
    most = max(int(r["pairs"]) for r in rows if r["method"] == method)
    name, _, vertices = method.partition("-")
    return NAMES.get(name, name) + (f"\n{int(vertices):,} vertices" if vertices else "") + f"\n≤ {most:,} pairs"


def percent(share):
    if share == 0:
        return "0"
    return f"{100 * share:.0f} %" if share >= 0.0995 else f"{100 * share:.2g} %"


def main(source, target):
    machine, rows = read(source)
    families = list(dict.fromkeys(r["family"] for r in rows))
    methods = list(dict.fromkeys(r["method"] for r in rows))
    share = np.full((len(families), len(methods)), np.nan)
    for r in rows:
        share[families.index(r["family"]), methods.index(r["method"])] = int(r["failed"]) / int(r["pairs"])

    figure, axes = plt.subplots(figsize=(1.08 * len(methods) + 2.6, 0.31 * len(families) + 1.9))
    axes.imshow(np.where(share == 0, 1.0, np.nan), cmap=LinearSegmentedColormap.from_list("", [NO_FAILURE] * 2), aspect="auto")
    shown = np.ma.masked_where(~(share > 0), np.maximum(share, LEAST))
    image = axes.imshow(shown, cmap=SHADES, norm=LogNorm(LEAST, 1), aspect="auto")
    for (i, j), value in np.ndenumerate(share):
        if np.isfinite(value):
            axes.text(j, i, percent(value), ha="center", va="center", fontsize=8.5, color="white" if value > 0.004 else "#222222",
                      fontweight="normal" if value else "bold")
    counts = [max(int(r["pairs"]) for r in rows if r["family"] == f) for f in families]
    axes.set_yticks(range(len(families)), [f"{f}  ({n:,})" for f, n in zip(families, counts)], fontsize=9)
    axes.set_xticks(range(len(methods)), [heading(m, rows) for m in methods], fontsize=9)
    axes.xaxis.tick_top()
    axes.set_xticks(np.arange(0.5, len(methods) - 1), minor=True)
    axes.set_yticks(np.arange(0.5, len(families) - 1), minor=True)
    axes.grid(which="minor", color="white", linewidth=1.5)
    axes.tick_params(which="both", length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    bar = figure.colorbar(image, ax=axes, fraction=0.025, pad=0.02)
    bar.set_label("share of answers that failed (green: none)", fontsize=9)
    bar.ax.tick_params(labelsize=8)
    bar.outline.set_visible(False)
    axes.set_title(f"Failed answers by family (pairs) and method; {machine}", fontsize=10, pad=12)
    figure.tight_layout()
    figure.savefig(target, dpi=110)


main(*sys.argv[1:3])
