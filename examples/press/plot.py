#!/usr/bin/python3
"""Force over displacement of the runs of in.press, and pictures: plot.py FOLDER. Reads FOLDER/SEED/press.txt."""
import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

STROKE, PERIOD, DT, RADIUS = 8e-3, 0.8, 4e-5, 0.02  # of the punch (m, s) and the deck, radius of the die


def press(file):
    """Depth of the punch, force on it, and what springs hold and contacts dissipated, from when the punch begins."""
    step, force, normal, tangential, damping, friction = np.loadtxt(file, unpack=True)
    depth = STROKE * np.sin(2 * np.pi * (step - step[0]) * DT / PERIOD)
    return depth, force, normal + tangential, damping + friction


def main(folder):
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6))
    with open(folder / "press.csv", "w") as f:
        print("seed,touch_mm,most_N,pressure_kPa,work_J,returned,ledger_error", file=f)
        for number, file in enumerate(sorted(folder.glob("*/press.txt")), 1):
            depth, force, springs, dissipated = press(file)
            touch = depth[np.argmax(force > 0.05 * force.max())]
            power = 0.5 * (force[1:] + force[:-1]) * np.diff(depth)
            work = np.concatenate([[0], np.cumsum(power)])
            returned = -power[power < 0].sum() / power[power > 0].sum()
            held = springs + dissipated - springs[0] - dissipated[0]
            error = (work[-1] - held[-1]) / power[power > 0].sum()
            pressure = force.max() / (np.pi * RADIUS**2)
            print(f"{file.parent.name},{1e3 * touch:.3f},{force.max():.2f},{1e-3 * pressure:.2f},{power[power > 0].sum():.5g},"
                  f"{returned:.4f},{error:.2g}", file=f)
            print(f"seed {file.parent.name}: at most {force.max():.0f} N ({1e-3 * pressure:.0f} kPa), work {power[power > 0].sum():.3g} J, of which"
                  f" {100 * returned:.0f} % come back; springs and dissipation account for it but for {100 * error:.1f} %")
            line = axes[0].plot(1e3 * (depth - touch), force, lw=1, label=f"filling {number}")[0]
            axes[1].plot(1e3 * (depth - touch), work, lw=1, color=line.get_color(), label=f"filling {number}: work of the punch")
            axes[1].plot(1e3 * (depth - touch), held, lw=1, ls="--", color="black",
                         label="springs + dissipated" if number == 1 else None)
    for axis, title in zip(axes, ("force on the punch, N", "energy, J")):
        axis.set(xlabel="displacement from touch, mm", xlim=(-0.5, None), title=title)
        axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(folder / "force.png", dpi=110)
    draw(min(folder.glob("*/press-15000.vtu")), folder / "press.png", towards=(0.3, -1, 0.45), size=(560, 560), zoom=1.4)


if __name__ == "__main__":
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "common"))
    from draw import draw  # starts again under a virtual screen where there is none

    main(pathlib.Path(sys.argv[1]))
