"""Runs LIGGGHTS decks for the tests: a deck is a string, run under N ranks in a fresh directory.

    run = deck.run(text, ranks=2, files={"pebble.json": path_or_text})
    run.status, run.screen, run.log     # exit status, standard output, log file
    run.thermo["KinEng"]                # last thermo table, column by column (numpy); run.tables: all of them
    run.read("out.data"), run.dump("dump.txt")
"""
import contextlib
import fcntl
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / os.environ.get("BUILD", "build")
PROGRAM = BUILD / "liggghts-nurbs"
TIME_LIMIT = 900  # s; ends what hangs: nothing else may depend on how fast a machine is

ENVIRONMENT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
               "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMP_NUM_THREADS": "1",
               "OMPI_MCA_mpi_yield_when_idle": "1",  # waiting ranks let others run: ten times faster on busy cores
               "OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self,vader",  # ask for no network hardware: 0.4 s a start
               "OMPI_MCA_ess_singleton_isolated": "1",
               "OMPI_MCA_opal_signal": ""}  # Open MPI's crash handler can hang for ever where a crash should end the run


class Run:
    """What a run left behind. Its directory lives as long as the object."""

    def __init__(self, directory, status, screen):
        self._keep = directory
        self.path = pathlib.Path(directory.name)
        self.status = status
        self.screen = screen
        log = self.path / "log.liggghts"
        self.log = log.read_text(errors="replace") if log.exists() else ""
        self.tables = thermo_tables(self.log)

    @property
    def thermo(self):
        return self.tables[-1]

    @property
    def errors(self):
        """The lines that start with ERROR."""
        return [line for line in self.screen.splitlines() if line.startswith("ERROR")]

    def read(self, name):
        return (self.path / name).read_text()

    def dump(self, name):
        """Frames of a `dump custom` text file: list of (step, {column: array}), rows sorted by id."""
        return dump_frames(self.read(name))


@contextlib.contextmanager
def cores(ranks):
    """A core a rank, or all: ranks wait for each other at every step, and beside others ten times as long.
    CORES, a directory of one file a core, is given by tests/run; without it nothing is shared."""
    with contextlib.ExitStack() as taken:
        files = [taken.enter_context(open(p)) for p in sorted(pathlib.Path(os.environ["CORES"]).iterdir())] \
            if "CORES" in os.environ else []
        if ranks > 1:
            for file in files[:ranks]:  # always in this order: no two wait for each other
                fcntl.flock(file, fcntl.LOCK_EX)
        elif files:
            take_one(files)
        yield


def take_one(files):
    """Locks the last file that is free; all being taken, one that this process always waits for."""
    for file in reversed(files):
        with contextlib.suppress(BlockingIOError):
            return fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    fcntl.flock(files[os.getpid() % len(files)], fcntl.LOCK_EX)


def run(text, ranks=1, files=None, program=None, env=None, timeout=TIME_LIMIT):
    """Runs the deck `text`. `files`: name -> text or path, put into the run's directory first."""
    directory = tempfile.TemporaryDirectory(prefix="nurbs-deck-")
    place = pathlib.Path(directory.name)
    (place / "in.deck").write_text(text)
    for name, content in (files or {}).items():
        if isinstance(content, pathlib.Path):
            shutil.copy(content, place / name)
        else:
            (place / name).write_text(content)
    command = [str(program or PROGRAM), "-in", "in.deck", "-log", "log.liggghts"]
    if ranks > 1:
        command = ["mpirun", "-np", str(ranks)] + command
    with cores(ranks):
        done = subprocess.run(command, cwd=place, env={**os.environ, **ENVIRONMENT, **(env or {})}, timeout=timeout,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True,
                              errors="replace")
    return Run(directory, done.returncode, done.stdout)


def nurbs_shape(*arguments, cwd=None):
    """Runs nurbs-shape: returncode, stdout, stderr."""
    return subprocess.run([str(BUILD / "nurbs-shape"), *map(str, arguments)], cwd=cwd, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True, timeout=TIME_LIMIT)


def run_ok(text, **options):
    """Like run, but a run that fails is an error that shows its output."""
    result = run(text, **options)
    if result.status != 0:
        raise AssertionError(f"deck failed with status {result.status}:\n{result.screen[-3000:]}")
    return result


def thermo_tables(log):
    """Thermo tables of a log: a list of {column name: array}."""
    tables, names, rows = [], None, []
    for line in log.splitlines():
        words = line.split()
        if words[:1] == ["Step"]:
            names, rows = words, []
        elif names and line.startswith("Loop time"):
            tables.append({name: np.array(column) for name, column in zip(names, np.array(rows).T)})
            names = None
        elif names and len(words) == len(names):
            try:
                rows.append([float(word) for word in words])
            except ValueError:
                pass  # a warning among the rows
    return tables


def dump_frames(text):
    frames, lines = [], iter(text.splitlines())
    for line in lines:
        if line.startswith("ITEM: TIMESTEP"):
            step = int(next(lines))
        elif line.startswith("ITEM: NUMBER OF ATOMS"):
            count = int(next(lines))
        elif line.startswith("ITEM: ATOMS"):
            names = line.split()[2:]
            rows = np.array([[float(word) for word in next(lines).split()] for _ in range(count)])
            rows = rows.reshape(count, len(names))
            if "id" in names:
                rows = rows[np.argsort(rows[:, names.index("id")])]
            frames.append((step, dict(zip(names, rows.T))))
    return frames


def example(name, changes=(), time=1.0, steps=1.0):
    """Text of an example's deck, its time step times `time`, its runs as many steps times `steps`; `changes`: (old, new)."""
    text = (ROOT / "examples" / name / f"in.{name}").read_text()
    for old, new in changes:
        if old not in text:
            raise AssertionError(f"{name}: no {old!r}")
        text = text.replace(old, new)
    text = re.sub(r"^(timestep +)(\S+)", lambda m: f"{m[1]}{float(m[2]) * time:g}", text, flags=re.M)
    return re.sub(r"^(run +)(\d+)", lambda m: f"{m[1]}{max(1, round(int(m[2]) * steps))}", text, flags=re.M)


def box_shape(a, b, c, gyration=None):
    """Shape file of a box with edges 2a, 2b, 2c about the origin: six bilinear patches, normals outward."""
    half = np.array([a, b, c], dtype=float)
    patches = []
    for axis in range(3):
        for side in (-1, 1):
            u, v = np.zeros(3), np.zeros(3)
            u[(axis + 1) % 3], v[(axis + 2) % 3] = side, 1
            normal = np.zeros(3)
            normal[axis] = side
            points = [list((normal + s * u + t * v) * half) for s in (-1, 1) for t in (-1, 1)]
            patches.append({"degree_u": 1, "degree_v": 1, "knotvector_u": [0, 0, 1, 1], "knotvector_v": [0, 0, 1, 1],
                            "size_u": 2, "size_v": 2, "control_points": {"points": points, "weights": [1.0] * 4}})
    content = {"shape": {"type": "surface", "count": 6, "data": patches}}
    if gyration is not None:
        content["gyration"] = list(gyration)
    return json.dumps(content)


def data_file(atoms, velocities=(), box=((-10, 10), (-10, 10), (-10, 10)), types=1):
    """Text of a data file. atoms: lines `id type shape scale density x y z qw qx qy qz` as sequences."""
    lines = ["test", "", f"{len(atoms)} atoms", f"{types} atom types", ""]
    lines += [f"{lo!r} {hi!r} {x}lo {x}hi" for x, (lo, hi) in zip("xyz", box)]
    lines += ["", "Atoms", ""] + [" ".join(word if isinstance(word, str) else repr(word) for word in atom)
                                 for atom in atoms]
    if velocities:
        lines += ["", "Velocities", ""] + [" ".join(word if isinstance(word, str) else repr(word) for word in velocity)
                                          for velocity in velocities]
    return "\n".join(lines) + "\n"


def materials(youngs=5e6, restitution=0.5, friction=0.5):
    """The properties of one atom type that `model hertz tangential history` wants."""
    return f"""fix E all property/global youngsModulus peratomtype {youngs!r}
fix nu all property/global poissonsRatio peratomtype 0.3
fix e all property/global coefficientRestitution peratomtypepair 1 {restitution!r}
fix mu all property/global coefficientFriction peratomtypepair 1 {friction!r}"""


def shape_file(kind, *sizes, **options):
    """Text of a shape file made by `nurbs-shape make KIND`: `sizes` are three semi-axes or one radius, `options` the rest."""
    arguments = ["make", kind]
    if sizes:
        arguments += ["--axes" if len(sizes) == 3 else "--radius", ",".join(repr(float(size)) for size in sizes)]
    for name, value in options.items():
        arguments += [f"--{name}", value]
    with tempfile.TemporaryDirectory() as place:
        file = pathlib.Path(place) / "shape.json"
        nurbs_shape(*arguments, "-o", file).check_returncode()
        return file.read_text()
