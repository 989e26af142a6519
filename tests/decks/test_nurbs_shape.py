#!/usr/bin/python3
"""nurbs-shape: every kind of body makes a file that passes the check; bad input gives one clear line and no file."""
import json
import math
import os
import pathlib
import re
import tempfile
import unittest

import deck

call = deck.nurbs_shape
INERTIA = "1.0,0.9,0.8,-0.04,0.02,0.09"
KINDS = [["sphere", "--radius", "2"], ["ellipsoid", "--axes", "1,2,3"], ["fitted-ellipsoid", "--axes", "1,2,3"],
         ["fitted-ellipsoid", "--axes", "1,2,3", "--spans", "2"], ["smooth-ellipsoid", "--axes", "1,2,3"], ["pebble"],
         ["superellipsoid", "--axes", "1,1,2", "--exponent", "4"], ["revolved", "--equatorial", "2", "--polar", "1"],
         ["box", "--axes=1,2,3"], ["inertia", "--mass", "2", "--inertia", INERTIA],
         ["inertia", "--density", "0.5", "--inertia", INERTIA]]
# Exact bodies: arguments, number of patches, volume, bounding radius.
P = math.pi
EXACT = [(["capsule", "--radius", "1", "--length", "2"], 3, 2 * P + 4 / 3 * P, 2),
         (["tablet", "--radius", "1", "--height", "0.6", "--rim", "0.3"], 4,
          0.6 * P * (0.49 + 0.35 * P * 0.3 + 2 / 3 * 0.09), None),  # disc, half torus about it
         (["tablet", "--radius", "1", "--height", "0.8", "--rim", "0.2"], 5, None, None),
         (["tablet", "--radius", "1", "--height", "0.4", "--cap", "1.6", "--rim", "0.1"], 5, None, None),
         (["lens", "--radius", "1", "--cap", "1.5", "--rim", "0.1"], 4, None, 1),
         (["tablet", "--radius", "1", "--height", "0", "--cap", "1.5", "--rim", "0.1"], 4, None, 1),
         (["lens", "--radius", "1", "--cap", "1", "--rim", "0.1"], 2, 4 / 3 * P, 1),  # half spheres, no rim
         (["tablet", "--radius", "1", "--height", "2", "--cap", "1", "--rim", "0.1"], 3, 2 * P + 4 / 3 * P, 2),
         (["egg", "--radius", "1", "--blunt", "1", "--pointed", "1.6"], 2, 2 / 3 * P * 2.6, None),
         (["rounded-box", "--axes", "1,0.8,0.6", "--rounding", "0.2"], 26,
          8 * 0.8 * 0.6 * 0.4 + 8 * 0.2 * (0.8 * 0.6 + 0.6 * 0.4 + 0.8 * 0.4) + P * 0.04 * 2 * 1.8 + 4 / 3 * P * 0.008,
          math.sqrt(0.64 + 0.36 + 0.16) + 0.2),
         (["rounded-box", "--axes", "1,1,1", "--rounding", "1"], 8, 4 / 3 * P, 1),
         (["pebble", "--seed", "4", "--radius", "2"], 6, 32 / 3 * P, None)]
# Arguments of `make`, and what the error must name.
BAD = [(["cone"], "cone"),
       (["sphere", "--radius", "0"], "--radius is 0, must be > 0"),
       (["sphere", "--radius", "-1"], "--radius is -1"),
       (["sphere", "--radius", "nan"], "--radius is nan"),
       (["sphere", "--radius", "1e-31"], "--radius is 1e-31, must be in 1e-29..1e+29"),
       (["ellipsoid", "--axes", "1,2,1e31"], "--axes is 1e31, must be in 1e-29..1e+29"),
       (["sphere", "--radius", "1e999"], "--radius"),
       (["sphere", "--radius", "2x"], "'2x' is not a number"),
       (["sphere", "--radius"], "--radius needs a value"),
       (["sphere", "--size", "1"], "unknown option --size; allowed are --radius -o"),
       (["sphere", "-r", "1"], "unknown option -r"),
       (["ellipsoid", "--axis", "1,2,3"], "unknown option --axis; allowed are --axes -o"),
       (["ellipsoid", "--axes", "0.012", "0.008", "0.006"], "--axes takes its numbers with commas and no blanks"),
       (["ellipsoid", "--axes", "1,", "2,", "3"], "--axes takes its numbers with commas and no blanks"),
       (["pebble", "other.json"], "the output file is given twice: other.json and "),
       (["sphere", "--radius", "1", "--radius", "2"], "--radius is given twice"),
       (["ellipsoid"], "--axes is missing"),
       (["ellipsoid", "--axes", "1,2"], "--axes has 2 numbers, must have 3"),
       (["ellipsoid", "--axes", "1,,2"], "'' is not a number"),
       (["ellipsoid", "--axes", "1,2,3,"], "'' is not a number"),
       (["fitted-ellipsoid", "--axes", "1,2,3", "--spans", "0"], "must be in 1..12"),
       (["fitted-ellipsoid", "--axes", "1,2,3", "--spans", "1.5"], "whole number"),
       (["rounded-box", "--axes", "1,2,3", "--rounding", "1.5"], "must be at most the least half edge, 1"),
       (["tablet", "--radius", "1", "--height", "1", "--rim", "0.6"], "--rim is 0.6, must be at most half of --height, 0.5"),
       (["tablet", "--radius", "1", "--height", "0", "--rim", "0.1"], "--height is 0, must be > 0"),
       (["lens", "--radius", "1", "--cap", "0.9", "--rim", "0.1"], "--cap is 0.9, must be --radius, 1, at least"),
       (["lens", "--radius", "1", "--cap", "2", "--rim", "1.5"], "--rim is 1.5, must be less than --radius, 1"),
       (["rounded-box", "--axes", "1,1,1", "--rounding", "0.9999999999"], "shape.json: patch 1 is not connected to patch 0"),
       (["capsule", "--radius", "1"], "--length is missing"),
       (["pebble", "--roundness", "0.5"], "add --seed"),
       (["pebble", "--seed", "1.5"], "whole number"),
       (["pebble", "--seed", "1", "--flatness", "0.1"], "must be in 0.2..1"),
       (["pebbles", "--count", "0"], "--count is 0"),
       (["pebbles", "--count", "2", "--roundness", "0.8,0.2"], "down to"),
       (["pebbles", "--count", "2", "--radius", "1e30"], "--radius is 1e30, must be in 1e-29..1e+29"),
       (["superellipsoid", "--axes", "1,2,3"], "--exponent is missing"),
       (["superellipsoid", "--axes", "1,2,3", "--exponent", "1"], "must be in 2..12"),
       (["superellipsoid", "--axes", "1,2,3", "--exponent", "4", "--tolerance", "7%"], "at most 5%"),
       (["superellipsoid", "--axes", "1,2,3", "--exponent", "4", "--tolerance", "0.001%"], "0.01% at least"),
       (["superellipsoid", "--axes", "1,2,3", "--exponent", "4", "--tolerance", "1%", "--spans", "3"], "exclude each other"),
       (["inertia", "--inertia", INERTIA], "--mass or --density is missing"),
       (["inertia", "--inertia", "1,1,3,0,0,0", "--mass", "1"], "less than the sum of the other two"),
       (["inertia", "--inertia", INERTIA, "--mass", "1", "--density", "1"], "--density is 1, must be within 0.1 %")]


class NurbsShape(unittest.TestCase):
    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.addCleanup(self.directory.cleanup)
        self.place = pathlib.Path(self.directory.name)
        self.file = self.place / "shape.json"

    def assert_one_error(self, run, text):
        self.assertEqual(run.returncode, 1, run.stderr)
        self.assertEqual(run.stdout, "")
        self.assertRegex(run.stderr, r"\AERROR: [^\n]*\n\Z")
        self.assertIn(text, run.stderr)

    def test_every_kind_is_usable(self):
        for kind in KINDS:
            with self.subTest(kind=kind):
                made = call("make", *kind, "-o", str(self.file))
                self.assertEqual(made.returncode, 0, made.stderr)
                self.assertEqual([p.name for p in self.place.iterdir()], ["shape.json"])
                data = json.loads(self.file.read_text())["shape"]
                self.assertEqual(len(data["data"]), 1 if kind[0] == "revolved" else 6)
                check = call("check", str(self.file))
                self.assertEqual(check.returncode, 0, check.stderr)
                self.assertIn("usable", check.stdout)

    def test_exact_bodies(self):
        for kind, patches, volume, radius in EXACT:
            with self.subTest(kind=kind):
                made = call("make", *kind, "-o", str(self.file))
                self.assertEqual((made.returncode, made.stderr), (0, ""))
                self.assertEqual(len(json.loads(self.file.read_text())["shape"]["data"]), patches)
                check = call("check", str(self.file))
                self.assertEqual((check.returncode, check.stderr), (0, ""))
                self.assertIn("closed, outward, convex", check.stdout)
                info = call("info", str(self.file)).stdout
                if volume:
                    self.assertAlmostEqual(float(re.search(r"volume +(\S+)", info)[1]) / volume, 1, 10)
                if radius:
                    self.assertAlmostEqual(float(re.search(r"bounding radius +(\S+)", info)[1]) / radius, 1, 6)

    def test_random_pebbles(self):
        made = call("make", "pebbles", "--count", "50", "--seed", "7", "--elongation", "0.7", "--flatness", "0.5,0.6",
                    "-o", str(self.place / "p"))
        self.assertEqual(made.returncode, 0, made.stderr)
        texts = set()
        for k in range(1, 51):
            file = self.place / f"p_{k}.json"
            texts.add(file.read_text())
            check = call("check", str(file))
            self.assertEqual((check.returncode, check.stderr), (0, ""), file)
            xx, yy, zz = map(float, re.search(r"xx (\S+) yy (\S+) zz (\S+)", call("info", str(file)).stdout).groups())
            a, b, c = sorted((math.sqrt(yy + zz - xx), math.sqrt(xx + zz - yy), math.sqrt(xx + yy - zz)), reverse=True)
            self.assertAlmostEqual(b / a, 0.7, 6)
            self.assertTrue(0.5 - 1e-6 < c / b < 0.6 + 1e-6)
        self.assertEqual(len(texts), 50)
        again = call("make", "pebbles", "--count", "1", "--seed", "7", "--elongation", "0.7", "--flatness", "0.5,0.6",
                     "-o", str(self.file))
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertIn((self.place / "shape_1.json").read_text(), texts)

    def test_pebbles_deck_is_the_host_s(self):
        made = call("make", "pebbles", "--count", "3", "-o", str(self.place / "my-p"))
        self.assertEqual(made.returncode, 0, made.stderr)
        style, fixes = (self.place / "my-p.deck").read_text().split("\n\n", 1)
        text = "\n".join(["units si", "newton off", "communicate single vel yes", style, "boundary p p f",
                          "region box block -4 4 -4 4 -2 10 units box", "create_box 1 box", "neighbor 0.3 bin",
                          "pair_style gran/nurbs", "pair_coeff * * kn 1e7 kt 5e6 mu 0.4", fixes,
                          "fix motion all nve/nurbs", "run 0", ""])
        deck.run_ok(text, files={f"my-p_{k}.json": self.place / f"my-p_{k}.json" for k in (1, 2, 3)})

    def test_info_names_mass_and_inertia(self):
        self.assertEqual(call("make", "sphere", "--radius", "2", "-o", str(self.file)).returncode, 0)
        info = call("info", str(self.file)).stdout
        self.assertAlmostEqual(float(re.search(r"volume +(\S+)", info)[1]), 33.510321638, 8)
        self.assertAlmostEqual(float(re.search(r"bounding radius +(\S+)", info)[1]), 2, 6)
        self.assertAlmostEqual(float(re.search(r"inertia / mass +xx (\S+)", info)[1]), 1.6, 9)

    def test_density_sets_the_mass_of_a_given_inertia(self):
        made = call("make", "inertia", "--density", "0.5", "--inertia", INERTIA, "-o", str(self.file))
        mass, density = (float(x) for x in re.search(r"mass (\S+) and .* density (\S+)", made.stdout).groups())
        self.assertAlmostEqual(density, 0.5, 9)
        info = call("info", str(self.file)).stdout
        xx, yy, zz = (float(x) for x in re.search(r"xx (\S+) yy (\S+) zz (\S+)", info).groups())
        for got, wanted in zip((xx, yy, zz), (1.0, 0.9, 0.8)):
            self.assertAlmostEqual(mass * got, wanted, 8)

    def test_bad_arguments_leave_the_old_file(self):
        self.file.write_text("old")
        for arguments, text in BAD:
            with self.subTest(arguments=arguments):
                self.assert_one_error(call("make", *arguments, "-o", str(self.file)), text)
                self.assertEqual([p.name for p in self.place.iterdir()], ["shape.json"])
                self.assertEqual(self.file.read_text(), "old")

    def test_no_or_impossible_output(self):
        self.assert_one_error(call("make", "pebble"), "no output file")
        self.assert_one_error(call("make", "pebble", "-o", str(self.place / "none" / "a.json")), "can't write")
        self.assert_one_error(call("make", "pebble", "-o", str(self.place)), "can't write")
        self.assertEqual(list(self.place.iterdir()), [])

    def test_pipes_and_devices_are_written_into(self):
        pipe = self.place / "pipe"
        os.mkfifo(pipe)
        reader = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
        self.addCleanup(os.close, reader)
        made = call("make", "box", "--axes", "1,1,1", "-o", str(pipe))
        self.assertEqual((made.returncode, made.stderr), (0, ""))
        self.assertTrue(pipe.is_fifo())
        self.assertEqual(len(json.loads(os.read(reader, 1 << 16))["shape"]["data"]), 6)

    def test_check_says_how_fast_radii_change(self):
        for kind, words in ((["sphere"], "change by at most 1e-12 a radian"),
                            (["rounded-polyhedron", "--solid", "octahedron", "--rounding", "0.1"], "a radian (0 occurs)"),
                            (["egg", "--radius", "1", "--blunt", "1", "--pointed", "2"], "proven: but for 6.2 % of the surface they change by"),
                            (["box", "--axes", "1,1,1"], "all faces are flat")):
            self.assertEqual(call("make", *kind, "-o", str(self.file)).returncode, 0)
            self.assertIn(words, call("check", str(self.file)).stdout)

    def test_dents_are_blamed_on_few_decimals(self):
        pill = pathlib.Path(__file__).resolve().parents[1] / "cases" / "shape-pill-of-7-decimals.json"
        for command in ("check", "info"):
            self.assertIn("the dents are what its 7 decimals leave", call(command, str(pill)).stdout)
        self.assertEqual(call("make", "capsule", "--radius", "1", "--length", "2", "-o", str(self.file)).returncode, 0)
        self.assertNotIn("decimals leave", call("check", str(self.file)).stdout)

    def test_unusable_files(self):
        self.assert_one_error(call("check", str(self.place / "none.json")), "none.json")
        self.file.write_text("{")
        self.assert_one_error(call("check", str(self.file)), "shape.json")
        self.assertEqual(call("make", "box", "--axes", "1,1,1", "-o", str(self.file)).returncode, 0)
        data = json.loads(self.file.read_text())
        data["shape"]["data"].pop()
        data["shape"]["count"] -= 1
        self.file.write_text(json.dumps(data))
        self.assert_one_error(call("check", str(self.file)), "edge")
        self.assert_one_error(call("info", str(self.file)), "edge")

    def test_usage(self):
        for arguments in ([], ["paint"], ["make"], ["check"], ["info", "a", "b"]):
            self.assert_one_error(call(*arguments), "")
        for arguments in (["--help"], ["make", "--help"], ["make", "box", "--help"], ["check", "--help"]):
            run = call(*arguments)
            self.assertEqual(run.returncode, 0)
            self.assertTrue(run.stdout.startswith("usage: nurbs-shape"))
        self.assertIn("make KIND [options] -o FILE\n       nurbs-shape make KIND [options] FILE\n",
                      call("make", "--help").stdout)

    def test_usage_names_what_is_needed(self):
        """What the usage line asks for is enough, and nothing of it may be left out."""
        values = {"--axes": "3,2.5,2", "--radius": "2", "--length": "1", "--height": "2", "--rim": "0.2", "--cap": "3", "--blunt": "2",
                  "--pointed": "3", "--rounding": "0.1", "--exponent": "3", "--equatorial": "2", "--polar": "1", "--count": "2",
                  "--inertia": "1,0.9,0.8,0,0,0"}
        one_of = {"inertia": ["--mass", "2"], "rounded-polyhedron": ["--solid", "cube"]}
        text = call("make", "--help").stdout
        kinds = re.findall(r"^  ([a-z-]+) {2,}", text[text.index("Subcommands:"):], re.MULTILINE)
        needs = {kind: re.findall(r"--[a-z]+", call("make", kind, "--help").stdout.splitlines()[0]) for kind in kinds}
        self.assertEqual(needs["tablet"], ["--radius", "--height", "--rim"])
        self.assertEqual(needs["sphere"], [])
        for kind, names in needs.items():
            for left in [None, *names]:
                words = [word for name in names if name != left for word in (name, values[name])]
                run = call("make", kind, *words, *one_of.get(kind, []), "-o", str(self.file))
                if left is None:
                    self.assertEqual((run.returncode, run.stderr), (0, ""), kind)
                else:
                    self.assert_one_error(run, f"{left} is missing")

    def test_pebbles_without_a_radius_say_that_it_is_1(self):
        for words, said in ((["--radius", "0.004"], "radius 0.004\n"), ([], "radius 1 (the default: 1 m")):
            run = call("make", "pebbles", "--count", "2", *words, "-o", str(self.file))
            self.assertIn(said, run.stdout)

    def test_pebbles_that_a_deck_cannot_name(self):
        for name in ("sp ace", "a$b", "c#d"):
            self.assert_one_error(call("make", "pebbles", "--count", "2", "-o", str(self.place / name)), name)
            self.assertEqual(list(self.place.glob(name + "*")), [])

    def test_examples_of_help_work_as_written(self):
        import meshes
        points, faces = meshes.grain(1, 3, rough=0.25)
        (self.place / "grain.stl").write_bytes(meshes.binary_stl(points, faces))
        helps = [["fit"], ["simplify"], ["info"], ["check"], ["export"], ["view"], ["import"], ["make", "pebbles"]]
        text = call("make", "--help").stdout
        kinds = re.findall(r"^  ([a-z-]+) {2,}", text[text.index("Subcommands:"):], re.MULTILINE)
        helps += [["make", kind] for kind in kinds if kind != "pebbles"]
        self.assertGreater(len(helps), 20)
        for arguments in helps:
            text = call(*arguments, "--help").stdout
            examples = re.findall(r"^Example: nurbs-shape (.*?)(?: {3,}.*)?$", text, re.MULTILINE)
            self.assertEqual(len(examples), 1, text)
            words = examples[0].split()
            self.assertEqual(words[:len(arguments)], arguments)
            if arguments == ["import"]:
                (self.place / "grain.step").rename(self.place / "part.step")
            run = call(*words, cwd=self.place)
            self.assertEqual((run.returncode, run.stderr), (0, ""), examples[0])
            if "-o" in words and arguments != ["make", "pebbles"]:
                self.assertTrue((self.place / words[words.index("-o") + 1]).exists(), examples[0])

    def test_info_says_what_a_contact_costs(self):
        costs = {}
        for kind, options in (("sphere", []), ("pebble", []), ("box", ["--axes", "1,1,1"])):
            self.assertEqual(call("make", kind, *options, "-o", str(self.file)).returncode, 0)
            info = call("info", str(self.file)).stdout
            self.assertRegex(info, r"cost of a contact +\S")
            self.assertNotIn("unresolved", info)
            costs[kind] = [float(x) for x in re.search(
                r"like, here +(\d+) ns a step at rest, (\d+) ns turning .*, (\d+) ns when", info).groups()]
        self.assertLess(costs["sphere"][1], costs["pebble"][1])
        for resting, turning, cold in (costs["sphere"], costs["pebble"]):
            self.assertTrue(5 < resting < 2e5 and 5 < turning < 2e5 and 5 < cold < 1e6)

    def test_output_file_without_its_option(self):
        self.assertEqual(call("make", "ellipsoid", "--axes", "1,2,3", str(self.file)).returncode, 0)
        self.assertEqual([p.name for p in self.place.iterdir()], ["shape.json"])


if __name__ == "__main__":
    unittest.main()
