#!/usr/bin/python3
"""Ten grains fitted by nurbs-shape, and a rounded polyhedron, settle in one bed: no contact stays unresolved; equal shape
files share what they hold, and say the same whoever made them."""
import pathlib
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck  # noqa: E402
import meshes  # noqa: E402

PRIMES = (15485863, 15485867, 15485917, 15485927, 15485933, 15485941, 15485959, 15485989, 15485993, 15486013, 15486041)

DECK = """
units si
newton off
communicate single vel yes
atom_style nurbs {files}
boundary p p f
region box block -6 6 -6 6 0 20 units box
create_box 1 box
neighbor 0.3 bin
neigh_modify delay 0
pair_style gran/nurbs tolerance 1e-6
pair_coeff * * kn 1e6 kt 5e5 cn 3e3 mu 0.4
fix floor all wall/nurbs plane 0 0 0 0 0 1 kn 1e6 kt 5e5 cn 3e3 mu 0.4
fix gravity all gravity 9.81 vector 0 0 -1
fix motion all nve/nurbs
{templates}
fix mix all particledistribution/discrete 32452843 {count} {shares}
region fill block -6 6 -6 6 2 12 units box
fix insert all insert/pack seed 49979687 distributiontemplate mix insert_every once overlapcheck yes all_in yes &
 particles_in_region 60 region fill
timestep 5e-4
run 1
unfix insert
compute stats all nurbs/stats
compute low all reduce min z
thermo_style custom step atoms ke c_stats[8] c_stats[10] c_low
thermo 20
run {steps}
"""


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


def bed(names, steps):
    stems = [name.split(".")[0] for name in names]
    return DECK.format(files=" ".join(names), count=len(names), steps=steps,
                       templates="\n".join(f"fix t{k} all particletemplate/nurbs {PRIMES[k]} atom_type 1 density constant 1000"
                                           f" shape {stem} scale constant 1" for k, stem in enumerate(stems)),
                       shares=" ".join(f"t{k} {1 / len(names):.6f}" for k in range(len(names))))


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
