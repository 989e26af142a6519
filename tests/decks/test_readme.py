#!/usr/bin/python3
"""The deck that the README prints runs as printed."""
import re
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402


class Readme(unittest.TestCase):
    def test_its_deck_runs(self):
        section = (deck.ROOT / "README.md").read_text().split("\n## A deck\n")[1].split("\n## ")[0]
        lines = re.findall(r"^    (.*)$", section, re.MULTILINE)
        self.assertGreater(len(lines), 10)
        result = deck.run_ok("\n".join(lines) + "\n", files={"pebble.json": deck.shape_file("pebble")})
        self.assertNotIn("WARNING", result.screen)
        self.assertGreater(len(list(result.path.glob("pebbles-*.vtu"))), 10)
        self.assertEqual(result.thermo["Atoms"][-1], 36)
        self.assertLess(result.thermo["KinEng"][-1], 2e6)  # 7e7 J in free fall: the floor holds them

    def test_its_restart_recipe(self):
        """What the README says to repeat after read_restart, and no more, goes on to the last bit."""
        section = (deck.ROOT / "README.md").read_text().split("\n## A deck\n")[1].split("\n## ")[0]
        lines = re.findall(r"^    (.*)$", section, re.MULTILINE)
        kept = [line for line in lines if line.split()[0] not in ("dump", "run", "thermo")]
        output = "dump d all custom 500 dump.txt id x y z omegax\ndump_modify d format \"%d %.17g %.17g %.17g %.17g\"\nrun 500\n"
        pebble = {"pebble.json": deck.shape_file("pebble")}
        whole = deck.run_ok("\n".join(kept) + "\nrun 2500\nwrite_restart a.restart\n" + output, files=pebble)
        repeated = [line for line in kept if line.split()[0] in ("communicate", "neighbor", "neigh_modify", "timestep", "fix")]
        again = "newton off\nread_restart a.restart\n" + "\n".join(repeated) + "\n" + output
        run = deck.run_ok(again, files={"a.restart": whole.path / "a.restart"})
        self.assertNotIn("WARNING", run.screen)
        (step, expected), (found_step, found) = whole.dump("dump.txt")[-1], run.dump("dump.txt")[-1]
        self.assertEqual(step, found_step)
        for name in expected:
            np.testing.assert_array_equal(expected[name], found[name])
        forgotten = deck.run_ok(again.replace("timestep", "#"), files={"a.restart": whole.path / "a.restart"})
        self.assertIn("no 'timestep'", forgotten.screen)


if __name__ == "__main__":
    unittest.main()
