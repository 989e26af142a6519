#!/usr/bin/python3
"""The deck that the README prints runs as printed."""
import re
import sys
import unittest
from pathlib import Path

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


if __name__ == "__main__":
    unittest.main()
