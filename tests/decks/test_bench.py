#!/usr/bin/python3
"""What the benches write can be read."""
import csv
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402


class Sequences(unittest.TestCase):
    def test_names_with_commas_are_one_column(self):
        with tempfile.TemporaryDirectory() as place:
            file = Path(place) / "out.csv"
            subprocess.run([deck.BUILD / "bench" / "sequences", file, "2", "56", "8"], check=True, stderr=subprocess.DEVNULL)
            head, *rows = csv.reader(file.read_text().splitlines()[1:])
        self.assertEqual({len(row) for row in rows}, {len(head)})
        self.assertTrue(any("," in name for row in rows for name in row[:2]))


if __name__ == "__main__":
    unittest.main()
