#!/usr/bin/python3
"""Times whole steps of beds of particles, at rest and tumbling, side by side, interleaved, on this machine.

    bench/scene.py [--quick] [--only CASE,..] [--n 1000,8000] [--ranks 1,2] [--state rest,tumbling] [--repeats R]
                   [--seconds S] [--program NAME=PATH ..] [--beds DIR] [--output CSV [--keep]]
    bench/scene.py --tolerances [1e-2,1e-4,..] [--only CASE,..] [--output CSV]    cost and observables over `tolerance`
    bench/scene.py --plot CSV                                                     draws a CSV again

A picture is drawn beside the CSV (default: scene.csv or scene_tolerance.csv in BUILD/scene).

Cases: sphere (the host's own), nurbs-sphere, ellipsoid (1 : 1.5 : 2), pebble, blocky (exponent 4), tablet (flat
faces, rounded rims), cylinder (sharp rims), and, where the environment says LIGGGHTS_SUPERQUADRIC=program, superquadric-ellipsoid and
superquadric-blocky. All particles have the volume of a sphere of 5 mm and the same linear law; the decks are
bench/decks/in.*. A bed is a lattice, turned at random, dropped into a box of six planes and settled (above 10,000
particles: 4 x 4 such beds side by side in one box); then the lid comes down to 1.4 times its height. Every shape's bed
is made once (DIR, default build/scene) and every program starts from it: the sphere's bed is converted to the host's
spheres, the others' to superquadrics. Each program lets it relax, and saves a restart, from which timed runs begin:

rest      gravity down.
tumbling  gravity turns about a horizontal axis, once a second, and has turned by 72 degrees when timing begins.

`--program NAME=PATH` times another build of liggghts-nurbs in the same run, in turn with BUILD/liggghts-nurbs; more
than one may be given. Columns of the CSV:

    program, case, state, n, ranks, tolerance, steps, repeats, us (per particle-step, median; on one rank the share of
    time without a core is taken off), us_min, us_max, us_wall (median as the host's clock says), pair, neigh, comm,
    other (shares of the time; walls and motion are `other`), contacts and pairs (per particle, walls included),
    us_contact (us / contacts), skipped, rejected, local, warm, cold, fallback (shares of the pairs), newton
    (iterations per contact), unresolved, bytes_host (per particle, as the host prints), bytes_rss (per particle, growth
    of the process), kinetic (energy at the end per particle / weight x radius), to_sphere (us / host spheres' us),
    to_superquadric (superquadrics' us / us), both the median of the ratios inside each round of runs

`--tolerances` times the bed of 1,000 as above for each tolerance, and drops small beds (216 particles, three seeds,
from the lattice to rest) under it, of which the CSV has mean and standard deviation:

    case, tolerance, us_rest, us_tumbling, packing (volume of the particles / (floor x twice their mean height)),
    contacts (per particle at rest), ledger (largest |energy + dissipated - first| / energy lost), kinetic, unresolved
"""
import argparse
import csv
import hashlib
import math
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
DECKS = ROOT / "bench" / "decks"
sys.path.insert(0, str(ROOT / "tests" / "decks"))
import deck  # noqa: E402
import shapes  # noqa: E402

RADIUS, DENSITY, GRAVITY, DT = 0.005, 2500.0, 9.81, 5e-5  # dt and the law stand in the decks too
VOLUME = 4 / 3 * math.pi * RADIUS**3
SETTLE, RELAX, TURN, WARM = 15000, 2000, 4000, 100  # steps: of the drop; to rest, then to tumbling; before timing
MOST_SETTLED, TILES = 10000, 4  # larger beds are 4 x 4 smaller ones
TURNS = {"rest": 0, "tumbling": 1}  # of gravity, a second

SHAPES = {  # arguments of nurbs-shape make, or a profile to turn about z
    "sphere": ["sphere"],
    "ellipsoid": ["ellipsoid", "--axes", "1,1.5,2"],
    "pebble": ["pebble"],
    "blocky": ["superellipsoid", "--axes", "1,1,1", "--exponent", "4"],
    "tablet": ["tablet", "--radius", "1", "--height", "0.8", "--rim", "0.15"],
    "cylinder": [(0, -0.6), (1, -0.6), (1, 0.6), (0, 0.6)],
}
CASES = {  # name: (deck, shape of the bed)
    "sphere": ("sphere", "sphere"),
    "nurbs-sphere": ("nurbs", "sphere"),
    "ellipsoid": ("nurbs", "ellipsoid"),
    "pebble": ("nurbs", "pebble"),
    "blocky": ("nurbs", "blocky"),
    "tablet": ("nurbs", "tablet"),
    "cylinder": ("nurbs", "cylinder"),
    "superquadric-ellipsoid": ("superquadric", "ellipsoid"),
    "superquadric-blocky": ("superquadric", "blocky"),
}
SUPERQUADRICS = {"ellipsoid": ((1, 1.5, 2), 2), "blocky": ((1, 1, 1), 4)}  # semi-axes, exponent
STATS = "pairs skipped rejected local warm cold fallback contacts newton unresolved".split()
COLUMNS = ("program,case,state,n,ranks,tolerance,steps,repeats,us,us_min,us_max,us_wall,pair,neigh,comm,other,contacts,"
           "pairs,us_contact,skipped,rejected,local,warm,cold,fallback,newton,unresolved,bytes_host,bytes_rss,kinetic,"
           "to_sphere,to_superquadric").split(",")


TOLERANCE_COLUMNS = ("case,tolerance,us_rest,us_tumbling,packing,packing_sd,contacts,contacts_sd,ledger,ledger_sd,"
                     "kinetic,unresolved").split(",")
DROPPED, SEEDS = 216, 3


def number_after(text, label):
    return float(text.split(label, 1)[1].replace(":", " ").replace(",", " ").split()[0])


# --- Runs ------------------------------------------------------------------------------------------------------


def peak_memory(pid):
    """Bytes a process had in memory at most so far; 0 when it has ended. (ru_maxrss remembers who started it.)"""
    try:
        found = re.search(r"^VmHWM:\s+(\d+) kB", pathlib.Path(f"/proc/{pid}/status").read_text(), re.M)
    except OSError:
        return 0
    return int(found.group(1)) * 1024 if found else 0


def share_of_core(pid):
    """Of the time its main thread wanted a core, the share in which it had one; None when it has ended."""
    try:
        on_core, waited = map(int, pathlib.Path(f"/proc/{pid}/schedstat").read_text().split()[:2])
    except (OSError, ValueError):
        return None
    return on_core / (on_core + waited) if on_core else None


class Run:
    """One run of a deck of bench/decks: log, time, memory. `variables` become -var name value."""

    def __init__(self, program, name, variables, ranks=1):
        with tempfile.TemporaryDirectory(prefix="nurbs-scene-") as place:
            command = [str(program), "-in", str(DECKS / f"in.{name}"), "-log", "log.liggghts"]
            for key, value in {"decks": DECKS, **variables}.items():
                command += ["-var", key, str(value)]
            if ranks > 1:
                command = ["mpirun", "-np", str(ranks)] + command
            with open(pathlib.Path(place) / "screen", "w+") as screen:
                process = subprocess.Popen(command, cwd=place, env={**os.environ, **deck.ENVIRONMENT}, stdout=screen,
                                           stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
                self.rss, core = 0, 1.0
                while process.poll() is None:
                    time.sleep(0.05)
                    self.rss = peak_memory(process.pid) or self.rss
                    core = share_of_core(process.pid) or core
                screen.seek(0)
                output = screen.read()
            if process.returncode != 0:
                raise RuntimeError(f"{' '.join(command)}\nfailed:\n{output[-2000:]}")
            self.log = (pathlib.Path(place) / "log.liggghts").read_text(errors="replace")
        self.tables = deck.thermo_tables(self.log)
        loop = re.findall(r"^Loop time of (\S+) on (\d+) procs for (\d+) steps with (\d+) atoms", self.log, re.M)[-1]
        self.seconds, self.steps, self.atoms = float(loop[0]), int(loop[2]), int(loop[3])
        if "n" in variables and self.atoms != int(variables["n"]):
            raise RuntimeError(f"{name}: {self.atoms} of {variables['n']} particles left")
        self.us = self.seconds / (max(self.steps, 1) * self.atoms) * 1e6
        self.us_busy = self.us * core if ranks == 1 else self.us  # under mpirun the process is not the program

    def share(self, name):
        return float(re.findall(rf"^{name}\s+time \(%\) = \S+ \((\S+)\)", self.log, re.M)[-1]) / 100

    @property
    def memory(self):
        return float(re.findall(r"^Memory usage per processor = (\S+) Mbytes", self.log, re.M)[-1]) * 2**20


def empty_memory(program):
    """Bytes of the program before it has a particle."""
    with tempfile.TemporaryDirectory() as place:
        process = subprocess.Popen([str(program), "-log", "none"], cwd=place, stdin=subprocess.PIPE,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                   env={**os.environ, **deck.ENVIRONMENT})
        time.sleep(0.5)
        most = peak_memory(process.pid)
        process.communicate(b"")
    return most


# --- Beds ------------------------------------------------------------------------------------------------------


def random_quaternions(random, count):
    q = random.normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


class Shape:
    """A shape file, and the scale that gives it the common volume."""

    def __init__(self, name, directory):
        self.name, self.file = name, directory / f"{name}.json"
        tool = str(deck.BUILD / "nurbs-shape")
        if not self.file.exists() and isinstance(SHAPES[name][0], tuple):
            self.file.write_text(shapes.revolved(SHAPES[name]))
        elif not self.file.exists():
            subprocess.run([tool, "make", *SHAPES[name], "-o", str(self.file)], check=True, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL)
        words = subprocess.run([tool, "info", str(self.file)], check=True, capture_output=True, text=True).stdout
        self.scale = (VOLUME / number_after(words, "volume"))**(1 / 3)
        self.radius = number_after(words, "bounding radius") * self.scale


def lattice(shape, count, width, seed):
    """Data file of a lattice of particles that don't touch, shifted and turned at random, drifting; and its height."""
    random = np.random.default_rng(seed)
    side = int(width / (2.001 * shape.radius))
    spacing = width / side
    k = np.arange(count)
    place = (np.stack([k % side, k // side % side, k // side**2], 1) + 0.5) * spacing
    place += random.uniform(-0.5, 0.5, (count, 3)) * (spacing - 2 * shape.radius)
    height = math.ceil(count / side**2) * spacing
    atoms = [(i + 1, 1, 1, shape.scale, DENSITY, *map(float, (*x, *q)))
             for i, (x, q) in enumerate(zip(place, random_quaternions(random, count)))]
    velocities = [(i + 1, *map(float, v), 0.0, 0.0, 0.0) for i, v in enumerate(random.normal(size=(count, 3)) * 0.1)]
    return deck.data_file(atoms, velocities, ((0.0, width), (0.0, width), (0.0, height))), height


def sections(text):
    """Sections of a data file: {title: rows of words, sorted by id}."""
    found, rows = {}, None
    for line in text.splitlines():
        words = line.split("#")[0].split()
        if words and words[0] in ("Atoms", "Velocities"):
            rows = found.setdefault(words[0], [])
        elif words and rows is not None:
            rows.append(words)
    return {title: sorted(rows, key=lambda row: int(row[0])) for title, rows in found.items()}


def box_width(count):
    """Width of the box: a settled bed is about 0.7 times as high."""
    return (count * VOLUME / 0.62 / 0.7)**(1 / 3)


class Bed:
    """A settled bed of one shape and its conversions, in a directory of its own; made when missing."""

    def __init__(self, shape_name, count, program, directory, seed=7):
        self.path = pathlib.Path(directory) / f"{shape_name}-{count}"
        self.count, self.shape_name = count, shape_name
        self.path.mkdir(parents=True, exist_ok=True)
        self.shape = Shape(shape_name, self.path)
        if count > MOST_SETTLED and count % TILES**2 == 0:
            self.tile(Bed(shape_name, count // TILES**2, program, directory, seed))
        else:
            self.settle(program, seed)
        top = max(float(row[7]) for row in self.rows["Atoms"]) + RADIUS
        self.lid = round(1.4 * top, 4)
        self.convert()

    def tile(self, bed):
        """TILES x TILES of a smaller bed, side by side without walls between them."""
        self.width, self.key = TILES * bed.width, bed.key
        self.rows = {title: [] for title in bed.rows}
        for i in range(TILES**2):
            first, shift = i * bed.count, (i % TILES * bed.width, i // TILES * bed.width)
            for title, rows in bed.rows.items():
                for row in rows:
                    moved = [str(int(row[0]) + first), *row[1:]]
                    if title == "Atoms":
                        moved[5:7] = (repr(float(x) + s) for x, s in zip(row[5:7], shift))
                    self.rows[title].append(moved)

    def settle(self, program, seed):
        """Drops a lattice, if that was not done before."""
        count, shape_name = self.count, self.shape_name
        self.width = box_width(count)
        text, height = lattice(self.shape, count, self.width, seed)
        key = hashlib.sha1((text + (DECKS / "in.settle").read_text() + str(SETTLE)).encode()).hexdigest()[:10]
        data = self.path / f"bed-{key}.data"
        if not data.exists():
            print(f"settling {count} x {shape_name} ..", flush=True)
            (self.path / "lattice.data").write_text(text)
            fresh = self.path / "fresh.data"
            run = Run(program, "settle", {"shape": self.shape.file, "lattice": self.path / "lattice.data", "bed": fresh,
                                          "width": self.width, "height": height, "steps": SETTLE,
                                          "tolerance": 1e-6, "n": count})
            (self.path / "settle.log").write_text(run.log)
            fresh.rename(data)
        self.key = key
        self.rows = sections(data.read_text())

    def convert(self):
        """Writes nurbs.data, sphere.data, superquadric.data and turned, in a box up to the lid."""
        rows = self.rows["Atoms"]
        limits = ((0.0, self.width), (0.0, self.width), (0.0, self.lid))
        velocities = self.rows.get("Velocities", [])
        (self.path / "nurbs.data").write_text(deck.data_file(rows, velocities, limits))
        if self.shape_name == "sphere":
            spheres = [(row[0], "1", repr(2 * RADIUS), row[4], *row[5:8]) for row in rows]
            (self.path / "sphere.data").write_text(deck.data_file(spheres, velocities, limits))
        if self.shape_name in SUPERQUADRICS:
            axes, exponent = SUPERQUADRICS[self.shape_name]
            half = [repr(a * self.shape.scale) for a in axes]
            bodies = [(row[0], "1", row[4], *half, str(exponent), str(exponent), *row[5:8]) for row in rows]
            (self.path / "superquadric.data").write_text(deck.data_file(bodies, (), limits))
            (self.path / "turned").write_text(
                "".join(f"set atom {row[0]} quat_direct {' '.join(row[8:12])}\n" for row in rows))

    def variables(self, tolerance):
        return {"shape": self.shape.file, "tolerance": tolerance,
                "width": self.width, "lid": self.lid, "n": self.count, "start": RELAX}


class Job:
    """One row of the table: a case in a state, on so many ranks, by one program."""

    def __init__(self, name, program, case, state, bed, ranks, tolerance):
        self.name, self.program, self.case, self.state = name, program, case, state
        self.kind, self.bed, self.ranks, self.tolerance = CASES[case][0], bed, ranks, tolerance
        self.runs = []

    def restart(self, state):
        """Restart of this program in that state; made when missing."""
        mark = hashlib.sha1(self.program.read_bytes() + (DECKS / f"in.{self.kind}").read_bytes() +
                            f"{RELAX} {TURN}".encode()).hexdigest()[:10]
        file = self.bed.path / f"{self.bed.key}-{self.kind}-{mark}-{self.tolerance}-{state}.restart"
        if not file.exists():
            earlier = None if state == "rest" else self.restart("rest")
            print(f"preparing {self.bed.count} x {self.case}, {state}, {self.name} ..", flush=True)
            fresh = file.with_suffix(".fresh")
            self.run(earlier, 1, TURNS[state], 0, RELAX if state == "rest" else TURN, fresh)
            fresh.rename(file)
        return file

    def run(self, restart, ranks, turns, warm, steps, save="end.restart", name=None):
        """Runs from a restart, or from the bed's data file when that is None."""
        start = {"fresh": 0, "from": restart, "turned": "/dev/null"}
        if restart is None:
            start = {"fresh": 1, "from": self.bed.path / f"{self.kind}.data", "turned": self.bed.path / "turned"}
        return Run(self.program, name or self.kind, {**self.bed.variables(self.tolerance), **start, "turns": turns,
                                                     "warm": warm, "steps": steps, "save": save}, ranks)

    def time(self, steps):
        run = self.run(self.restart(self.state), self.ranks, TURNS[self.state], WARM, steps)
        self.runs.append(run)
        return run

    def counts(self):
        """Counts per particle-step, of the NURBS bodies."""
        run = self.run(self.restart(self.state), self.ranks, TURNS[self.state], 0, 0, name="counts")
        columns = list(run.tables[-1].values())[1:]
        return {name: float(np.mean(column[1:])) / self.bed.count for name, column in zip(STATS, columns)}

    def row(self, counts, empty):
        run = self.runs[-1]
        us = [r.us_busy for r in self.runs]
        row = {"program": self.name, "case": self.case, "state": self.state, "n": self.bed.count, "ranks": self.ranks,
               "tolerance": self.tolerance if self.kind == "nurbs" else "", "steps": run.steps, "repeats": len(us),
               "us": statistics.median(us), "us_min": min(us), "us_max": max(us),
               "us_wall": statistics.median(r.us for r in self.runs)}
        for name, label in (("pair", "Pair"), ("neigh", "Neigh"), ("comm", "Comm"), ("other", "Other")):
            row[name] = statistics.median(r.share(label) for r in self.runs)
        if counts:
            row.update(contacts=counts["contacts"], pairs=counts["pairs"], us_contact=row["us"] / counts["contacts"])
            if self.kind == "nurbs":
                row.update({name: counts[name] / max(counts["pairs"], 1e-9)
                            for name in "skipped rejected local warm cold fallback".split()})
                row.update(newton=counts["newton"] / max(counts["contacts"], 1e-9),
                           unresolved=counts["unresolved"] * self.bed.count)
        row["bytes_host"] = run.memory * self.ranks / self.bed.count
        if self.ranks == 1:
            row["bytes_rss"] = (min(r.rss for r in self.runs) - empty) / self.bed.count
        row["kinetic"] = run.tables[-1]["KinEng"][-1] / (self.bed.count * DENSITY * VOLUME * GRAVITY * RADIUS)
        return row


# --- The table -------------------------------------------------------------------------------------------------


def machine_name():
    for line in open("/proc/cpuinfo"):
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown CPU"


def programs(options):
    """Builds of liggghts-nurbs to time, by name; the first one makes the beds and runs the host's spheres."""
    found = {"nurbs": deck.PROGRAM}
    for item in options.program:
        name, _, path = item.partition("=")
        if not path:
            sys.exit(f"--program {item}: give NAME=PATH")
        found[name] = pathlib.Path(path).resolve()
    return found


def superquadric_program():
    path = os.environ.get("LIGGGHTS_SUPERQUADRIC")
    return pathlib.Path(path).resolve() if path else None


def steps_for(case, state, count, seconds):
    """About `seconds` of 2 us per particle-step; host spheres, which are faster, get more where steps are alike."""
    steps = max(100, round(seconds * 1e6 / (2 * count)))
    return steps * 6 if case == "sphere" and state == "rest" else steps


def jobs_of(options):
    superquadric, builds, jobs, beds = superquadric_program(), programs(options), [], {}
    for count in options.n:
        for case in options.only:
            kind, shape = CASES[case]
            if kind == "superquadric" and superquadric is None:
                continue
            if (shape, count) not in beds:
                beds[shape, count] = Bed(shape, count, next(iter(builds.values())), options.beds)
            for state in options.state:
                for ranks in options.ranks:
                    chosen = {"superquadric": {"superquadric": superquadric}, "nurbs": builds,
                              "sphere": {"host": next(iter(builds.values()))}}[kind]
                    jobs += [Job(name, path, case, state, beds[shape, count], ranks, options.tolerance)
                             for name, path in chosen.items()]
    return jobs


def add_ratios(jobs, rows):
    """Ratios within the run: to host spheres, and of superquadrics to ours; round by round, then the median."""
    runs = {(job.case, job.state, job.bed.count, job.ranks): job.runs for job in jobs}
    for job, row in zip(jobs, rows):
        same = (job.state, job.bed.count, job.ranks)
        for column, case in (("to_sphere", "sphere"), ("to_superquadric", "superquadric-" + job.case)):
            other = runs.get((case, ) + same, [])
            ratios = [mine.us_busy / theirs.us_busy for mine, theirs in zip(job.runs, other)]
            if ratios:
                row[column] = statistics.median(ratios) if case == "sphere" else 1 / statistics.median(ratios)


def earlier_rows(file, jobs):
    """Rows of an earlier CSV that are not measured again."""
    again = {(job.name, job.case, job.state, str(job.bed.count), str(job.ranks)) for job in jobs}
    mine = lambda row: tuple(row[key] for key in ("program", "case", "state", "n", "ranks"))  # noqa: E731
    return [row for row in read(file)[1] if mine(row) not in again] if file.exists() else []


def write(rows, columns, file, note):
    file.parent.mkdir(parents=True, exist_ok=True)
    with open(file, "w", newline="") as stream:
        stream.write(f"# {machine_name()}, {os.cpu_count()} cores; {note}\n")
        writer = csv.DictWriter(stream, columns, restval="")
        writer.writeheader()
        writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)


def show(rows):
    print(f"{'program':13}{'case':23}{'state':9}{'n':>6} r    us  (min)   per contact  pair neigh comm other  "
          "contacts local warm cold  B/particle  kinetic   /sphere  superq/", flush=True)
    for row in rows:
        number = lambda key, form: format(row[key], form) if row.get(key, "") != "" else "-"  # noqa: E731
        print(f"{row['program']:13}{row['case']:23}{row['state']:9}{row['n']:6} {row['ranks']} {row['us']:6.3f} "
              f"({row['us_min']:.3f}) {number('us_contact', '8.3f'):>8}     {row['pair']:6.2f}{row['neigh']:6.2f}"
              f"{row['comm']:5.2f}{row['other']:6.2f}  {number('contacts', '6.2f'):>8} {number('local', '5.3f'):>5}"
              f"{number('warm', '5.2f'):>5}{number('cold', '5.2f'):>5} {number('bytes_rss', '8.0f'):>9}"
              f"  {row['kinetic']:8.1e} {number('to_sphere', '7.2f'):>8} {number('to_superquadric', '7.2f'):>8}")


def table(options):
    jobs = jobs_of(options)
    for job in jobs:
        job.restart(job.state)
    counts = {}  # by bed, state: superquadrics and host spheres lie in the same bed
    for job in jobs:
        shape = CASES[job.case][1]
        if job.kind == "nurbs":
            here = job.counts()
            counts[job] = here
            counts.setdefault((shape, job.state, job.bed.count), here)
    empty = {program: empty_memory(program) for program in {job.program for job in jobs}}
    kept = earlier_rows(options.output, jobs) if options.keep else []
    for repeat in range(options.repeats):
        for job in jobs:
            run = job.time(steps_for(job.case, job.state, job.bed.count, options.seconds))
            print(f"{repeat + 1}/{options.repeats} {job.name} {job.case} {job.state} {job.bed.count} {job.ranks}: "
                  f"{run.us_busy:.3f} us", flush=True)
        shared = [counts.get(job) or counts.get((CASES[job.case][1], job.state, job.bed.count)) for job in jobs]
        rows = [job.row(here, empty[job.program]) for job, here in zip(jobs, shared)]
        add_ratios(jobs, rows)
        write(kept + rows, COLUMNS, options.output, f"median of {repeat + 1} interleaved runs")
    show(rows)
    draw_table(options.output)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    words = lambda text: text.split(",")  # noqa: E731
    parser.add_argument("--quick", action="store_true", help="1,000 particles, one rank, spheres and ellipsoids")
    parser.add_argument("--only", type=words, help="cases: " + ", ".join(CASES))
    parser.add_argument("--n", type=lambda text: [int(w) for w in words(text)])
    parser.add_argument("--ranks", type=lambda text: [int(w) for w in words(text)])
    parser.add_argument("--state", type=words, default=list(TURNS))
    parser.add_argument("--repeats", type=int)
    parser.add_argument("--seconds", type=float, help="of a timed run, about (for 2 us per particle-step)")
    parser.add_argument("--tolerance", default="1e-9")
    parser.add_argument("--tolerances", type=words, nargs="?", const=[f"1e-{k}" for k in range(2, 13, 2)])
    parser.add_argument("--program", action="append", default=[], metavar="NAME=PATH")
    parser.add_argument("--beds", type=pathlib.Path, default=deck.BUILD / "scene")
    parser.add_argument("--keep", action="store_true", help="keep rows of OUTPUT that are not measured again")
    parser.add_argument("--output", type=pathlib.Path)
    parser.add_argument("--plot", type=pathlib.Path, metavar="CSV")
    options = parser.parse_args()
    quick = options.quick
    default = ["ellipsoid", "blocky"] if options.tolerances else list(CASES)
    options.only = options.only or (["sphere", "ellipsoid", "superquadric-ellipsoid"] if quick else default)
    options.n = options.n or ([1000] if quick else [1000, 8000])
    options.ranks = options.ranks or ([1] if quick else [1, 2])
    options.repeats = options.repeats or (3 if quick else 5)
    options.seconds = options.seconds or (1.0 if quick else 4.0)
    options.beds = options.beds.resolve()
    name = "scene_tolerance.csv" if options.tolerances else "scene.csv"
    options.output = options.output or deck.BUILD / "scene" / name
    for case in options.only:
        if case not in CASES:
            parser.error(f"unknown case {case}; there are {', '.join(CASES)}")
    return options


# --- Cost and observables over the tolerance -------------------------------------------------------------------


def drop(program, shape, tolerance, seed, place):
    """A small bed from lattice to rest: (packing, contacts, ledger residual, kinetic energy, unresolved)."""
    width = box_width(DROPPED)
    text, height = lattice(shape, DROPPED, width, seed)
    (place / "lattice.data").write_text(text)
    run = Run(program, "settle", {"shape": shape.file, "lattice": place / "lattice.data", "bed": place / "settled.data",
                                  "width": width, "height": height, "steps": SETTLE, "tolerance": tolerance,
                                  "n": DROPPED})
    table = np.array(list(run.tables[-1].values()))
    kinetic, weight, total = table[1] + table[2], table[3], table[1:8].sum(0)
    middle = np.mean([float(row[7]) for row in sections((place / "settled.data").read_text())["Atoms"]])
    return (DROPPED * VOLUME / (width**2 * 2 * middle), table[8, -1] / DROPPED,
            abs(total - total[0]).max() / (weight[0] - weight[-1]),
            kinetic[-1] / (DROPPED * DENSITY * VOLUME * GRAVITY * RADIUS), table[9].max())


def tolerance_table(options):
    program, jobs, dropped = deck.PROGRAM, {}, {}
    cases = [case for case in options.only if CASES[case][0] == "nurbs"]
    for case in cases:
        bed = Bed(CASES[case][1], 1000, program, options.beds)
        for tolerance in options.tolerances:
            with tempfile.TemporaryDirectory() as place:
                dropped[case, tolerance] = np.array([drop(program, bed.shape, tolerance, seed, pathlib.Path(place))
                                                     for seed in range(1, SEEDS + 1)])
            print(f"{case} {tolerance}: packing, contacts, ledger, kinetic, unresolved",
                  dropped[case, tolerance].mean(0), flush=True)
            for state in TURNS:
                jobs[case, tolerance, state] = Job("nurbs", program, case, state, bed, 1, tolerance)
                jobs[case, tolerance, state].restart(state)
    for _ in range(options.repeats):
        for (case, tolerance, state), job in jobs.items():
            job.time(steps_for(case, state, 1000, options.seconds))
    rows = []
    for case in cases:
        for tolerance in options.tolerances:
            drops = dropped[case, tolerance]
            mean, spread = drops.mean(0), drops.std(0, ddof=1)
            us = [statistics.median(run.us_busy for run in jobs[case, tolerance, state].runs) for state in TURNS]
            values = (case, tolerance, *us, mean[0], spread[0], mean[1], spread[1], mean[2], spread[2], mean[3],
                      drops[:, 4].max())
            rows.append(dict(zip(TOLERANCE_COLUMNS, values)))
            print({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in rows[-1].items()}, flush=True)
    write(rows, TOLERANCE_COLUMNS, options.output, f"costs: median of {options.repeats} interleaved runs")
    draw_tolerances(options.output)


# --- Pictures --------------------------------------------------------------------------------------------------


def read(file):
    with open(file, newline="") as stream:
        note = stream.readline().lstrip("# ").strip()
        return note, list(csv.DictReader(stream))


def pyplot():
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    return plt


def draw_table(file):
    """Bars: time of a particle-step by case, split into its shares; a panel for each state and number of ranks."""
    plt = pyplot()
    note, rows = read(file)
    states, ranks = (sorted({row[key] for row in rows}) for key in ("state", "ranks"))
    counts = sorted({int(row["n"]) for row in rows})
    builds = {row["program"] for row in rows} - {"host", "superquadric"}
    label = lambda row: row["case"] if len(builds) < 2 or row["program"] not in builds else (  # noqa: E731
        f"{row['case']} [{row['program']}]")
    labels = list(dict.fromkeys(label(row) for row in rows))
    figure, axes = plt.subplots(len(states), len(ranks), squeeze=False, sharex=True, constrained_layout=True,
                                figsize=(max(5, 1 + 0.9 * len(labels)) * len(ranks), 4.2 * len(states)))
    colours = {"pair": "tab:blue", "neigh": "tab:orange", "comm": "tab:green", "other": "tab:grey"}
    for axis, (state, rank) in zip(axes.flat, ((s, r) for s in states for r in ranks)):
        for row in (row for row in rows if (row["state"], row["ranks"]) == (state, rank)):
            width = 0.8 / len(counts)
            x = labels.index(label(row)) - 0.4 + width * (counts.index(int(row["n"])) + 0.5)
            bottom, us = 0.0, float(row["us"])
            for part, colour in colours.items():
                share = us * float(row[part])
                axis.bar(x, share, width * 0.92, bottom, color=colour, alpha=1 - 0.25 * counts.index(int(row["n"])))
                bottom += share
            axis.annotate(f"{us:.2f}", (x, us), ha="center", va="bottom", fontsize=7)
        axis.set_xticks(range(len(labels)), labels, rotation=35, ha="right", fontsize=8)
        axis.set(title=f"{state}, {rank} rank{'s' if rank != '1' else ''}", ylabel="µs per particle-step")
        axis.grid(axis="y", alpha=0.3)
    marks = [plt.Rectangle((0, 0), 1, 1, color=colour) for colour in colours.values()]
    axes.flat[0].legend(marks, colours, fontsize=8)
    figure.suptitle(f"Bars of a group: {', '.join(f'{n:,}' for n in counts)} particles. {note}", fontsize=9)
    figure.savefig(pathlib.Path(file).with_suffix(".png"), dpi=110)


def draw_tolerances(file):
    plt = pyplot()
    note, rows = read(file)
    figure, axes = plt.subplots(1, 4, figsize=(17, 4.2), constrained_layout=True)
    for case, colour in zip(dict.fromkeys(row["case"] for row in rows), ("tab:blue", "tab:red", "tab:green", "k")):
        mine = [row for row in rows if row["case"] == case]
        column = lambda name: np.array([float(row[name]) for row in mine])  # noqa: E731
        x = column("tolerance")
        axes[0].semilogx(x, column("us_rest"), "o-", color=colour, label=f"{case}, rest")
        axes[0].semilogx(x, column("us_tumbling"), "s--", color=colour, label=f"{case}, tumbling")
        axes[1].errorbar(x, column("packing"), column("packing_sd"), fmt="o-", color=colour, capsize=3, label=case)
        axes[2].errorbar(x, column("contacts"), column("contacts_sd"), fmt="o-", color=colour, capsize=3, label=case)
        axes[3].loglog(x, column("ledger"), "o-", color=colour, label=case)
    titles = ("µs per particle-step", "packing fraction (3 drops)", "contacts per particle (3 drops)",
              "energy ledger: error / energy lost")
    for axis, title in zip(axes, titles):
        axis.set(title=title, xlabel="tolerance", xscale="log")
        axis.invert_xaxis()
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    axes[0].set_ylim(bottom=0)
    figure.suptitle(note, fontsize=9)
    figure.savefig(pathlib.Path(file).with_suffix(".png"), dpi=110)


def main():
    options = arguments()
    if options.plot:
        (draw_tolerances if "tolerance" in options.plot.name else draw_table)(options.plot)
    elif options.tolerances:
        tolerance_table(options)
    else:
        table(options)


if __name__ == "__main__":
    main()
