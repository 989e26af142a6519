#!/usr/bin/python3
"""The decks of the examples run, cut short, on one and two ranks, and are as short as their READMEs say."""
import re
import subprocess
import sys
import unittest
from pathlib import Path

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
    def run_both(self, text, files):
        for ranks in (1, 2):
            result = deck.run_ok(text, files=files, ranks=ranks)
            self.assertEqual(re.findall(r"WARNING: (?!.*Less insertions).*", result.screen), [])
        return result

    def test_at_most_forty_lines(self):
        for name in ("packing", "hopper", "drum"):
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


if __name__ == "__main__":
    unittest.main()
