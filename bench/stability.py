#!/usr/bin/python3
"""Dynamic stability on the worst bodies: drops, collides, shakes and stacks them, and writes results/stability.csv.

    bench/stability.py [--scenes drop,collide,shake,settle,stack] [--bodies NAME,...] [--shapes DIR] [--output CSV]

drop     8 bodies of one kind, turned at random, fall on a plane and bounce, neither friction nor damping.
collide  12 pairs meet off-centre, turning, neither friction nor damping.
shake    20 bodies of one kind fly about in a box of six planes, neither friction nor damping, no gravity.
settle   one body, tilted, falls on a plane, damped, with friction, until it lies still.
stack    4 bodies one on another, damped, with friction.

Units: every body has mass 1, its size is about 1; kn = 1e4, so a contact with a plane has the period
T = 2 pi sqrt(1 / kn), a head-on pair 1 / sqrt 2 of it. Time steps are given as fractions of that period. Columns:

    scene, body, sharpness (bounding radius times largest curvature; inf: creased), dt_over_period, steps,
    error_max (largest |energy - first| over the run / energy in play), error_rms, error_end (signed),
    gain_max (largest energy - first, signed, same unit), kinetic_end (final kinetic energy / energy in play),
    creep (largest distance moved by a centre in the last tenth of the run / size), contacts, fallback, unresolved
    (sums over all steps), seconds
"""
import argparse
import csv
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "decks"))
import deck  # noqa: E402

KN = 1e4
FRACTIONS = (0.2, 0.1, 0.05, 0.025, 0.0125, 0.00625)
COLUMNS = ("scene,body,sharpness,dt_over_period,steps,error_max,error_rms,error_end,gain_max,kinetic_end,creep,"
           "contacts,fallback,unresolved,seconds").split(",")


def superellipsoid_sharpness(exponent):
    """Bounding radius times the largest principal curvature of |x|^e + |y|^e + |z|^e = 1, by scanning one octant."""
    t = np.linspace(1e-3, math.pi / 2 - 1e-3, 200)
    u, v = np.meshgrid(t, t)
    n = np.stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)], -1).reshape(-1, 3)
    p = n / (n**exponent).sum(1, keepdims=True)**(1 / exponent)
    gradient = p**(exponent - 1)
    length = np.linalg.norm(gradient, axis=1)
    d = gradient / length[:, None]
    second = (exponent - 1) * p**(exponent - 2) / length[:, None]
    across = np.eye(3) - d[:, :, None] * d[:, None, :]
    curvature = np.linalg.eigvalsh(across @ (second[:, :, None] * np.eye(3)) @ across)[:, -1]
    return 3**(0.5 - 1 / exponent) * curvature.max()


# name: (arguments of nurbs-shape make, sharpness)
BODIES = {
    "sphere": (["sphere"], 1.0),
    "ellipsoid": (["ellipsoid", "--axes", "1,0.8,0.6"], 1 / 0.36),
    "blocky 2.5": (["superellipsoid", "--axes", "1,1,1", "--exponent", "2.5", "--spans", "5"],
                   superellipsoid_sharpness(2.5)),
    "blocky 4": (["superellipsoid", "--axes", "1,1,1", "--exponent", "4", "--spans", "5"], superellipsoid_sharpness(4)),
    "blocky 4 dented": (["superellipsoid", "--axes", "1,1,1", "--exponent", "4", "--spans", "3"],
                        superellipsoid_sharpness(4)),
    "blocky 8": (["superellipsoid", "--axes", "1,1,1", "--exponent", "8", "--spans", "3"], superellipsoid_sharpness(8)),
    "needle 8:1": (["ellipsoid", "--axes", "1,0.125,0.125"], 64.0),
    "disc 10:1": (["ellipsoid", "--axes", "1,1,0.1"], 100.0),
    "kinked": (["fitted-ellipsoid", "--axes", "1,0.8,0.6"], math.inf),
    "box": (["box", "--axes", "1,0.8,0.6"], math.inf),
}
HEIGHT = {"needle 8:1": 0.125, "disc 10:1": 0.1, "ellipsoid": 0.6, "kinked": 0.6, "box": 0.6}  # half, lying flat


class Shape:
    """A shape file and what `nurbs-shape info` says of it."""

    def __init__(self, name, directory):
        self.name, self.sharpness = name, BODIES[name][1]
        self.file = pathlib.Path(directory) / (name.replace(" ", "_").replace(":", "-") + ".json")
        tool = str(deck.BUILD / "nurbs-shape")
        if not self.file.exists():
            subprocess.run([tool, "make", *BODIES[name][0], "-o", str(self.file)], check=True,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        words = subprocess.run([tool, "info", str(self.file)], check=True, capture_output=True, text=True).stdout
        self.volume = number_after(words, "volume")
        self.radius = number_after(words, "bounding radius")
        self.half_height = HEIGHT.get(name, 1.0)


def number_after(text, label):
    return float(text.split(label, 1)[1].replace(":", " ").replace(",", " ").split()[0])


OPENING = """units si
newton off
communicate single vel yes
atom_style nurbs body.json
atom_modify map array
boundary f f f
read_data bodies.data
neighbor {skin} bin
neigh_modify delay 0
pair_style gran/nurbs
pair_coeff * * {law}
"""
OUTPUT = """
compute body all nurbs/atom qw qx qy qz
compute translation all ke
compute rotation all erotate/nurbs
compute ledger all nurbs/energy
compute stats all nurbs/stats
variable weight atom mass*{gravity}*z
compute weight all reduce sum v_weight
variable kinetic equal c_translation+c_rotation
variable mech equal v_kinetic+c_weight+c_ledger[1]+c_ledger[2]
variable lost equal c_ledger[3]+c_ledger[4]
fix motion all nve/nurbs
fix counts all ave/time 1 {every} {every} c_stats[8] c_stats[7] c_stats[10] file counts.txt
dump bodies all custom {frames} bodies.dump id x y z c_body[1] c_body[2] c_body[3] c_body[4]
dump_modify bodies sort id format "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g"
thermo {every}
thermo_style custom step v_kinetic v_mech v_lost c_translation c_rotation
thermo_modify norm no format float %.17g lost ignore
timestep {dt!r}
run {steps}
"""


def wall(name, point, normal, law):
    return "fix {} all wall/nurbs plane {} {} {} {} {} {} {}".format(name, *point, *normal, law)


def random_quaternion(random):
    q = random.normal(size=4)
    return tuple(float(w) for w in q / np.linalg.norm(q))


class Scene:
    """Bodies as (position, quaternion, velocity, omega); commands; energy in play; end time; contact period."""

    def __init__(self, bodies, law, commands, energy, end, period, box, gravity=0.0, skin=0.1):
        self.bodies, self.law, self.commands, self.energy = bodies, law, commands, energy
        self.end, self.period, self.box, self.gravity, self.skin = end, period, box, gravity, skin


FREE = f"kn {KN} kt 0 mu 0"
PERIOD = 2 * math.pi / math.sqrt(KN)


def drop(shape, random, count=8, height=1.0, end=11.0):
    side = math.ceil(math.sqrt(count))
    bodies = []
    for k in range(count):
        x, y = 4.0 * (k % side), 4.0 * (k // side)
        z = shape.radius + height * random.uniform(0.8, 1.2)
        bodies.append(((x, y, z), random_quaternion(random), (0, 0, 0), tuple(random.normal(size=3) * 0.5)))
    commands = [wall("floor", (0, 0, 0), (0, 0, 1), FREE), "fix gravity all gravity 1 vector 0 0 -1"]
    return Scene(bodies, FREE, commands, count * height, end, PERIOD, 20.0, gravity=1.0)


def collide(shape, random, count=12, end=2.4):
    bodies = []
    for k in range(count):
        middle = np.array([9.0 * (k % 4), 9.0 * (k // 4), 0]) - 13
        way = np.array([1.0, 0, 0])
        aside = np.array([0, *random.uniform(-0.25, 0.25, 2)]) * shape.half_height
        apart = shape.radius + random.uniform(0.05, 0.15)
        for sign in (-1, 1):
            bodies.append((tuple(middle + sign * (apart * way + aside)), random_quaternion(random), tuple(-sign * way),
                           tuple(random.normal(size=3) * 0.5)))
    return Scene(bodies, FREE, [], count * 1.0, end, PERIOD / math.sqrt(2), 40.0)


def shake(shape, random, count=20, end=6.0):
    bodies, spacing = [], 2 * shape.radius + 0.05
    lo, hi = (0, 0, 0), tuple(spacing * n for n in (3, 3, 3))
    for k in range(count):
        place = (np.array([k % 3, k // 3 % 3, k // 9]) + 0.5) * spacing
        v = random.normal(size=3)
        bodies.append((tuple(place), random_quaternion(random), tuple(1.5 * v / np.linalg.norm(v)),
                       tuple(random.normal(size=3))))
    commands = []
    for axis in range(3):
        normal = [0, 0, 0]
        normal[axis] = 1
        commands.append(wall(f"low{axis}", lo, normal, FREE))
        commands.append(wall(f"high{axis}", hi, [-n for n in normal], FREE))
    return Scene(bodies, FREE, commands, count * 1.5**2 / 2, end, PERIOD / math.sqrt(2), 20.0)


DAMPED = "kn 1e4 kt 2e3 cn 60 ct 60 mu 0.5"


def settle(shape, random, end=80.0):
    tilt = 0.15
    bodies = [((0, 0, 1.3 * shape.radius), (math.cos(tilt / 2), 0, math.sin(tilt / 2), 0), (0, 0, 0), (0, 0, 0))]
    commands = [wall("floor", (0, 0, 0), (0, 0, 1), DAMPED), "fix gravity all gravity 10 vector 0 0 -1"]
    return Scene(bodies, DAMPED, commands, 10.0, end, PERIOD, 20.0, gravity=10.0)


def stack(shape, random, count=4, end=20.0):
    bodies = []
    for k in range(count):
        z = shape.half_height * (2 * k + 1) * 1.002 + 0.01
        aside = random.uniform(-0.02, 0.02, 2) * shape.half_height
        bodies.append(((*aside, z), (1, 0, 0, 0), (0, 0, 0), (0, 0, 0)))
    commands = [wall("floor", (0, 0, 0), (0, 0, 1), DAMPED), "fix gravity all gravity 1 vector 0 0 -1"]
    return Scene(bodies, DAMPED, commands, count * shape.half_height, end, PERIOD, 20.0, gravity=1.0)


SCENES = {"drop": drop, "collide": collide, "shake": shake, "settle": settle, "stack": stack}
SHARED_STEPS = {"settle": (0.1, 0.025), "stack": (0.1, 0.025)}


class Outcome:
    """What one run measured; arrays over the samples, energies in units of the energy in play."""

    def __init__(self, scene, shape, run, steps, every, seconds):
        table = run.thermo
        self.kinetic = table["kinetic"] / scene.energy
        ledger = table["mech"] + table["lost"]
        self.error = (ledger - ledger[0]) / scene.energy
        self.steps, self.seconds = steps, seconds
        rows = [line.split() for line in run.read("counts.txt").splitlines() if not line.startswith("#")]
        sums = np.array(rows, dtype=float)[:, 1:].sum(axis=0) * every
        self.contacts, self.fallback, self.unresolved = (int(round(s)) for s in sums)
        frames = run.dump("bodies.dump")
        if len(frames[-1][1]["id"]) < len(scene.bodies):
            raise ValueError("gained so much energy that bodies left the scene")
        place = np.array([[frame[c] for c in ("x", "y", "z")] for _, frame in frames])
        late = place[-max(2, len(place) // 10):]
        self.creep = np.linalg.norm(late - late[0][None], axis=1).max() / shape.radius
        self.finite = bool(np.isfinite(ledger).all() and np.isfinite(place).all())

    def row(self, scene_name, shape, fraction):
        error = self.error
        return dict(zip(COLUMNS, [scene_name, shape.name, shape.sharpness, fraction, self.steps, abs(error).max(),
                                  math.sqrt((error**2).mean()), error[-1], error.max(), self.kinetic[-1], self.creep,
                                  self.contacts, self.fallback, self.unresolved, round(self.seconds, 2)]))


def simulate(scene, shape, fraction, samples=1000, timeout=600):
    """Runs a scene at dt = fraction * contact period."""
    dt = fraction * scene.period
    every = max(1, round(scene.end / dt / samples))
    steps = every * math.ceil(scene.end / dt / every)
    atoms, velocities = [], []
    for k, (x, q, v, omega) in enumerate(scene.bodies):
        atoms.append((k + 1, 1, 1, 1.0, 1 / shape.volume, *map(float, (*x, *q))))
        velocities.append((k + 1, *map(float, (*v, *omega))))
    text = "\n".join([OPENING.format(law=scene.law, skin=scene.skin), *scene.commands,
                      OUTPUT.format(gravity=scene.gravity, every=every, frames=every * 10, dt=dt, steps=steps)])
    limits = ((-scene.box, scene.box), ) * 3
    began = time.monotonic()
    run = deck.run_ok(text, files={"body.json": shape.file, "bodies.data": deck.data_file(atoms, velocities, limits)},
                      timeout=timeout)
    return Outcome(scene, shape, run, steps, every, time.monotonic() - began)


def measure(name, shape, fraction):
    """One row of the table; a run that breaks down (lost, NaN, stopped) has infinite error."""
    scene = SCENES[name](shape, np.random.default_rng(7))
    try:
        return simulate(scene, shape, fraction).row(name, shape, fraction)
    except (AssertionError, subprocess.TimeoutExpired, KeyError, ValueError) as problem:
        print(f"{name}, {shape.name}, {fraction}: {type(problem).__name__} {str(problem)[-300:]}", file=sys.stderr)
        return dict(zip(COLUMNS, [name, shape.name, shape.sharpness, fraction, 0] + [math.inf] * 6 + [0] * 4))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--bodies", default=",".join(BODIES))
    parser.add_argument("--shapes", default=None, help="directory that keeps the shape files")
    parser.add_argument("--output", default=str(ROOT / "bench" / "results" / "stability.csv"))
    return parser.parse_args()


def earlier_rows(file):
    if not os.path.exists(file):
        return []
    with open(file, newline="") as stream:
        return list(csv.DictReader(stream))


def main():
    options = arguments()
    with tempfile.TemporaryDirectory() as place:
        names, scenes = options.bodies.split(","), options.scenes.split(",")
        kept = [row for row in earlier_rows(options.output) if row["body"] not in names or row["scene"] not in scenes]
        shapes = [Shape(name, options.shapes or place) for name in names]
        rows = []
        for scene in scenes:
            for shape in shapes:
                for fraction in SHARED_STEPS.get(scene, FRACTIONS):
                    row = measure(scene, shape, fraction)
                    rows.append(row)
                    print({k: f"{v:.3g}" if isinstance(v, float) else v for k, v in row.items()}, flush=True)
                with open(options.output, "w", newline="") as stream:
                    writer = csv.DictWriter(stream, COLUMNS)
                    writer.writeheader()
                    writer.writerows(kept + rows)


if __name__ == "__main__":
    main()
