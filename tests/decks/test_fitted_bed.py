#!/usr/bin/python3
"""Ten grains fitted by nurbs-shape, and a rounded polyhedron, settle in one bed, bodies of ten more families in a box of
triangles: no contact stays unresolved; equal shape files share what they hold, and say the same whoever made them."""
import pathlib
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck  # noqa: E402
import meshes  # noqa: E402

PRIMES = (15485863, 15485867, 15485917, 15485927, 15485933, 15485941, 15485959, 15485989, 15485993, 15486013, 15486041)

BED = """
units si
newton off
communicate single vel yes
atom_style nurbs {files}
{space}
create_box 1 box
neighbor 0.3 bin
neigh_modify delay 0
pair_style gran/nurbs {settings}
pair_coeff * * {law}
{walls} {law}
fix gravity all gravity 9.81 vector 0 0 -1
fix motion all nve/nurbs
{templates}
fix mix all particledistribution/discrete 32452843 {count} {shares}
region fill block {fill} units box
fix insert all insert/pack seed 49979687 distributiontemplate mix insert_every once overlapcheck yes all_in yes &
 particles_in_region {bodies} region fill
timestep {step}
run 1
unfix insert
compute stats all nurbs/stats
compute low all reduce min z
{output}
run {steps}
"""

FLOOR = {
    "space": "boundary p p f\nregion box block -6 6 -6 6 0 20 units box", "settings": "tolerance 1e-6",
    "law": "kn 1e6 kt 5e5 cn 3e3 mu 0.4", "walls": "fix floor all wall/nurbs plane 0 0 0 0 0 1", "fill": "-6 6 -6 6 2 12",
    "bodies": 60, "step": "5e-4", "output": "thermo_style custom step atoms ke c_stats[8] c_stats[10] c_low\nthermo 20"}

BOX = {
    "space": "boundary f f f\nregion box block -2.5 2.5 -2.5 2.5 -0.5 6.5 units box\nprocessors 2 1 1", "settings": "",
    "law": "kn 1e8 kt 5e7 cn 6e4 mu 0.4",
    "walls": "fix box all mesh/surface file box.stl type 1\nfix wall all wall/nurbs mesh box", "fill": "-2 2 -2 2 0.1 5.9",
    "bodies": 30, "step": "4e-5", "output": """
compute moving all ke
compute turning all erotate/nurbs
compute ledger all nurbs/energy
variable weight atom mass*9.81*z
compute lifted all reduce sum v_weight
variable kinetic equal c_moving+c_turning
variable lost equal c_ledger[3]+c_ledger[4]
variable sum equal v_kinetic+c_lifted+c_ledger[1]+c_ledger[2]+v_lost
variable unresolved equal c_stats[10]
fix worst all ave/time 1 1 1 v_unresolved file unresolved.txt
thermo_style custom step atoms v_kinetic v_lost v_sum c_low
thermo_modify norm no
thermo 1000"""}


def make_shapes(place, count):
    files = []
    for seed in range(1, count + 1):
        points, faces = meshes.grain(seed, 3, rough=0.25)
        mesh = place / "mesh.stl"
        mesh.write_bytes(meshes.binary_stl(points, faces))
        files.append(f"g{seed}.json")
        deck.nurbs_shape("fit", mesh, "--tolerance", "6%", "-o", place / files[-1]).check_returncode()
    files.append("crystal.json")
    deck.nurbs_shape("make", "rounded-polyhedron", "--solid", "octahedron", "--radius", "1.2", "--rounding", "0.2",
                     "-o", place / files[-1]).check_returncode()
    return {name: (place / name).read_text() for name in files}


def bed(names, steps, scene=FLOOR):
    stems = [name.split(".")[0] for name in names]
    return BED.format(files=" ".join(names), count=len(names), steps=steps,
                      templates="\n".join(f"fix t{k} all particletemplate/nurbs {PRIMES[k]} atom_type 1 density constant 1000"
                                          f" shape {stem} scale constant 1" for k, stem in enumerate(stems)),
                      shares=" ".join(f"t{k} {1 / len(names):.6f}" for k in range(len(names))), **scene)


def hull_of(points):
    """Points and triangles of a convex hull, by gift wrapping over few points: wound outward."""
    n, faces = len(points), []
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(j + 1, n):
                side = (points - points[i]) @ np.cross(points[j] - points[i], points[k] - points[i])
                if (side <= 1e-12).all():
                    faces.append((i, j, k))
                elif (side >= -1e-12).all():
                    faces.append((i, k, j))
    return points, np.array(faces)


def families():
    """Name -> points, triangles: ten kinds of body, of radius 0.5."""
    random = np.random.default_rng(5)
    ball, triangles = meshes.icosphere(3)
    x, y, z = ball.T
    grain, _ = meshes.grain(8, 3, rough=0.25)
    along = random.normal(size=3)
    along /= np.linalg.norm(along)
    height = grain @ along
    angle = 2 * np.pi * np.arange(5) / 5
    ring = [np.stack([np.cos(angle + turn), np.sin(angle + turn), np.full(5, 1.2 * turn)], axis=1) for turn in (0, 0.4, 0.8)]
    crushed = random.normal(size=(18, 3)) * (1.2, 1, 0.8)
    bodies = {"egg": np.stack([np.where(x > 0, 1.5 * x, x), 0.7 * y, 0.7 * z], axis=1), "lens": ball * (1, 1, 0.3),
              "clipped": grain - np.maximum(height - np.quantile(height, 0.85), 0)[:, None] * along,
              "half": np.stack([x, 0.8 * y, np.maximum(0.7 * z, 0)], axis=1),
              "bean": np.stack([1.6 * x, 0.8 * y + 0.2 * x**2, 0.7 * z], axis=1), "bar": ball * (4, 1, 0.8),
              "die": ball / (np.abs(ball)**5).sum(axis=1)[:, None]**0.2,
              "drop": np.stack([x, y, np.where(z > 0, 2 * z, z)], axis=1) * (1 - 0.6 * np.clip(z, 0, 1))[:, None]**(1, 1, 0)}
    out = {name: (points, triangles) for name, points in bodies.items()}
    out["twisted"] = hull_of(np.vstack(ring) + 0.01 * random.normal(size=(15, 3)))  # no four points in a plane
    out["crushed"] = hull_of(crushed)
    return {name: (0.5 * points / np.linalg.norm(points - points.mean(axis=0), axis=1).max(), faces)
            for name, (points, faces) in out.items()}


def open_box(half, high):
    corners = np.array([(x, y, z) for x in (-half, half) for y in (-half, half) for z in (0, high)], dtype=float)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4))
    return meshes.ascii_stl(corners, meshes.halves(sides))


class TenFamilies(unittest.TestCase):
    def test_settle_in_a_box_of_triangles(self):
        files = {"box.stl": open_box(2, 6)}
        with tempfile.TemporaryDirectory() as place:
            mesh, shape = pathlib.Path(place) / "mesh.stl", pathlib.Path(place) / "shape.json"
            for name, (points, faces) in families().items():
                mesh.write_bytes(meshes.binary_stl(points, faces))
                made = deck.nurbs_shape("fit", mesh, "--tolerance", "5%", "--piece", "1", "-o", shape)
                self.assertEqual(made.returncode, 0, name + made.stderr)
                files[name + ".json"] = shape.read_text()
        run = deck.run_ok(bed([f for f in files if f != "box.stl"], 48000, BOX), ranks=2, files=files)
        unresolved = np.loadtxt(run.path / "unresolved.txt")[:, 1]
        self.assertEqual(len(unresolved), 48001)
        self.assertEqual(unresolved.max(), 0)
        thermo = run.thermo
        self.assertGreater(thermo["Atoms"][-1], 20)
        self.assertGreater(thermo["low"][-1], 0.05)
        self.assertLess(thermo["kinetic"][-1], 5e-2 * thermo["kinetic"].max())  # round ones still roll
        print(f"    {thermo['Atoms'][-1]:.0f} bodies: ledger off by {np.ptp(thermo['sum']) / thermo['lost'][-1]:.1e} of what is lost,"
              f" kinetic energy {thermo['kinetic'][-1] / thermo['kinetic'].max():.1e} of its largest", flush=True)
        self.assertLess(np.ptp(thermo["sum"]), 1e-2 * thermo["lost"][-1])


class FittedBed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as place:
            cls.files = make_shapes(pathlib.Path(place), 10)

    def test_settles_without_an_unresolved_contact(self):
        thermo = deck.run_ok(bed(list(self.files), 4000), files=self.files).thermo
        self.assertGreater(thermo["Atoms"][-1], 40)
        self.assertEqual(np.abs(thermo["stats[10]"] if "stats[10]" in thermo else thermo["stats[10"]).max(), 0)
        self.assertGreater(thermo["low"][-1], 0.3)
        self.assertLess(thermo["KinEng"][-1], 0.1 * thermo["KinEng"].max())

    # The same content under two names is one shape to the contacts, and two names to the user.
    def test_equal_files(self):
        text = self.files["g1.json"]
        one = deck.run_ok(bed(["a.json", "b.json"], 400), files={"a.json": text, "b.json": text})
        other = deck.run_ok(bed(["a.json", "b.json"], 400), files={"a.json": text, "b.json": text + "\n"})
        for column in one.thermo:
            np.testing.assert_array_equal(one.thermo[column], other.thermo[column])


if __name__ == "__main__":
    unittest.main()
