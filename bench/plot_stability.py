#!/usr/bin/python3
"""Draws results/stability.csv as results/stability.png: energy error against time step, surviving step against sharpness.

    bench/plot_stability.py [CSV [PNG]]
"""
import csv
import math
import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

RESULTS = pathlib.Path(__file__).resolve().parent / "results"
UNDAMPED = {"drop": "drop: 8 bodies bounce on a plane", "collide": "collide: 12 pairs, off-centre, turning",
            "shake": "shake: 20 bodies in a box of six planes"}
THRESHOLD = 1e-2


def read(file):
    with open(file, newline="") as stream:
        return [{k: v if k in ("scene", "body") else float(v) for k, v in row.items()} for row in csv.DictReader(stream)]


def names(rows):
    """Bodies from dull to sharp."""
    sharpness = {row["body"]: row["sharpness"] for row in rows}
    return sorted(sharpness, key=sharpness.get)


def series(rows, scene, body, column="error_max"):
    chosen = sorted((row["dt_over_period"], row[column]) for row in rows if (row["scene"], row["body"]) == (scene, body))
    return np.array(chosen).reshape(-1, 2)


def surviving_step(points):
    """Largest step with an error below the threshold here and at every smaller step, interpolated in logarithms."""
    step = math.nan
    for k, (dt, error) in enumerate(points):
        if not error < THRESHOLD:
            if k and math.isfinite(error):
                (x0, y0), (x1, y1) = np.log(points[k - 1]), np.log([dt, error])
                step = math.exp(x0 + (x1 - x0) * (math.log(THRESHOLD) - y0) / (y1 - y0))
            break
        step = dt
    return step


def draw_errors(axis, rows, scene, title, looks):
    for body, look in looks.items():
        points = series(rows, scene, body)
        if len(points):
            axis.loglog(*points.T, ms=5, lw=1.2, label=body, **look)
    steps = np.array([0.006, 0.2])
    axis.loglog(steps, 2 * steps**2, "k:", lw=1, label=r"slope 2")
    axis.axhline(THRESHOLD, color="grey", lw=0.6)
    axis.set(title=title, xlabel="time step / contact period", ylabel="largest |energy error| / energy in play",
             ylim=(2e-5, 10))
    axis.grid(alpha=0.3)


def draw_survival(axis, rows, bodies):
    sharpness = {row["body"]: row["sharpness"] for row in rows}
    finite = [s for s in sharpness.values() if math.isfinite(s)]
    creased = [b for b in bodies if math.isinf(sharpness[b])]
    place = {b: sharpness[b] if math.isfinite(sharpness[b]) else max(finite) * 2.5**(1 + creased.index(b)) for b in bodies}
    for scene, marker in zip(UNDAMPED, "osD"):
        steps = [surviving_step(series(rows, scene, body)) for body in bodies]
        axis.loglog([place[b] for b in bodies], steps, marker, ms=5, alpha=0.8, label=scene)
    for body in bodies:
        axis.annotate(body, (place[body], 0.0062), rotation=90, fontsize=7, ha="center", va="bottom", color="grey")
    if creased:
        axis.axvline(max(finite) * 1.6, color="grey", lw=0.6)
    axis.set(title=f"surviving step (error below {THRESHOLD:g} from here down)", ylim=(0.006, 0.3),
             xlabel="sharpness: bounding radius x largest curvature  | creased", ylabel="time step / contact period")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)


def draw_rest(axis, rows, bodies):
    for scene, marker in (("settle", "o"), ("stack", "s")):
        for column, colour in (("kinetic_end", "tab:red"), ("creep", "tab:blue")):
            values = [series(rows, scene, body, column) for body in bodies]
            chosen = [(k, v[0, 1]) for k, v in enumerate(values) if len(v)]
            if chosen:
                k, value = np.array(chosen).T
                axis.semilogy(k, np.maximum(value, 1e-34), marker, ms=5, alpha=0.8, color=colour,
                              label=f"{scene}: {'kinetic energy' if column == 'kinetic_end' else 'creep'}")
    axis.set_xticks(range(len(bodies)), bodies, rotation=60, ha="right", fontsize=7)
    axis.set(title="damped: what is left at the end (dt = T / 40)", ylabel="kinetic / energy in play; creep / size")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=7)


def looks_of(bodies):
    """Colour and marker by body: no two alike."""
    return {body: {"color": f"C{k}", "marker": "osD^v<>PX*"[k % 10], "ls": "-" if k < 10 else "--"}
            for k, body in enumerate(bodies)}


def main():
    arguments = sys.argv[1:]
    rows = read(arguments[0] if arguments else RESULTS / "stability.csv")
    bodies = names(rows)
    looks = looks_of(bodies)
    figure, axes = plt.subplots(2, 3, figsize=(16, 9.5), constrained_layout=True)
    for axis, (scene, title) in zip(axes.flat, UNDAMPED.items()):
        draw_errors(axis, rows, scene, title, looks)
    draw_survival(axes.flat[3], rows, bodies)
    draw_rest(axes.flat[4], rows, bodies)
    axes.flat[5].axis("off")
    unresolved = sum(row["unresolved"] for row in rows)
    contacts = sum(row["contacts"] for row in rows)
    fallback = sum(row["fallback"] for row in rows)
    axes.flat[5].legend(*axes.flat[0].get_legend_handles_labels(), loc="upper left", fontsize=11,
                        title="bodies, from dull to sharp")
    axes.flat[5].text(0, 0.05, f"all runs: {contacts:.4g} contact solves\nby the polytope fallback: {fallback:.4g}\n"
                      f"unresolved: {unresolved:.0f}", fontsize=12)
    figure.savefig(arguments[1] if len(arguments) > 1 else RESULTS / "stability.png", dpi=110)


if __name__ == "__main__":
    main()
