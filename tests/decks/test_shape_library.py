#!/usr/bin/python3
"""The shapes of examples/shapes load without a word and settle on a floor without an unresolved contact."""
import unittest

import numpy as np

import deck

SHAPES = sorted((deck.ROOT / "examples/shapes").glob("*.json"))

DECK = """
units si
newton off
communicate single vel yes
atom_style nurbs {files}
boundary p p f
read_data data.bed
neighbor 0.5 bin
neigh_modify delay 0
pair_style gran/nurbs
pair_coeff * * kn 1e7 kt 5e6 cn 1e5 mu 0.4
fix floor all wall/nurbs plane 0 0 0 0 0 1 kn 1e7 kt 5e6 cn 1e5 mu 0.4
fix gravity all gravity 9.81 vector 0 0 -1
fix motion all nve/nurbs
compute stats all nurbs/stats
variable bad equal c_stats[10]
variable touching equal c_stats[8]
fix worst all ave/time 1 1 1 v_bad file bad.txt
thermo_style custom step ke v_touching
thermo_modify norm no
thermo 500
timestep 2e-4
run 15000
"""


class Library(unittest.TestCase):
    def test_there_are_a_dozen(self):
        self.assertGreaterEqual(len(SHAPES), 12)
        for file in SHAPES:
            check = deck.nurbs_shape("check", file)
            self.assertEqual(check.returncode, 0, check.stderr)
            self.assertEqual(check.stderr, "")
            if file.stem != "tablet":  # where its flat faces meet the rim one curvature falls to zero
                self.assertIn("proven: no dents", check.stdout.replace("not proven", ""))
            self.assertLess(file.stat().st_size, 70000)

    def test_bed_of_fitted_bodies(self):
        files = [f for f in SHAPES if f.stem in ("sand_grain", "bean", "asteroid", "pebble_flat")]
        scale = {"sand_grain": 1.0, "bean": 0.7, "asteroid": 0.35, "pebble_flat": 1.0}
        random = np.random.default_rng(3)
        atoms, side = [], 3
        for k in range(36):
            shape = k % len(files)
            place = 2.7 * np.array([k % side + 0.5, k // side % side + 0.5, k // side**2 + 0.6])
            turn = random.normal(size=4)
            atoms.append((k + 1, 1, shape + 1, scale[files[shape].stem], 2500.0, *map(float, place),
                          *map(float, turn / np.linalg.norm(turn))))
        high = 2.7 * side
        data = deck.data_file(atoms, box=((0, high), (0, high), (-1, 20)))
        run = deck.run_ok(DECK.format(files=" ".join(f.name for f in files)),
                          files={"data.bed": data, **{f.name: f for f in files}})
        unresolved = [float(line.split()[1]) for line in run.read("bad.txt").splitlines() if line[0] != "#"]
        self.assertEqual(len(unresolved), 15001)
        self.assertEqual(max(unresolved), 0)
        self.assertGreater(run.thermo["touching"][-1], 36)


if __name__ == "__main__":
    unittest.main()
