#!/usr/bin/python3
"""nurbs-shape export, view and info: triangles, cells, pictures, descriptors; JSON -> STL -> fit -> JSON."""
import pathlib
import re
import struct
import tempfile
import unittest

import numpy as np

import deck
import meshes

call = deck.nurbs_shape


class View(unittest.TestCase):
    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.place = pathlib.Path(directory.name)
        self.shape = self.place / "egg.json"
        self.assertEqual(call("make", "egg", "--radius", 1, "--blunt", 1, "--pointed", 1.6, "-o", self.shape).returncode, 0)

    def info(self, name, file=None):
        return float(re.search(name + r" +(\S+)", call("info", file or self.shape).stdout)[1])

    def test_stl_is_closed_outward_and_near(self):
        stl = self.place / "egg.stl"
        self.assertEqual(call("export", self.shape, "-o", stl).returncode, 0)
        data = stl.read_bytes()
        count = struct.unpack("<I", data[80:84])[0]
        self.assertEqual(len(data), 84 + 50 * count)
        rows = np.frombuffer(data[84:], dtype=[("numbers", "<f4", (12,)), ("attribute", "<u2")])["numbers"]
        corners = rows[:, 3:].reshape(-1, 3).astype(float)
        own = meshes.volume(corners, np.arange(3 * count).reshape(-1, 3))
        self.assertAlmostEqual(own / self.info("volume"), 1, 2)
        lower = np.linalg.norm(corners[corners[:, 2] < 0], axis=1)  # a half sphere about the origin
        self.assertLess(abs(lower - 1).max(), 1e-5)

    def test_stl_closes_to_the_last_digit(self):
        """Also at poles, at seams and where patches of several kinds have a corner in common."""
        solid = self.place / "solid.json"
        for kind in (["egg", "--radius", "1", "--blunt", "1", "--pointed", "2"], ["capsule", "--radius", "0.6", "--length", "1.2"],
                     ["tablet", "--radius", "1", "--height", "0.6", "--rim", "0.1"], ["rounded-box", "--axes", "1,0.8,0.6", "--rounding", "0.2"],
                     ["rounded-polyhedron", "--solid", "dodecahedron", "--rounding", "0.03"]):
            self.assertEqual(call("make", *kind, "-o", solid).returncode, 0)
            self.assertEqual(call("export", solid, "-o", self.place / "solid.stl").returncode, 0)
            data = (self.place / "solid.stl").read_bytes()
            rows = np.frombuffer(data[84:], dtype=[("numbers", "<f4", (12,)), ("attribute", "<u2")])["numbers"]
            _, corner = np.unique(rows[:, 3:].reshape(-1, 3), axis=0, return_inverse=True)
            a, b, c = corner.reshape(-1, 3).T
            edges = np.concatenate([np.stack(e, axis=1) for e in ((a, b), (b, c), (c, a))])
            there, back = (np.unique(e, axis=0) for e in (edges, edges[:, ::-1]))
            self.assertEqual(len(there), len(edges), kind)
            self.assertTrue(np.array_equal(there, back), kind)

    def test_stl_and_back_by_fit(self):
        stl, back = self.place / "egg.stl", self.place / "back.json"
        self.assertEqual(call("export", self.shape, "-o", stl).returncode, 0)
        run = call("fit", stl, "--tolerance", "2%", "-o", back)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertAlmostEqual(self.info("volume", back) / self.info("volume"), 1, 1)
        self.assertEqual(call("check", back).returncode, 0)

    def test_descriptors(self):
        sphere = self.place / "sphere.json"
        call("make", "sphere", "--radius", 2, "-o", sphere)
        self.assertAlmostEqual(self.info("surface", sphere) / (16 * np.pi), 1, 3)
        self.assertAlmostEqual(self.info("sphericity", sphere), 1, 3)
        ellipsoid = self.place / "ellipsoid.json"
        call("make", "ellipsoid", "--axes", "1,3,2", "-o", ellipsoid)
        self.assertAlmostEqual(self.info("elongation I/L", ellipsoid), 2 / 3, 4)
        self.assertAlmostEqual(self.info("flatness S/I", ellipsoid), 1 / 2, 4)

    def test_picture_and_cells(self):
        for name in ("egg.PNG", "egg.png", "egg.vtu"):
            run = call("view", self.shape, "-o", self.place / name)
            self.assertEqual(run.returncode, 0, run.stderr)
        self.assertTrue((self.place / "egg.png").read_bytes().startswith(b"\x89PNG"))
        self.assertIn("HigherOrderDegrees", (self.place / "egg.vtu").read_text(errors="replace"))
        self.assertEqual(sorted(p.name for p in self.place.iterdir()), ["egg.PNG", "egg.json", "egg.png", "egg.vtu"])

    def test_bad_requests(self):
        for arguments in (["view", self.shape, "-o", "a.gif"], ["export", self.shape, "-o", "a.3dm"],
                          ["export", self.place / "none.json", "-o", self.place / "a.stl"],
                          ["export", self.shape, "--tolerance", "0", "-o", self.place / "a.stl"]):
            run = call(*arguments)
            self.assertEqual(run.returncode, 1)
            self.assertRegex(run.stderr, r"\AERROR: [^\n]*\n\Z")
            self.assertFalse((self.place / "a.stl").exists())

    def test_options_of_another_kind_of_file(self):
        """What a file takes no notice of is refused."""
        for option, value, names in (("--unit", "m", ("a.stl", "a.vtu")), ("--tolerance", "1%", ("a.step", "a.STP", "a.vtu"))):
            for name in names:
                run = call("export", self.shape, option, value, "-o", self.place / name)
                self.assertEqual(run.returncode, 1)
                self.assertRegex(run.stderr, rf"\AERROR: export: {option} is for [^\n]*\n\Z")
                self.assertFalse((self.place / name).exists())


if __name__ == "__main__":
    unittest.main()
