#!/usr/bin/python3
"""Energies over time and contact events of a run of in.two_particles.

Usage: plot.py [FOLDER [DT]]     reads FOLDER/energies.csv, contacts.dump; writes energy.png, numbers.csv there
"""

import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

# Event: the paper's Fig. 3, and a sum on ellipsoids of the same inertia tensors (the second one takes A as stopped
# dead where it touches the plane).
EVENTS = {"A touches the plane, s": (0.065, 0.0637), "B touches A, s": (0.07963, 0.0774),
          "B comes to the plane to stay, s": (0.21769, "")}


def read_energies(folder):
    return np.genfromtxt(folder / "energies.csv", delimiter=",", names=True)


def contact_frames(folder):
    """Step and set of touching (particle, other or 0 for the plane) for each frame of contacts.dump."""
    for frame in (folder / "contacts.dump").read_text().split("ITEM: TIMESTEP\n")[1:]:
        step = int(frame.split("\n", 1)[0])
        rows = (row.split() for row in frame.split("ITEM: ENTRIES", 1)[1].splitlines()[1:])
        yield step, {(int(a), int(b)) for a, b, gap in rows if float(gap) < 0}


def contact_starts(folder, dt):
    """Every start of a contact in contacts.dump: {contact: [times]}."""
    starts, before = {}, set()
    for step, now in contact_frames(folder):
        for contact in now - before:
            starts.setdefault(contact, []).append(step * dt)
        before = now
    return starts


def events(folder, dt):
    """Times of EVENTS; None for one that did not happen in the time contacts.dump covers."""
    starts = contact_starts(folder, dt)
    first = [starts.get(contact, [None])[0] for contact in ((1, 0), (1, 2))]
    return [*first, starts.get((2, 0), [None])[-1]]


def residual(e):
    """Largest change of the total, at any line, over what the scene dissipates."""
    return np.max(np.abs(e["total"] - e["total"][0])) / (e["damping"][-1] + e["friction"][-1])


def drift(e):
    """Change of the total from the first line to the last over what the scene dissipates."""
    return abs(e["total"][-1] - e["total"][0]) / (e["damping"][-1] + e["friction"][-1])


def plot(e, times, file):
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), gridspec_kw={"width_ratios": [2, 1.3]}, sharey=True)
    dissipated = e["damping"] + e["friction"]
    mechanical = e["kinetic"] + e["potential"] + e["spring"]
    curves = (("total", e["total"], "black", "-"), ("kinetic + potential + springs", mechanical, "0.5", "--"),
              ("dissipated", dissipated, "tab:red", "-"), ("potential", e["potential"], "tab:green", "-"),
              ("kinetic", e["kinetic"], "tab:blue", "-"), ("springs", e["spring"], "tab:purple", "-"))
    for axis, last in zip(axes, (e["t"][-1], 0.3)):
        shown = e["t"] <= last
        for label, values, color, style in curves:
            axis.plot(e["t"][shown], values[shown], color=color, ls=style, label=label, lw=1.4)
        axis.set_xlabel("time, s")
        axis.set_xlim(0, last)
    axes[0].set_ylim(0, 1.25 * e["total"][0])
    for name, time, height in zip(("A on plane", "B on A", "B on plane"), times, (1.19, 1.08, 1.19)):
        if time is not None:
            axes[1].axvline(time, color="0.85", lw=1, zorder=0)
            axes[1].text(time + 0.003, height * e["total"][0], name, va="center", fontsize=8, color="0.4")
    axes[0].set_ylabel("energy, J")
    axes[0].legend(frameon=False, fontsize=9, ncol=3, loc="upper right")
    axes[1].set_title("the collisions", fontsize=10)
    figure.tight_layout()
    figure.savefig(file, dpi=130)


def table(e, times):
    """Rows (quantity, here, paper, ellipsoids)."""
    rows = [(name, "" if time is None else time, *EVENTS[name]) for name, time in zip(EVENTS, times)]
    rows += [(f"{name} at {e['t'][-1]:.3g} s, J", e[name][-1], "", "")
             for name in ("kinetic", "potential", "spring", "damping", "friction", "total")]
    return rows + [("change of the total / dissipated", residual(e), "", "")]


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    dt = float(sys.argv[2]) if len(sys.argv) > 2 else 1e-6
    e, times = read_energies(folder), events(folder, dt)
    plot(e, times, folder / "energy.png")
    rows = [("", "here", "paper", "ellipsoids"), *table(e, times)]
    (folder / "numbers.csv").write_text("".join(",".join(map(str, row)) + "\n" for row in rows))
    for row in rows:
        words = [f"{word:.6g}" if isinstance(word, float) else word for word in row]
        print(f"{words[0]:36}{words[1]:>12}{words[2]:>12}{words[3]:>12}")


if __name__ == "__main__":
    main()
