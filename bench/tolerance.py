#!/usr/bin/python3
"""How loose may a run be? Cost and observable of the examples packing, hopper and drum over `tolerance` and time step.

    bench/tolerance.py [--full] [--seeds N] [--only packing,hopper,drum] [--tolerances 1e-2,..] [--steps 0.5,..] [--grain FILE.json] [--output CSV]
    bench/tolerance.py --plot CSV                  draws a CSV again

The decks are those of examples/, on one rank, with fewer grains (--full: as they stand there), of their ellipsoids or, with
--grain, of another shape about as large. Each seed is a round: every
tolerance at the deck's time step, then every other time step (in multiples of the deck's, simulated time kept) at the
deck's tolerance, one after the other, so that costs are compared within a round. A row of the CSV is a run:

    scene, tolerance, step, seed, us (CPU time of the program per particle-step), value (packing fraction; grains a second;
    degrees; nan: the run failed), unresolved (1: a contact was)

Rows are added to a CSV that exists. The picture beside it has means over seeds and their standard errors; costs are
medians of the ratios to the default tolerance, 1e-9, in the same round.
"""
import argparse
import csv
import importlib.util
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "decks"))
import deck  # noqa: E402

PRIMES = (86028121, 15485867, 49979687, 122949823, 141650939, 15485863, 49979693, 67867979, 86028157)  # none of the decks' other seeds
TOLERANCES, STEPS, USUAL = (1e-2, 1e-4, 1e-6, 1e-9, 1e-12), (0.5, 1, 2), 1e-6
COLUMNS = ("scene", "tolerance", "step", "seed", "us", "value", "unresolved")
LONG = ("0.8736", "0.8736", "1.3104")


def example(name):
    """The module that evaluates an example's runs."""
    spec = importlib.util.spec_from_file_location(f"plot_{name}", ROOT / "examples" / name / "plot.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Scene:
    """An example: `small` and `quiet` change its deck, `meshes` are its script's words, at full size and small."""

    def __init__(self, name, axes, title, measure, small, quiet=(), meshes=((), ())):
        self.name, self.axes, self.title, self.measure = name, axes, title, measure
        self.small, self.quiet, self.meshes = small, quiet, meshes

    def run(self, tolerance, step, seed, full, grain):
        """One run: (CPU microseconds per particle-step, observable, whether a contact was unresolved)."""
        with tempfile.TemporaryDirectory(prefix="nurbs-tolerance-") as place:
            place = pathlib.Path(place)
            text = deck.example(self.name, self.quiet + (() if full else self.small), time=step, steps=1 / step)
            (place / "in.deck").write_text(text)
            if grain:
                shutil.copy(grain, place / "grain.json")
            else:
                make = [str(deck.BUILD / "nurbs-shape"), "make", "ellipsoid", "--axes", ",".join(self.axes), "-o", "grain.json"]
                subprocess.run(make, cwd=place, check=True, stdout=subprocess.DEVNULL)
            script, *words = self.meshes[not full] or (None,)
            if script:
                subprocess.run(["/usr/bin/python3", ROOT / "examples" / self.name / script, *words], cwd=place, check=True)
            command = [str(deck.PROGRAM), "-in", "in.deck", "-log", f"log.{self.name}"]
            for name, value in (("shape", "grain"), ("tolerance", tolerance), ("seed", seed)):
                command += ["-var", name, str(value)]
            process = subprocess.Popen(command, cwd=place, env={**os.environ, **deck.ENVIRONMENT}, stdin=subprocess.DEVNULL,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            unresolved = int(any(place.glob("unresolved-*.json")))
            if status != 0:
                return math.nan, math.nan, unresolved
            tables = deck.thermo_tables((place / f"log.{self.name}").read_text(errors="replace"))
            us = usage.ru_utime / sum(np.trapz(table["Atoms"], table["Step"]) for table in tables) * 1e6
            return us, self.measure(place), unresolved


SCENES = {scene.name: scene for scene in (
    Scene("packing", ("1.25", "1", "0.8"), "packing fraction",
          lambda place: example("packing").last(place / "log.packing")[0],
          small=(("0 0.1 0 0.1 0 0.1", "0 0.07 0 0.07 0 0.07"),)),
    Scene("hopper", LONG, "grains a second", lambda place: example("hopper").rate([place])[0],
          small=(("particles_in_region 1600", "particles_in_region 400"), ("0 0 0.026 0.005 0.3 ", "0 0 0.020 0.005 0.28 "),
                 ("run          8000", "run          4000"), ("run          12000", "run          5500")),
          quiet=(("dump         surfaces all nurbs/vtk 4000 hopper-*.vtu\n", "thermo 500\n"),),
          meshes=(("silo.py", "0.03", "0.015", "0.32"), ("silo.py", "0.024", "0.015", "0.32"))),
    Scene("drum", LONG, "dynamic angle, degrees", lambda place: np.abs(list(example("drum").angles(place / "drum.dump"))).mean(),
          small=(("-0.02 0.02", "-0.01 0.01"), ("particles_in_region 400", "particles_in_region 200"),
                 ("run          4000", "run          3000"), ("run          10000", "run          5000"),
                 ("run          20000", "run          10000")),
          quiet=(("dump         surfaces all nurbs/vtk 20000 drum-*.vtu\n", ""), ("dump         walls all mesh/stl 20000 drum-*.stl\n", "")),
          meshes=(("drum.py", "0.04", "0.04"), ("drum.py", "0.04", "0.02"))))}


def measure(options):
    fresh = not options.output.exists()
    settings = [(t, 1) for t in options.tolerances] + [(USUAL, s) for s in options.steps if s != 1]
    with open(options.output, "a", newline="") as stream:
        table = csv.DictWriter(stream, COLUMNS)
        if fresh:
            table.writeheader()
        for seed in PRIMES[options.first:options.first + options.seeds]:
            for name in options.only:
                for tolerance, step in settings:
                    us, value, unresolved = SCENES[name].run(tolerance, step, seed, options.full, options.grain)
                    row = dict(zip(COLUMNS, (name, tolerance, step, seed, f"{us:.4g}", f"{value:.5g}", unresolved)))
                    print(row, flush=True)
                    table.writerow(row)
                    stream.flush()


def mean(values):
    """Mean and its standard error, of what is a number."""
    values = np.array([v for v in values if not math.isnan(v)])
    if len(values) < 2:
        return values.mean() if len(values) else math.nan, 0.0
    return values.mean(), values.std(ddof=1) / math.sqrt(len(values))


def summary(rows, scene):
    """[(tolerance, step, cost ratio, its quartiles' half distance, observable, error, failed)], of one scene."""
    runs = {}
    for row in rows:
        if row["scene"] == scene:
            runs.setdefault((float(row["tolerance"]), float(row["step"])), {})[row["seed"]] = row
    default = runs[1e-9, 1]
    found = []
    for (tolerance, step), mine in sorted(runs.items()):
        ratios = [float(row["us"]) / float(default[seed]["us"]) for seed, row in mine.items() if seed in default]
        low, middle, high = np.nanpercentile(ratios, (25, 50, 75))
        values = [float(row["value"]) for row in mine.values()]
        found.append((tolerance, step, middle, (high - low) / 2, *mean(values), sum(map(math.isnan, values))))
    return found


def draw(file):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    with open(file, newline="") as stream:
        rows = list(csv.DictReader(stream))
    scenes = [name for name in SCENES if any(row["scene"] == name for row in rows)]
    figure, axes = plt.subplots(2, 1 + len(scenes), figsize=(4.2 * (1 + len(scenes)), 7), constrained_layout=True)
    for k, (name, colour) in enumerate(zip(scenes, ("tab:blue", "tab:red", "tab:green"))):
        table = summary(rows, name)
        for row in table:
            print(f"{name:8} tolerance {row[0]:g} step {row[1]:g}: cost {row[2]:.3f} +- {row[3]:.3f}, {SCENES[name].title}"
                  f" {row[4]:.5g} +- {row[5]:.2g}, failed {row[6]}")
        usual = next(row for row in table if row[:2] == (USUAL, 1))
        for line, (which, x, over) in enumerate((([r for r in table if r[1] == 1], 0, 1.0),
                                                 ([r for r in table if r[0] == USUAL], 1, usual[2]))):
            place = [row[x] for row in which]
            # A step twice as long costs half for the same time.
            cost = [row[2] / over / (row[1] if line else 1) for row in which]
            axes[line, 0].errorbar(place, cost, [row[3] / row[2] * c for row, c in zip(which, cost)], fmt="o-", color=colour,
                                   capsize=3, label=name)
            panel = axes[line, 1 + k]
            panel.errorbar(place, [row[4] for row in which], [row[5] for row in which], fmt="o-", color=colour, capsize=3)
            panel.axhspan(usual[4] - usual[5], usual[4] + usual[5], color=colour, alpha=0.12, lw=0)
            panel.set(title=f"{name}: {SCENES[name].title}")
    axes[0, 0].set(title="cost / that of the default, 1e-9", ylim=(0, None))
    axes[1, 0].set(title="cost of the same time / that of the deck's step", ylim=(0, None))
    axes[0, 0].legend()
    for panel in axes[0]:
        panel.set(xscale="log", xlabel="tolerance")
        panel.invert_xaxis()
    for panel in axes[1]:
        panel.set(xlabel="time step / the deck's")
    for panel in axes.flat:
        panel.grid(alpha=0.3)
    figure.savefig(pathlib.Path(file).with_suffix(".png"), dpi=100)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    numbers = lambda text: tuple(map(float, text.split(",")))  # noqa: E731
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first", type=int, default=0, help="begin at this seed, to add rounds")
    parser.add_argument("--only", type=lambda text: text.split(","), default=list(SCENES))
    parser.add_argument("--tolerances", type=numbers, default=TOLERANCES)
    parser.add_argument("--steps", type=numbers, default=STEPS)
    parser.add_argument("--grain", type=pathlib.Path)
    parser.add_argument("--output", type=pathlib.Path, default=deck.BUILD / "tolerance.csv")
    parser.add_argument("--plot", type=pathlib.Path)
    options = parser.parse_args()
    if not options.plot:
        measure(options)
    draw(options.plot or options.output)


if __name__ == "__main__":
    main()
