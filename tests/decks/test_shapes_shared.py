#!/usr/bin/python3
"""Ranks share the making of shapes: the same bits on any number of them, and one error wherever a bad file is."""
import math
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck  # noqa: E402

NAMES = ["a", "b", "c", "d", "e", "f"]  # f is a's content under another name

HEAD = """
units si
newton off
communicate single vel yes
atom_style nurbs {files}
boundary f f f
read_data bodies.data
"""
SETUP = """
neighbor 0.3 bin
neigh_modify delay 0
fix floor all wall/nurbs plane 0 0 -1.2 0 0 1 kn 1e7 kt 5e6 cn 2e5 mu 0.4
fix gravity all gravity 9.81 vector 0 0 -1
fix motion all nve/nurbs
timestep 1e-3
compute q all nurbs/atom qw qx qy qz shape volume
dump d all custom 300 dump{part}.txt id x y z vx vy vz c_q[1] c_q[2] c_q[3] c_q[4] c_q[5] c_q[6]
dump_modify d format "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %g %.17g"
run 300
"""


def files_of(names):
    return " ".join(name + ".json" for name in names)


def bodies():
    """Three layers of six, each turned its own way, a little apart."""
    rows = []
    for k in range(18):
        x, y, z = 2.1 * (k % 3 - 1), 2.1 * (k // 3 % 2), 2.1 * (k // 6)
        turn = math.hypot(1, 0.1 * k, 0.3, 0.05 * k)
        q = " ".join(repr(c / turn) for c in (1, 0.1 * k, 0.3, 0.05 * k))
        rows.append(f"{k + 1} 1 {k % len(NAMES) + 1} 1 2500 {x!r} {y!r} {z!r} {q}")
    return ("bodies\n\n18 atoms\n1 atom types\n\n-6 6 xlo xhi\n-6 6 ylo yhi\n-3 9 zlo zhi\n\nAtoms\n\n" + "\n".join(rows)
            + "\n")


def first_part():
    text = HEAD.format(files=files_of(NAMES))
    text += "pair_style gran/nurbs\npair_coeff * * kn 1e7 kt 5e6 cn 2e5 mu 0.4\n"
    return text + SETUP.format(part=1) + "write_restart half.restart\n"


SECOND_PART = "newton off\nread_restart half.restart\ncommunicate single vel yes\n" + SETUP.format(part=2)


class SharedShapes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as place:
            made = deck.nurbs_shape("make", "pebbles", "--count", 5, "-o", "p", cwd=place)
            assert made.returncode == 0, made.stderr
            texts = [(pathlib.Path(place) / f"p_{k}.json").read_text() for k in range(1, 6)]
        cls.files = {name + ".json": text for name, text in zip(NAMES, texts + texts[:1])}
        cls.files["bodies.data"] = bodies()

    def lines(self, run, name):
        head, rows = run.read(name).rsplit("ITEM: ATOMS", 1)
        return sorted(rows.splitlines()[1:], key=lambda row: int(row.split()[0]))

    def test_same_bits_on_any_number_of_ranks_and_after_a_restart(self):
        expected = None
        for ranks in (1, 2, 4):
            first = deck.run_ok(first_part(), ranks=ranks, files=self.files)
            restart = {"half.restart": first.path / "half.restart"}
            second = deck.run_ok(SECOND_PART, ranks=5 - ranks, files=restart)
            found = self.lines(first, "dump1.txt"), self.lines(second, "dump2.txt")
            self.assertEqual(len(found[0]), 18)
            self.assertEqual({row.split()[11] for row in found[0]}, {str(k) for k in range(1, 7)})
            expected = expected or found
            self.assertEqual(found, expected, ranks)

    def test_one_error_whichever_rank_finds_it(self):
        for bad in NAMES[:3]:
            text = self.files[bad + ".json"]
            at = text.rindex("]")
            broken = {**self.files, bad + ".json": text[:at] + "x" + text[at:]}
            run = deck.run(first_part(), ranks=3, files=broken)
            self.assertNotEqual(run.status, 0)
            self.assertEqual(len(run.errors), 1, run.screen)
            self.assertIn(bad + ".json", run.errors[0])

    def test_two_errors_are_one(self):
        """The first file in the list is named, on however many ranks."""
        broken = {**self.files, "b.json": "{", "d.json": "{"}
        for ranks in (1, 3):
            run = deck.run(first_part(), ranks=ranks, files=broken)
            self.assertNotEqual(run.status, 0)
            self.assertEqual(len(run.errors), 1, run.screen)
            self.assertIn("b.json", run.errors[0])


if __name__ == "__main__":
    unittest.main()
