#!/usr/bin/python3
"""fix particletemplate/nurbs under the host's insertion: what is inserted, where, how much, and what is refused."""
import pathlib
import re
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck

AXES = np.array([1.0, 0.7, 0.5])
VOLUME = 4 / 3 * np.pi * AXES.prod()  # of the ellipsoid; the sphere has radius 1

HEADER = """
units si
newton off
communicate single vel yes
atom_style nurbs ell.json ball.json
atom_modify map array
boundary {boundary}
region box block -5 5 -5 5 0 10 units box
create_box 1 box
neighbor 0.3 bin
neigh_modify delay 0
pair_style gran/nurbs
pair_coeff * * kn 1e7 kt 5e6 cn 2e5 mu 0.4
fix motion all nve/nurbs
timestep 1e-6
"""
OUTPUT = """
compute body all nurbs/atom qw qx qy qz shape scale volume mass
compute sums all reduce sum c_body[8] c_body[7]
compute st all nurbs/stats
thermo_style custom step atoms ke c_sums[1] c_sums[2] c_st[8] c_st[10]
thermo_modify norm no
dump d all custom 1 dump.txt id x y z vx vy vz density mass c_body[1] c_body[2] c_body[3] c_body[4] c_body[5] c_body[6]
dump_modify d format "%d %.17g %.17g %.17g %g %g %g %g %.17g %.17g %.17g %.17g %.17g %g %.17g"
"""
MIXTURE = """
fix t1 all particletemplate/nurbs 15485863 atom_type 1 density constant 2500 shape ell scale uniform 0.3 0.6
fix t2 all particletemplate/nurbs 15485867 atom_type 1 density constant 800 shape ball scale gaussian 0.3 0.03
fix mix all particledistribution/discrete 32452843 2 t1 0.3 t2 0.7
"""
REGION = "region ins block -4.9 4.9 -4.9 4.9 0.1 9.9 units box\n"


def header(boundary="f f f"):
    return HEADER.replace("{boundary}", boundary)


def insert_pack(target, distribution="mix", options="insert_every once maxattempt 100 overlapcheck yes all_in yes", name="i",
                seed=49979687, region="ins"):
    return f"fix {name} all insert/pack seed {seed} distributiontemplate {distribution} {options} {target} region {region}\n"


def template(words, name="t", seed=15485863):
    return f"fix {name} all particletemplate/nurbs {seed} {words}\n"


def one(name="one", of="t", seed=32452843):
    return f"fix {name} all particledistribution/discrete {seed} 1 {of} 1.0\n"


PLAIN = template("atom_type 1 density constant 1000 shape ell scale constant 0.5") + one()


class Decks(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.files = {"ell.json": deck.shape_file("ellipsoid", *AXES), "ball.json": deck.shape_file("sphere", 1)}

    def run_deck(self, text, **options):
        return deck.run_ok(text, files={**self.files, **options.pop("more", {})}, **options)


def matrices(frame):
    w, x, y, z = (frame[f"c_body[{k}]"] for k in (1, 2, 3, 4))
    return np.moveaxis(np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                                 [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                                 [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]), 2, 0)


def least_separation(frame, period=None):
    """Perram and Wertheim's contact function of the closest pair of a frame: above 1 no two ellipsoids meet."""
    x = np.stack([frame[k] for k in "xyz"], axis=1)
    turn = matrices(frame)
    axes = np.where((frame["c_body[5]"] == 1)[:, None], AXES, 1.0) * frame["c_body[6]"][:, None]
    spread = np.einsum("nij,nj,nkj->nik", turn, axes**2, turn)
    i, j = np.triu_indices(len(x), 1)
    apart = x[j] - x[i]
    if period is not None:
        apart -= period * np.round(apart / period)
    near = np.linalg.norm(apart, axis=1) < axes.max(axis=1)[i] + axes.max(axis=1)[j]
    i, j, apart = i[near], j[near], apart[near]
    if len(i) == 0:
        return np.inf, 0
    best = np.zeros(len(i))
    for share in np.linspace(0.02, 0.98, 97):  # a lower bound of the maximum over it
        inverse = np.linalg.inv((1 - share) * spread[i] + share * spread[j])
        best = np.maximum(best, share * (1 - share) * np.einsum("ni,nij,nj->n", apart, inverse, apart))
    return best.min(), len(i)


class WhatIsInserted(Decks):
    def test_mass_volume_mixture_sizes_and_orientations(self):
        for ranks in (1, 2):
            text = header() + MIXTURE + REGION + insert_pack("volumefraction_region 0.15") + OUTPUT + "run 1\n"
            run = self.run_deck(text, ranks=ranks)
            frame = run.dump("dump.txt")[-1][1]
            ball = frame["c_body[5]"] == 2
            scale = frame["c_body[6]"]
            volume = np.where(ball, 4 / 3 * np.pi, VOLUME) * scale**3
            density = np.where(ball, 800, 2500)
            np.testing.assert_allclose(frame["mass"], density * volume, rtol=1e-6)  # shapes are fitted to 1e-7
            np.testing.assert_array_equal(frame["density"], density)
            inserted = re.search(r"inserted (\d+) particle templates \(mass (\S+)\)", run.screen)
            self.assertEqual(int(inserted[1]), len(scale))
            self.assertAlmostEqual(float(inserted[2]) / frame["mass"].sum(), 1, 6)
            # Volume fraction of the particles themselves; mixture by mass.
            self.assertAlmostEqual(volume.sum() / (9.8**2 * 9.8) / 0.15, 1, 1)
            self.assertAlmostEqual(frame["mass"][ball].sum() / frame["mass"].sum(), 0.7, 1)
            drawn = scale[~ball]
            self.assertTrue(((drawn >= 0.3) & (drawn <= 0.6)).all())
            self.assertLess(abs(drawn.mean() - 0.45), 4 * 0.3 / np.sqrt(12 * len(drawn)))
            drawn = scale[ball]
            self.assertTrue(((drawn >= 0.21) & (drawn <= 0.39)).all())
            self.assertLess(abs(drawn.mean() - 0.3), 4 * 0.03 / np.sqrt(len(drawn)))
            self.assertLess(abs(drawn.std() / 0.0296 - 1), 4 / np.sqrt(2 * len(drawn)))  # cut at three sigma
            # Orientations: second moments of every axis a third.
            turn = matrices(frame)
            for axis in range(3):
                moments = np.einsum("ni,nj->ij", turn[:, :, axis], turn[:, :, axis]) / len(turn)
                self.assertLess(np.abs(moments - np.eye(3) / 3).max(), 4 * 0.3 / np.sqrt(len(turn)))
            self.assertLess(np.abs(turn.mean(axis=0)).max(), 4 * 0.6 / np.sqrt(len(turn)))
            separation, pairs = least_separation(frame)
            self.assertGreater(pairs, 100)
            self.assertGreater(separation, 0.999)
            self.assertEqual(run.thermo["st[8]"][-1], 0)

    def test_orientation_constant(self):
        model = template("atom_type 1 density constant 1 shape ell scale constant 0.4 orientation constant 1 1 0 0")
        text = header() + model + one() + REGION + insert_pack("particles_in_region 5", "one") + OUTPUT + "run 1\n"
        frame = self.run_deck(text).dump("dump.txt")[-1][1]
        q = np.stack([frame[f"c_body[{k}]"] for k in (1, 2, 3, 4)], axis=1)
        np.testing.assert_allclose(q, np.tile([np.sqrt(0.5), np.sqrt(0.5), 0, 0], (5, 1)), atol=1e-15)
        # The insertion's own `orientation constant` turns it further.
        options = "insert_every once overlapcheck no orientation constant 0 0 0 1"
        frame = self.run_deck(text.replace("insert_every once maxattempt 100 overlapcheck yes all_in yes", options))
        frame = frame.dump("dump.txt")[-1][1]
        np.testing.assert_allclose(frame["c_body[3]"], np.sqrt(0.5), atol=1e-15)
        np.testing.assert_allclose(frame["c_body[4]"], np.sqrt(0.5), atol=1e-15)

        # It stands for a random one, as which a template's goes that says nothing.
        model = template("atom_type 1 density constant 1 shape ell scale constant 0.4")
        for given, expected in (("constant 0 0.6 0 0.8", (0, 0.6, 0, 0.8)), ("constant 1 0 0 0", (1, 0, 0, 0))):
            for ranks in (1, 2):
                text = header() + model + one() + REGION + insert_pack("particles_in_region 5", "one") + OUTPUT + "run 1\n"
                text = text.replace("maxattempt 100", "maxattempt 100 orientation " + given)
                frame = self.run_deck(text, ranks=ranks).dump("dump.txt")[-1][1]
                q = np.stack([frame[f"c_body[{k}]"] for k in (1, 2, 3, 4)], axis=1)
                np.testing.assert_allclose(q, np.tile(expected, (5, 1)), atol=1e-15)

    def test_overlap_by_surfaces_fills_more_than_by_bounding_spheres(self):
        counts = {}
        for judge in ("exact", "sphere"):
            model = template(f"density constant 1 shape ell scale constant 0.8 overlap {judge}")
            text = header() + model + one() + REGION + insert_pack("volumefraction_region 0.4", "one") + OUTPUT + "run 1\n"
            frame = self.run_deck(text).dump("dump.txt")[-1][1]
            counts[judge] = len(frame["x"])
            self.assertGreater(least_separation(frame)[0], 1)
        self.assertGreater(counts["exact"], 2 * counts["sphere"])

    def test_ten_thousand(self):
        model = template("density constant 1 shape ell scale constant 0.25") + one()
        text = header("p p f") + model + REGION + insert_pack("particles_in_region 10000", "one").replace("all_in yes", "")
        text += "thermo_style custom step atoms cpu\nrun 1\nthermo_style custom step atoms\n"
        run = self.run_deck(text.replace("maxattempt 100", "maxattempt 200 verbose no"))
        self.assertEqual(run.thermo["Atoms"][-1], 10000)
        self.assertLess(run.thermo["CPU"][-1], 20)  # 1 s on an idle core

    def test_many_templates_take_no_memory_each_for_all(self):
        """The host asks each of 500 for room for 500 particles and more: 160 MB, were they all made."""
        primes = [n for n in range(10007, 16000, 2) if all(n % d for d in range(3, 127, 2))][:500]
        text = header() + "".join(template("density constant 1 shape ball scale constant 0.2", f"t{k}", seed)
                                  for k, seed in enumerate(primes))
        text += "fix all all particledistribution/discrete 32452843 500 " + " ".join(f"t{k} 0.002" for k in range(500))
        text += "\n" + REGION + insert_pack("particles_in_region 1000", "all")
        text += "shell sh memory.sh\nthermo_style custom step atoms\nrun 1\nshell sh memory.sh\n"
        script = ("p=$PPID\n"
                  "until grep -q liggghts /proc/$p/comm; do read -r _ _ _ p _ < /proc/$p/stat; done\n"
                  "grep VmHWM /proc/$p/status\n")
        run = self.run_deck(text, more={"memory.sh": script})
        before, after = (int(kb) for kb in re.findall(r"VmHWM:\s+(\d+) kB", run.screen))
        self.assertEqual(run.thermo["Atoms"][-1], 1000)
        self.assertLess(after - before, 40000)

    def test_create_attribute_of_other_fixes(self):
        """A property given to what is inserted arrives."""
        text = header() + "fix tag all property/atom tag scalar yes no no 0.\n" + PLAIN + REGION
        text += insert_pack("particles_in_region 5", "one", "set_property tag 7 insert_every once")
        text += "compute p all reduce sum f_tag\nthermo_style custom step atoms c_p\nrun 1\n"
        self.assertEqual(self.run_deck(text).thermo["p"][-1], 35)


class HowMuch(Decks):
    def test_repeated_volume_fraction_is_the_particles_own(self):
        """The host alone would count bounding spheres and stop at half of it."""
        model = template("density constant 1 shape ell scale uniform 0.2 0.3")
        text = header() + model + one() + REGION
        text += insert_pack("volumefraction_region 0.1", "one", "insert_every 2 maxattempt 2 all_in yes") + OUTPUT
        text += "run 40\n"
        for ranks in (1, 2):
            run = self.run_deck(text, ranks=ranks)
            volume = run.thermo["sums[2]"][-1] / 9.8**3
            self.assertAlmostEqual(volume / 0.1, 1, 2)
            self.assertGreater(run.screen.count("INFO: Particle insertion i: inserted"), 1)

    def test_mass_in_region(self):
        text = header() + PLAIN + REGION + insert_pack("mass_in_region 20000", "one") + OUTPUT + "run 1\n"
        mass = self.run_deck(text).thermo["sums[1]"][-1]
        self.assertLess(abs(mass - 20000), 1.01 * 1000 * VOLUME / 8)

    def test_goes_on_after_a_restart(self):
        rate = ("fix i all insert/rate/region seed 49979687 distributiontemplate mix nparticles 90 particlerate 3e6 "
                "insert_every 10 all_in yes region ins\n")
        text = header() + MIXTURE + REGION + rate + OUTPUT + "run 15\nwrite_restart half.restart\nrun 25\n"
        whole = self.run_deck(text)
        self.assertEqual(list(np.diff(whole.thermo["Atoms"])), [30])
        half = whole.path / "half.restart"
        again = ("units si\nnewton off\ncommunicate single vel yes\natom_modify map array\nread_restart half.restart\n"
                 "neighbor 0.3 bin\nneigh_modify delay 0\nfix motion all nve/nurbs\ntimestep 1e-6\n")
        for ranks in (1, 2):
            run = deck.run_ok(again + MIXTURE + REGION + rate + OUTPUT + "run 25\n", ranks=ranks, files={"half.restart": half})
            self.assertEqual(list(run.thermo["Atoms"]), [60, 90])
            frame = run.dump("dump.txt")[-1][1]
            self.assertEqual(len(set(frame["id"])), 90)
            self.assertGreater(least_separation(frame)[0], 0.999)


class Where(Decks):
    def test_among_what_is_there(self):
        """Two insertions of one step, sizes 1:8, periodic, on ranks that see no ghosts between the two."""
        text = header("p p p") + template("density constant 1 shape ell scale constant 2", "a") + one("big", "a", 86028121)
        text += template("density constant 1 shape ell scale constant 0.25", "b", 86028157) + one("small", "b", 67867967)
        text += "region all block -5 5 -5 5 0 10 units box\n"
        options = "insert_every once maxattempt 500 check_dist_from_subdomain_border no"
        text += insert_pack("particles_in_region 6", "big", options, "first", region="all")
        text += insert_pack("particles_in_region 1200", "small", "insert_every once maxattempt 500", "second", 15485867, "all")
        text += OUTPUT + "run 1\n"
        for ranks in (1, 2, 4):
            if ranks > 1:  # without ghosts between ranks the big ones could overlap each other
                text = text.replace(options, "insert_every once maxattempt 500").replace("scale constant 2", "scale constant 1.2")
            run = self.run_deck(text, ranks=ranks)
            frame = run.dump("dump.txt")[-1][1]
            self.assertGreater(len(frame["x"]), 300)
            big = frame["c_body[6]"] > 1
            self.assertGreater(big.sum(), 3)
            if ranks > 1:
                self.assertGreater(least_separation(frame, 10.0)[0], 0.999)
                self.assertEqual(run.thermo["st[8]"][-1], 0)

    def test_among_particles_of_a_data_file(self):
        atoms = [(1, 1, 1, 4.0, 1.0, 0.0, 0.0, 5.0, 0.9, 0.1, 0.2, 0.3)]
        text = header().replace("create_box 1 box", "read_data in.data") + PLAIN.replace("0.5", "0.4") + REGION
        text += insert_pack("particles_in_region 500", "one") + OUTPUT + "run 1\n"
        data = deck.data_file(atoms, box=((-5, 5), (-5, 5), (0, 10)))
        for ranks in (1, 4):
            frame = self.run_deck(text, ranks=ranks, more={"in.data": data}).dump("dump.txt")[-1][1]
            self.assertGreater(len(frame["x"]), 100)
            self.assertGreater(least_separation(frame)[0], 0.999)

    def test_deep_contacts_of_inserted_particles(self):
        """Those of particles that were there before are not counted."""
        atoms = [(k + 1, 1, 2, 1.0, 1.0, x, 0.0, z, 1.0, 0.0, 0.0, 0.0) for k, (x, z) in enumerate([(-3, 3), (-2, 3), (3, 0.5)])]
        text = header().replace("create_box 1 box", "read_data in.data")
        text += "fix w all wall/nurbs plane 0 0 0 0 0 1 kn 1e7 kt 5e6 mu 0.4\n" + PLAIN
        far, amid = "region ins block -4.9 4.9 -4.9 4.9 6 9.9 units box\n", "region ins block 2.9 3.1 -0.1 0.1 0.05 0.15 units box\n"
        data = deck.data_file(atoms, box=((-5, 5), (-5, 5), (0, 10)))
        for region, check, found in ((far, "yes", []), (amid, "no", [1, 1])):
            for ranks in (1, 2):
                with self.subTest(found=found, ranks=ranks):
                    options = f"insert_every once overlapcheck {check} all_in no"
                    run = self.run_deck(text + region + insert_pack("particles_in_region 1", "one", options) + "run 1\n",
                                        ranks=ranks, more={"in.data": data})
                    self.assertEqual(run.thermo["Atoms"][-1], 4)
                    deep = re.findall(r"WARNING: .* (.* contacts deeper) than 10 %.*radius: (\d+), deepest", run.screen)
                    self.assertEqual(deep, [("run contacts deeper", "1")] * 2 + [("have contacts deeper", str(n)) for n in found])

    @staticmethod
    def face():
        face = "solid f\n"
        for third in ("2 2", "-2 -2"):
            corners = ["-2 2 6", "2 -2 6"] if third == "2 2" else ["2 -2 6", "-2 2 6"]
            face += "facet normal 0 0 1\nouter loop\n" + "".join(f"vertex {c}\n" for c in [*corners, third + " 6"])
            face += "endloop\nendfacet\n"
        return face + "endsolid f\n"

    STREAM = (PLAIN + "fix face all mesh/surface/planar file face.stl type 1\nfix g all gravity 9.81 vector 0 0 -1\n"
              "fix i all insert/stream seed 49979687 distributiontemplate one nparticles 40 massrate 1e5 overlapcheck yes "
              "vel constant 0 0 -3 omega constant 1 2 3 insertion_face face extrude_length 2\n")

    def test_stream(self):
        """Through a face: no turning and no forces until a particle has passed it, then it falls freely."""
        face, text = self.face(), header() + self.STREAM
        text += OUTPUT.replace("custom 1 ", "custom 500 ") + "timestep 1e-3\nrun 1000\n"
        for ranks in (1, 2):
            run = self.run_deck(text, ranks=ranks, more={"face.stl": face})
            self.assertNotIn("is no wall", run.screen)
            frames = run.dump("dump.txt")[1:]
            first, last = (frame for _, frame in frames)
            self.assertEqual(len(first["x"]), 40)
            self.assertGreater(least_separation(first)[0], 0.999)
            waiting = last["z"] > 6.1
            np.testing.assert_allclose(last["vz"][waiting], -3)
            falling = (last["z"] < 5.9) & (last["z"] > 1)
            self.assertGreater(falling.sum(), 5)
            np.testing.assert_array_less(last["vz"][falling], -3.01)

    def test_stream_goes_on_after_a_restart(self):
        """Particles on their way to the face are let go there, not later; where the host would mistake the step, it says so."""
        face, step = self.face(), "timestep 1e-3\n"
        end = "dump d all custom 500 dump.txt id x y z vx vy vz\n" + step
        whole = self.run_deck(header() + step + self.STREAM + end + "run 250\nwrite_restart half.restart\nrun 250\n", more={"face.stl": face})
        more = {"half.restart": whole.path / "half.restart", "face.stl": face}
        again = ("newton off\natom_modify map array\nread_restart half.restart\ncommunicate single vel yes\nneighbor 0.3 bin\n"
                 "neigh_modify delay 0\nfix motion all nve/nurbs\n")
        for ranks in (1, 2):
            run = deck.run(again + self.STREAM + end + "run 250\n", ranks=ranks, files=more)
            self.assertNotEqual(run.status, 0)
            self.assertRegex(run.errors[0], "Fix insert/stream i: [0-9]+ particles .* 'timestep' before this fix")
            run = deck.run_ok(again + step + self.STREAM + end + "run 250\n", ranks=ranks, files=more)
            expected, found = (r.dump("dump.txt")[-1][1] for r in (whole, run))
            np.testing.assert_allclose(found["vz"], expected["vz"], atol=1.1 * 9.81e-3)  # a step's share
            self.assertGreater(np.ptp(expected["vz"]), 1)


class Refused(Decks):
    def refuse(self, text, *expected, ranks=1, **more):
        run = deck.run(text, ranks=ranks, files={**self.files, **more})
        self.assertNotEqual(run.status, 0, run.screen)
        self.assertTrue(run.errors, run.screen)
        for words in expected:
            self.assertIn(words, run.errors[0])

    def test_template(self):
        good = {"atom_type": "1", "density": "constant 1000", "shape": "ell", "scale": "constant 1"}
        for changes, *expected in (
                ({"shape": None}, "missing keyword shape"), ({"density": None}, "missing keyword density"),
                ({"scale": None}, "missing keyword scale"), ({"shape": "cube"}, "shape cube", "ell ball"),
                ({"radius": "constant 0.5"}, "unknown keyword radius", "scale"), ({"colour": "red"}, "unknown keyword colour"),
                ({"scale": "constant 0"}, "scale constant = 0", "> 0"), ({"scale": "constant -1"}, "scale constant = -1"),
                ({"scale": "constant"}, "scale constant needs 1 value"), ({"scale": "0.5"}, "scale 0.5 must be one of constant"),
                ({"scale": "uniform 2 1"}, "scale uniform 2 1", "LO"), ({"scale": "gaussian 1 0.4"}, "MU - 3 SIGMA"),
                ({"scale": "gaussian nan 1"}, "nan"), ({"density": "constant 0"}, "density = 0"),
                ({"density": "1000"}, "density 1000 must be one of constant"), ({"density": "uniform 1 2"}, "constant"),
                ({"density": "constant x"}, "density = x"), ({"atom_type": "2"}, "atom_type 2", "1 to 1"),
                ({"atom_type": "0"}, "atom type"), ({"orientation": "fixed"}, "orientation fixed", "random constant"),
                ({"orientation": "constant 1 0 0"}, "needs 4 values"), ({"orientation": "constant 0 0 0 0"}, "0 0 0 0"),
                ({"overlap": "loose"}, "overlap loose", "exact sphere")):
            words = " ".join(f"{key} {value}" for key, value in {**good, **changes}.items() if value is not None)
            self.refuse(header() + template(words), *expected)
        self.refuse(header() + template("shape ell shape ell"), "shape is there twice", ranks=2)
        self.refuse(header() + "fix t all particletemplate/nurbs\n", "needs a seed")

    def test_orientation_of_an_insertion(self):
        insert = insert_pack("particles_in_region 5", "one").replace("maxattempt 100", "orientation constant nan 0 0 0")
        self.refuse(header() + PLAIN + REGION + insert + "run 1\n", "Fix insert/pack", "orientation", "nan")

    def test_spheres(self):
        text = header() + ("fix t all particletemplate/sphere 15485863 atom_type 1 density constant 1 radius constant 0.5\n")
        text += one() + REGION + insert_pack("particles_in_region 5", "one") + "run 1\n"
        self.refuse(text, "Fix insert/pack i: its template t is of particletemplate/sphere", "particletemplate/nurbs", ranks=2)

    def test_region_too_small(self):
        text = header() + PLAIN + "region ins block 0 0.1 0 0.1 5 5.1 units box\n"
        self.refuse(text + insert_pack("particles_in_region 5", "one") + "run 1\n", "Fix insert/pack i: region ins is 0.1 long in x", "bounding diameter 1")

    def test_parts_of_a_region_too_small(self):
        """Processors insert each in its own part: told of where that has no room for a particle."""
        text = header() + PLAIN + "region ins block -0.6 0.6 -4.9 4.9 0.1 9.9 units box\n"
        text += insert_pack("particles_in_region 5", "one") + "run 1\n"
        for x, y in ((2, 1), (1, 2)):
            screen = self.run_deck(text.replace("boundary", f"processors {x} {y} 1\nboundary", 1), ranks=2).screen
            told = "WARNING: Fix insert/pack i: a processor's part of region ins is 0.6 long in x, too short" in screen
            self.assertEqual(told, x == 2)
            self.assertEqual("Less insertions than requested" in screen, x == 2)


if __name__ == "__main__":
    unittest.main()
