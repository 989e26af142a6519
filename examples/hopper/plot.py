#!/usr/bin/python3
"""Discharge rates and a picture of the runs of in.hopper: plot.py FOLDER. Reads FOLDER/SHAPE-SEED/discharge.txt."""
import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

VOLUME, HOLE, DENSITY, G = 4 / 3 * np.pi * 3e-3**3, 0.03, 2500.0, 9.81
ASPECT = {"flat": 0.6, "sphere": 1.0, "long": 1.5, "needle": 2.5}
STEADY = 0.2  # s, until the flow is


def discharge(folder):
    """Time since the lid is gone, and the grains that are left."""
    _, t, left = np.loadtxt(folder / "discharge.txt", unpack=True)
    return t - t[0], left


def rate(folders):
    """Grains a second, and its standard error by the fillings; of one filling by tenths of the time."""
    parts = []
    for folder in folders:
        t, left = discharge(folder)
        t, left = t[t >= STEADY], left[t >= STEADY]
        ends = np.linspace(0, len(t) - 1, 11).astype(int)
        parts.append(-np.diff(left[ends]) / np.diff(t[ends]))
    of = np.mean(parts, axis=1) if len(parts) > 1 else np.array(parts[0])
    return of.mean(), of.std(ddof=1) / np.sqrt(len(of))


def main(folder):
    runs = {s: sorted(f.parent for f in folder.glob(f"{s}-*/discharge.txt")) for s in ASPECT}
    shapes = [s for s in ASPECT if runs[s]]
    rates = {s: rate(runs[s]) for s in shapes}
    grain = 2 * 3e-3
    beverloo = 0.58 * 0.6 * DENSITY * np.sqrt(G) * (HOLE - 1.4 * grain) ** 2.5 / (DENSITY * VOLUME)
    with open(folder / "rates.csv", "w") as f:
        print("shape,aspect,grains_per_second,error,fillings,to_spheres", file=f)
        for s in shapes:
            mean, error, share = *rates[s], rates[s][0] / rates["sphere"][0]
            print(f"{s},{ASPECT[s]},{mean:.1f},{error:.1f},{len(runs[s])},{share:.3f}", file=f)
            print(f"{s:8} a/b {ASPECT[s]}: {mean:.0f} +- {error:.0f} grains/s ({len(runs[s])} fillings), {share:.2f} of the spheres'")
    print(f"Beverloo for spheres (C 0.58, k 1.4, solid fraction 0.6): {beverloo:.0f} grains/s")
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6))
    for s in shapes:
        axes[0].plot(*discharge(runs[s][0]), label=f"a/b {ASPECT[s]}")
    axes[0].set_xlabel("time, s")
    axes[0].set_ylabel("grains above the orifice")
    axes[0].set_ylim(0, None)
    axes[0].legend()
    value, error = (np.array([rates[s][k] for s in shapes]) for k in (0, 1))
    for s in shapes:
        axes[1].plot([ASPECT[s]] * len(runs[s]), [rate([run])[0] for run in runs[s]], "x", color="0.6")
    axes[1].errorbar([ASPECT[s] for s in shapes], value, error, fmt="o", capsize=5, label="mean and standard error")
    axes[1].plot([], [], "x", color="0.6", label="one filling")
    axes[1].axhline(beverloo, color="0.5", ls="--", lw=1, label="Beverloo, spheres")
    axes[1].set_xlabel("aspect ratio a/b")
    axes[1].set_ylabel("grains a second")
    axes[1].set_ylim(0, 1.15 * beverloo)
    axes[1].set_xscale("log")
    axes[1].set_xticks([ASPECT[s] for s in shapes], [str(ASPECT[s]) for s in shapes])
    axes[1].minorticks_off()
    axes[1].legend(loc="lower left")
    figure.tight_layout()
    figure.savefig(folder / "discharge.png", dpi=110)
    show = runs["long" if "long" in shapes else shapes[-1]][0]
    draw(show / "hopper-10000.vtu", folder / "hopper.png", towards=(0.3, -1, 0.35), size=(420, 640), walls=[show / "silo.stl"],
         top=0.15, zoom=1.4)


if __name__ == "__main__":
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "common"))
    from draw import draw  # starts again under a virtual screen where there is none

    main(pathlib.Path(sys.argv[1]))
