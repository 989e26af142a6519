#!/usr/bin/python3
"""The decks of the examples run, cut short, on one and two ranks, and are as short as their READMEs say."""
import re
import subprocess
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402

EXAMPLES = deck.ROOT / "examples"


def stl(script, *arguments):
    """Files that a script of an example writes."""
    place = deck.BUILD / "test-examples"
    place.mkdir(parents=True, exist_ok=True)
    subprocess.run([sys.executable, EXAMPLES / script, *arguments], cwd=place, check=True)
    return place


class Examples(unittest.TestCase):
    def run_both(self, text, files, expected="Less insertions"):
        for ranks in (1, 2):
            result = deck.run_ok(text, files=files, ranks=ranks)
            self.assertEqual(re.findall(f"WARNING: (?!.*(?:{expected})).*", result.screen), [])
        return result

    def test_at_most_forty_lines(self):
        for name in ("packing", "shape_fidelity", "hopper", "drum", "repose", "press"):
            lines = (EXAMPLES / name / f"in.{name}").read_text().splitlines()
            self.assertLessEqual(sum(1 for line in lines if line.strip()), 40, name)

    def test_packing(self):
        text = deck.example("packing", [("run          500 ", "run          20 "), ("< 5e3", "< -1e9"), ("> 50", "> 1e9"),
                                 ("volumefraction_region 0.25", "volumefraction_region 0.1")])
        result = self.run_both(text, {"ellipsoid.json": deck.shape_file("ellipsoid", 1.25, 1, 0.8)})
        self.assertAlmostEqual(result.thermo["fraction"][-1], 0.1, delta=5e-3)

    def test_hopper(self):
        place = stl("hopper/silo.py", "0.03", "0.015", "0.32")
        text = deck.example("hopper", [("particles_in_region 1600", "particles_in_region 60"), ("run          8000", "run          300"),
                                ("run          12000", "run          300")])
        result = self.run_both(text, {"ellipsoid.json": deck.shape_file("ellipsoid", 1, 0.8, 1.2),
                                      "silo.stl": place / "silo.stl", "lid.stl": place / "lid.stl"})
        self.assertIn("inserted 60", result.screen)

    def test_drum(self):
        place = stl("drum/drum.py", "0.04", "0.04")
        text = deck.example("drum", [("particles_in_region 400", "particles_in_region 60"), ("run          4000", "run          300"),
                              ("run          10000", "run          300"), ("run          20000", "run          300")])
        result = self.run_both(text, {"ellipsoid.json": deck.shape_file("ellipsoid", 1, 0.8, 1.2), "drum.stl": place / "drum.stl"})
        self.assertEqual(result.thermo["Atoms"][-1], 60)

    def test_repose(self):
        place = stl("repose/floor.py", "0.06", "0.024", "0.003")
        text = deck.example("repose", [("particles_in_region 350", "particles_in_region 60")], steps=0.05)
        result = self.run_both(text, {"pebble.json": deck.shape_file("pebble"), "floor.stl": place / "floor.stl"})
        self.assertEqual(result.tables[0]["Atoms"][-1], 60)

    def test_press(self):
        text = deck.example("press", [("particles_in_region 200", "particles_in_region 20"), ("0.0001 0.13 ", "0.0001 0.03 "),
                                       ("amplitude 0 0 -8e-3", "amplitude 0 0 -4e-3")], steps=0.5)
        shapes = {"tablet.json": deck.shape_file("tablet", radius=1, height=0.8, rim=0.15),
                  "capsule.json": deck.shape_file("capsule", radius=0.6, length=1.2), "pebble.json": deck.shape_file("pebble")}
        # One layer between the punch and the floor: crushed.
        result = self.run_both(text, shapes, expected="Less insertions|contacts were as deep as|bodies overlapped by as much as")
        self.assertEqual(result.thermo["Atoms"][-1], 20)
        force = np.loadtxt(result.path / "press.txt")[:, 1]
        self.assertEqual(force[0], 0)
        self.assertGreater(force.max(), 0.1)


if __name__ == "__main__":
    unittest.main()
