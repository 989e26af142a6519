#!/usr/bin/env python3
"""Heat map of bench/results/failure_table.csv: families down, methods across, share of answers that failed."""
import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

LEAST = 1e-5  # shown as the palest colour; zero is white


def read(path):
    with open(path) as f:
        lines = [line for line in f if not line.startswith("#")]
    return list(csv.DictReader(lines))


def label(row):
    failed, pairs = int(row["failed"]), int(row["pairs"])
    if failed == 0:
        return "0"
    share = failed / pairs
    return f"{100 * share:.0f}%" if share >= 0.1 else f"{100 * share:.2g}%"


def main(source, target):
    rows = read(source)
    families = list(dict.fromkeys(r["family"] for r in rows))
    methods = list(dict.fromkeys(r["method"] for r in rows))
    cell = {(r["family"], r["method"]): r for r in rows}
    share = np.full((len(families), len(methods)), np.nan)
    for i, family in enumerate(families):
        for j, method in enumerate(methods):
            row = cell.get((family, method))
            if row and int(row["failed"]):
                share[i, j] = max(LEAST, int(row["failed"]) / int(row["pairs"]))
    fig, ax = plt.subplots(figsize=(1.25 * len(methods) + 3.2, 0.36 * len(families) + 1.6))
    colours = plt.get_cmap("Reds").copy()
    colours.set_bad("white")
    image = ax.imshow(share, cmap=colours, norm=LogNorm(LEAST, 1), aspect="auto")
    for i, family in enumerate(families):
        for j, method in enumerate(methods):
            row = cell.get((family, method))
            if row:
                dark = share[i, j] > 0.1
                ax.text(j, i, label(row), ha="center", va="center", fontsize=8, color="white" if dark else "black")
    pairs = [int(cell[f, methods[0]]["pairs"]) for f in families]
    ax.set_yticks(range(len(families)), [f"{f}  ({n:,})" for f, n in zip(families, pairs)], fontsize=8)
    ax.set_xticks(range(len(methods)), methods, fontsize=9)
    ax.xaxis.tick_top()
    ax.set_xticks(np.arange(-0.5, len(methods)), minor=True)
    ax.set_yticks(np.arange(-0.5, len(families)), minor=True)
    ax.grid(which="minor", color="0.85", linewidth=0.8)
    ax.tick_params(which="both", length=0)
    fig.colorbar(image, ax=ax, label="share of answers that failed", shrink=0.8)
    ax.set_title("Failed answers (pairs judged for the first method)", fontsize=10, pad=24)
    fig.tight_layout()
    fig.savefig(target, dpi=150)


if __name__ == "__main__":
    main(*sys.argv[1:3])
