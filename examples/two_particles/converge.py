#!/usr/bin/python3
"""The energy ledger over the collisions at several time steps: its error falls as dt^2.

Usage: converge.py PROGRAM [FOLDER]     runs in.two_particles to 0.25 s; writes FOLDER/convergence.{csv,png}
"""

import os
import pathlib
import shutil
import subprocess
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from plot import drift, read_energies, residual

HERE = pathlib.Path(__file__).resolve().parent


def run(program, folder, dt, time, every):
    """Runs the deck on one rank, with a line of energies each `every` steps; returns them. `dt` divides 1e-5."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("in.two_particles", "data.two_particles", "particle_a.json", "particle_b.json"):
        shutil.copy(HERE / name, folder)
    settings = {"dt": f"{dt:.17g}", "time": str(time), "every": str(every)}
    words = [word for name, value in settings.items() for word in ("-var", name, value)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    subprocess.run([str(program), "-in", "in.two_particles", *words], cwd=folder, check=True, env=environment,
                   stdout=subprocess.DEVNULL)
    return read_energies(folder)


def errors(program, folder, steps, time):
    """Rows (dt, change of the total over the run, largest change at any line), over what is dissipated, for each
    number of time steps per 1e-5 s."""
    rows = []
    for n in steps:
        e = run(program, folder / str(n), 1e-5 / n, time, n)
        rows.append((1e-5 / n, drift(e), residual(e)))
    return np.array(rows)


def slope(dt, error):
    """Exponent of dt, by least squares on the logarithms."""
    return np.polyfit(np.log(dt), np.log(error), 1)[0]


def plot(rows, file):
    dt, final, largest = rows.T
    figure, axis = plt.subplots(figsize=(5.2, 4))
    axis.loglog(dt, largest, "s-", color="0.6", label="largest, within an impact")
    axis.loglog(dt, final, "o-", label=f"after the collisions, slope {slope(dt, final):.2f}")
    axis.loglog(dt, np.exp(np.mean(np.log(final / dt**2))) * dt**2, "k--", lw=1, label="dt$^2$")
    axis.set_xlabel("time step, s")
    axis.set_ylabel("change of the total energy / dissipated")
    axis.legend(frameon=False)
    figure.tight_layout()
    figure.savefig(file, dpi=130)


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    folder = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else "convergence")
    rows = errors(program, folder, (5, 7, 10, 14, 20, 28, 40, 56, 80), 0.25)
    np.savetxt(folder / "convergence.csv", rows, delimiter=",", fmt="%.6g", header="dt,final,largest", comments="")
    plot(rows, folder / "convergence.png")
    for dt, final, largest in rows:
        print(f"dt {dt:.3g} s: after {final:.3g}, over dt^2 {final / dt**2:.3g}; largest {largest:.3g}")
    print(f"slope {slope(rows[:, 0], rows[:, 1]):.2f}")


if __name__ == "__main__":
    main()
