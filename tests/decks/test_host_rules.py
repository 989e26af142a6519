#!/usr/bin/python3
"""What the host offers beside the NURBS styles: set and other commands that act on bodies, and what is refused or warned of."""
import pathlib
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck

AXES = np.array([0.3, 0.4, 0.5])  # half edges of the box
SHAPES = {"box.json": deck.box_shape(*AXES), "cube.json": deck.box_shape(0.5, 0.5, 0.5)}
ATOMS = [(1, 1, 1, 1.0, 1000.0, -1.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0), (2, 1, 2, 0.5, 2000.0, 1.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0),
         (3, 2, 1, 0.8, 2000.0, 1.0, 0.2, 4.0, 1.0, 0.3, 0.0, 0.0)]
COEFFICIENTS = "kn 1e6 kt 5e5 cn 1e3 mu 0.4"
DECK = """
units si
newton off
communicate single vel yes
atom_style nurbs box.json cube.json
atom_modify map array
boundary p p f
read_data in.data
neighbor 0.3 bin
neigh_modify delay 0
pair_style gran/nurbs
pair_coeff * * COEFFICIENTS
fix floor all wall/nurbs plane 0 0 0 0 0 1 COEFFICIENTS
fix gravity all gravity 9.81 vector 0 0 -1
fix motion all nve/nurbs
compute b all nurbs/atom qw qx qy qz shape scale
timestep 1e-4
""".replace("COEFFICIENTS", COEFFICIENTS)
DUMP = """
dump d all custom 1000000 dump.txt id x y z vx vy vz omegax omegay omegaz radius density mass c_b[1] c_b[2] c_b[3] c_b[4] &
  c_b[5] c_b[6]
dump_modify d first yes format "%d FORMAT"
run 0
""".replace("FORMAT", "%.17g " * 18)


def files(velocities=None):
    at_rest = [(atom[0], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) for atom in ATOMS]
    return {**SHAPES, "in.data": deck.data_file(ATOMS, velocities or at_rest, types=2, box=((-6, 6), (-6, 6), (0, 12)))}


def after(commands, ranks=1, text=DECK):
    """The particles after these commands."""
    return deck.run_ok(text + commands + DUMP, ranks=ranks, files=files()).dump("dump.txt")[-1][1]


def quaternions(frame):
    return np.stack([frame[f"c_b[{k}]"] for k in (1, 2, 3, 4)], axis=1)


class Hints(unittest.TestCase):
    """What a deck for spheres says, or says in the wrong order, is answered with what to write."""

    def test_errors_say_what_to_write(self):
        for line, words in (
                ("fix q all nve/sphere", "use fix nve/nurbs"),
                ("fix q all wall/gran model hooke tangential history primitive type 1 zplane 0.0\nthermo_style custom step f_q[1]",
                 "Fix wall/gran can't be used with atom_style nurbs; use fix wall/nurbs"),
                ("compute q all erotate/sphere", "use compute erotate/nurbs"),
                ("fix q all wall/nurbs primitive type 1 zplane 0.0", "write plane 0 0 C 0 0 1 type T"),
                ("fix q all wall/nurbs mesh n_meshes 1 meshes m type 1 model hertz", "write mesh ID"),
                ("fix q all wall/nurbs plane 0 0 0 0 0 1 type 1 model hertz shear x 0.1", "write move linear VX VY VZ"),
                ("fix q all wall/nurbs plane 0 0 0 0 0 1", "or type T model NORMAL"),
                ("compute q all wall/gran/local id force", "use compute nurbs/local, whose id2 is 0 at walls"),
                ("run 1\npair_style gran model hertz tangential history", "pair_style gran takes the particles for spheres"),
                ("pair_style gran/nurbs model hertz tolerance 1e-8", "tolerance must stand before model"),
                ("pair_style gran/nurbs tangential history model hertz", "model NORMAL must stand before tangential")):
            coefficients = "pair_coeff * *\n" if "pair_style gran model" in line else ""
            result = deck.run(DECK + line + f"\n{coefficients}run 0\n", files=files())
            self.assertEqual((result.status, len(result.errors)), (1, 1), result.screen[-500:])
            self.assertIn(words, result.errors[0])

    def test_two_motions_of_the_same_particles_are_warned_of(self):
        self.assertIn("time integrated more than once", deck.run_ok(DECK + "fix q all nve/nurbs\nrun 0\n", files=files()).screen)

    def test_particles_inserted_behind_a_plane_are_warned_of(self):
        text = DECK.replace("plane 0 0 0 0 0 1", "plane 0 0 0 0 0 -1").replace("read_data in.data", "read_data empty.data") + """
region r block -4 4 -4 4 1 8 units box
fix t all particletemplate/nurbs 86028121 atom_type 1 density constant 1000 shape box scale constant 1
fix d all particledistribution/discrete 86028157 1 t 1.0
fix i all insert/pack seed 67867967 distributiontemplate d insert_every once overlapcheck yes vel constant 0 0 0 region r particles_in_region 4
run 2
"""
        far = [(1, 1, 1, 1.0, 1000.0, 5.0, 5.0, -4.0, 1.0, 0.0, 0.0, 0.0)]
        result = deck.run_ok(text, files={**SHAPES, "empty.data": deck.data_file(far, [(1, 0, 0, 0, 0, 0, 0)], types=2, box=((-6, 6), (-6, 6), (-8, 12)))})
        self.assertIn("normal reversed?", result.screen)


class Set(unittest.TestCase):
    def check_sizes(self, frame):
        box = frame["c_b[5]"] == 1
        volume = np.where(box, 8 * AXES.prod(), 1.0) * frame["c_b[6]"] ** 3
        np.testing.assert_allclose(frame["mass"], frame["density"] * volume, rtol=1e-13)
        radius = np.where(box, np.linalg.norm(AXES), np.sqrt(0.75)) * frame["c_b[6]"]
        np.testing.assert_allclose(frame["radius"], radius, rtol=1e-6)

    def test_shape_scale_density_and_orientation(self):
        frame = after("set group all nurbs/shape cube nurbs/scale 0.7 density 500\nset atom 2*3 quat 0 0 2 90\n"
                      "set type 2 vx 3 density 700 vy 2 nurbs/shape box\n")
        np.testing.assert_array_equal(frame["c_b[5]"], [2, 2, 1])
        np.testing.assert_array_equal(frame["c_b[6]"], 0.7)
        np.testing.assert_array_equal(frame["density"], [500, 500, 700])
        half = np.sqrt(0.5)
        np.testing.assert_allclose(quaternions(frame), [[1, 0, 0, 0], [half, 0, 0, half], [half, 0, 0, half]], atol=1e-15)
        np.testing.assert_array_equal(frame["vx"], [0, 0, 3])
        np.testing.assert_array_equal(frame["vy"], [0, 0, 2])
        self.check_sizes(frame)

    def test_variables_and_random_orientations_on_any_ranks(self):
        commands = ("variable s atom 0.3+0.1*id\nvariable d equal 40\nset group all nurbs/scale v_s density v_d\n"
                    "region r block 0 2 -1 1 1 5 units box\nset region r quat/random 12345\nset atom 1 diameter 3\n")
        one, two = (after(commands, ranks) for ranks in (1, 2))
        for name in one:
            np.testing.assert_array_equal(one[name], two[name], name)
        np.testing.assert_allclose(one["c_b[6]"], [1.5 / np.linalg.norm(AXES), 0.5, 0.6], rtol=1e-6)
        self.check_sizes(one)
        q = quaternions(one)
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, rtol=1e-14)
        np.testing.assert_array_equal(q[0], [1, 0, 0, 0])
        self.assertGreater(np.abs(q[1] - q[2]).max(), 0.1)

    def test_random_orientations_are_isotropic(self):
        text = DECK.replace("read_data in.data", "lattice sc 0.5\nregion b block -6 6 -6 6 0 6 units box\ncreate_box 1 b\n"
                            "create_atoms 1 region b\nset group all nurbs/scale 0.1 density 1 quat/random 99991")
        w, x, y, z = quaternions(after("", text=text)).T
        third = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        n = len(w)
        self.assertGreater(n, 5000)
        self.assertLess(np.abs(third @ third.T / n - np.eye(3) / 3).max(), 4 * 0.3 / np.sqrt(n))
        self.assertLess(np.abs(third.mean(axis=1)).max(), 4 * 0.58 / np.sqrt(n))

    def test_fix_set(self):
        frame = after("group g type 2\nfix s g set/nurbs shape cube scale 0.3 density 10 quat 1 0 0 180\n")
        np.testing.assert_array_equal(frame["c_b[5]"], [1, 2, 2])
        np.testing.assert_array_equal(frame["c_b[6]"], [1, 0.5, 0.3])
        np.testing.assert_array_equal(frame["density"], [1000, 2000, 10])
        np.testing.assert_allclose(quaternions(frame)[2], [0, 1, 0, 0], atol=1e-15)
        self.check_sizes(frame)


class NoParticles(unittest.TestCase):
    """A box may be run before anything is in it, and when all is gone."""
    LINEAR = "pair_style gran/nurbs\npair_coeff * * kn 1e6 kt 5e5 mu 0.4\n"
    BOX = ("units si\nnewton off\ncommunicate single vel yes\natom_style nurbs box.json cube.json\nboundary p p f\n"
           "region b block -6 6 -6 6 0 12 units box\ncreate_box 2 b\nneighbor 0.3 bin\nneigh_modify delay 0\n{law}"
           "fix motion all nve/nurbs\ntimestep 1e-3\nfix gravity all gravity 10 vector 0 0 -1\nthermo_style custom step atoms ke\n"
           "thermo_modify lost ignore norm no\nrun 10\ncreate_atoms 2 single 0 0 6 units box\nset group all density 8\n"
           "run 100\ndelete_atoms group all\nrun 10\ncreate_atoms 2 single 0 0 6 units box\nset group all density 8\n"
           "run 2000\nrun 10\n")

    def test_before_and_after(self):
        for law in (self.LINEAR, HERTZ[0].replace("peratomtype 5e6", "peratomtype 5e6 5e6").replace(
                "peratomtype 0.3", "peratomtype 0.3 0.3").replace("peratomtypepair 1 0.5", "peratomtypepair 2 .5 .5 .5 .5").replace(
                "peratomtypepair 1 0.4", "peratomtypepair 2 .4 .4 .4 .4") + "\n"):
            for ranks in (1, 2):
                run = deck.run_ok(self.BOX.format(law=law), ranks=ranks, files=SHAPES)
                self.assertEqual([table["Atoms"][-1] for table in run.tables], [0, 1, 0, 0, 0])
                mass = 8 * 8 * AXES.prod()
                self.assertAlmostEqual(run.tables[1]["KinEng"][-1] / (0.5 * mass), 1, delta=1e-3)


class OtherCommands(unittest.TestCase):
    def test_displace_atoms_rotate_turns(self):
        for ranks in (1, 2):
            frame = after("group g id 1 2\ndisplace_atoms g rotate 0 0 0 0 0 3 90\n", ranks)
            half = np.sqrt(0.5)
            np.testing.assert_allclose(quaternions(frame)[:2], [[half, 0, 0, half]] * 2, atol=1e-15)
            np.testing.assert_allclose(quaternions(frame)[2, :2] / quaternions(frame)[2, 0], [1, 0.3], atol=1e-15)
            np.testing.assert_allclose([frame["x"][:2], frame["y"][:2]], [[0, 0], [-1, 1]], atol=1e-15)

    def test_fix_move_rotate_turns(self):
        """A quarter of a turn, in two runs and over a restart; the same for a body that starts anywhere."""
        text = DECK.replace("fix motion all", "group a id 1 3\ngroup rest subtract all a\n"
                            "fix spin a move rotate 0.5 0 0 0 0 -2 0.4\nfix motion rest")
        start = np.array([1.0, 0.3, 0, 0]) / np.hypot(1, 0.3)
        half = np.sqrt(0.5)
        turned = np.array([half * start[0], half * start[1], -half * start[1], -half * start[0]])
        for ranks in (1, 2):
            frame = after("run 400\nrun 600\n", ranks, text)
            np.testing.assert_allclose(quaternions(frame)[0], [half, 0, 0, -half], atol=1e-12)
            np.testing.assert_allclose(quaternions(frame)[2], turned, atol=1e-12)
            np.testing.assert_allclose([frame["x"][0], frame["y"][0]], [0.5, 1.5], atol=1e-12)
            np.testing.assert_allclose(frame["omegaz"][[0, 2]], -2 * np.pi / 0.4, rtol=1e-14)
        run = deck.run_ok(text + "run 400\nwrite_restart half.restart\n", files=files())
        again = text[:text.index("atom_style")] + "atom_modify map array\nboundary p p f\nread_restart half.restart\n"
        again += text[text.index("neighbor"):text.index("pair_style")] + text[text.index("fix floor"):].replace("group", "#")
        again += "run 600\n" + DUMP
        frame = deck.run_ok(again, files={"half.restart": run.path / "half.restart"}).dump("dump.txt")[-1][1]
        np.testing.assert_allclose(quaternions(frame)[2], turned, atol=1e-12)

    def test_create_atoms_with_a_template(self):
        model = ("fix t all particletemplate/nurbs 15485863 atom_type 1 density constant 2500 shape cube scale uniform 0.2 0.4\n"
                 "lattice sc 3\nregion u block -5 -2 -5 5 5 10 units box\ncreate_atoms 2 region u template t\n")
        one, two = (after(model, ranks) for ranks in (1, 2))
        for frame in (one, two):
            self.assertEqual(len(frame["x"]), 9)
            scale = frame["c_b[6]"][3:]
            self.assertTrue(((scale >= 0.2) & (scale <= 0.4)).all())
            self.assertEqual(len(set(scale)), 6)
            np.testing.assert_allclose(frame["mass"][3:], 2500 * scale**3, rtol=1e-13)
        order = [np.lexsort((frame["z"], frame["y"], frame["x"])) for frame in (one, two)]
        for name in ("c_b[1]", "c_b[4]", "c_b[6]", "mass"):
            np.testing.assert_array_equal(one[name][order[0]], two[name][order[1]])

    def test_thermo_erotate(self):
        velocities = [(1, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0), (2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (3, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0)]
        text = DECK + ("compute mine all erotate/nurbs\ncompute hosts all erotate\nthermo_style custom step erotate c_mine c_hosts\n"
                       "thermo_modify norm no\nrun 0\n")
        run = deck.run_ok(text, files=files(velocities))
        values = [run.thermo[name][-1] for name in run.thermo if name != "Step"]
        self.assertGreater(values[0], 0)
        self.assertEqual(values, [values[0]] * 3)


HEAP = """
units si
newton off
communicate single vel yes
atom_style nurbs box.json ball.json
atom_modify map array
boundary f f f
processors * 1 1
read_data in.data
neighbor 0.1 bin
neigh_modify delay 0
LAW
fix floor all wall/nurbs plane 0 0 0 0 0 1 COEFFICIENTS
fix gravity all gravity 9.81 vector 0.3 0 -1
fix motion all nve/nurbs
compute e all nurbs/energy
thermo_style custom step atoms ke c_e[1] c_e[2] c_e[3] c_e[4]
thermo_modify norm no format float %.15g
timestep 1e-4
run 6000
{between}
run 400
dump d all custom 1000000 dump.txt id x y z vx vy vz omegax omegay omegaz
dump_modify d first yes sort id format "%d FORMAT"
run 0
""".replace("FORMAT", "%.17g " * 9)
LINEAR = ("pair_style gran/nurbs\npair_coeff * * kn 1e6 kt 5e5 cn 1e3 ct 1e3 mu 0.4", "kn 1e6 kt 5e5 cn 1e3 ct 1e3 mu 0.4")
MATERIALS = """
fix m1 all property/global youngsModulus peratomtype 5e6
fix m2 all property/global poissonsRatio peratomtype 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.5
fix m4 all property/global coefficientFriction peratomtypepair 1 0.4
"""
HERTZ = (MATERIALS + "pair_style gran/nurbs model hertz tangential history\npair_coeff * *",
         "type 1 model hertz tangential history")


class BetweenRuns(unittest.TestCase):
    """Contacts are remembered by IDs, and by the pair style: neither deleting others, which renumbers, nor saying the pair
    style anew loses a friction spring."""
    TWO = "group a id 1\ngroup b id 2\ndelete_atoms group a\ndelete_atoms group b\n"

    @staticmethod
    def heap(between, law, ranks=1, others=()):
        random, atoms = np.random.default_rng(3), []
        for k, number in enumerate((7, 3, 9, 4, 5, 11, 12, 6, 8, 10)):
            q = random.normal(size=4)
            atoms.append((number, 1, 1 + k % 2, 1.0, 1000.0, -1.0 + k % 3, 0.1 * (k % 4), 0.55 + 0.75 * (k // 3),
                          *map(float, q / np.linalg.norm(q))))
        atoms += [(1, 1, 2, 0.5, 1000.0, 5.0, 5.0, 6.0, 1.0, 0.0, 0.0, 0.0), (2, 1, 2, 0.5, 1000.0, -5.0, 5.0, 6.0, 1.0, 0.0, 0.0, 0.0)]
        atoms += others
        text = HEAP.replace("LAW", law[0]).replace("COEFFICIENTS", law[1]).format(between=between)
        return deck.run_ok(text, ranks=ranks, files={
            "box.json": deck.box_shape(0.5, 0.4, 0.3), "ball.json": deck.shape_file("sphere", 0.4),
            "in.data": deck.data_file(atoms, box=((-7, 7), (-7, 7), (-1, 7)))})

    def check_same(self, one, other, gone=0):
        one, other = (run.dump("dump.txt")[-1][1] for run in (one, other))
        for name in one:
            if name != "id":
                np.testing.assert_array_equal(other[name], one[name][gone:], name)

    def test_deleting_others(self):
        for law in (LINEAR, HERTZ):
            one = self.heap("", law)
            self.assertGreater(one.tables[0]["e[2]"][-1], 0)  # some stick
            for between, gone in (("group a id 1\ndelete_atoms group a compress no", 1), (self.TWO, 2)):
                for ranks in (1, 2):
                    other = self.heap(between, law, ranks)
                    self.check_same(one, other, gone)
                    self.assertEqual(other.tables[1]["e[2]"][0], one.tables[1]["e[2]"][0])
                    first = 2 if "no" in between else 1
                    np.testing.assert_array_equal(other.dump("dump.txt")[-1][1]["id"], np.arange(first, first + 12 - gone))

    def test_a_number_used_again_has_no_past(self):
        """A new particle in the place of the one deleted, under its number or another."""
        place = "".join(f"variable {x}9 equal {x}[13]\nvariable {x}0 equal ${{{x}9}}\n" for x in "xyz")
        delete = "group a id 13\ndelete_atoms group a compress no\n"
        other, new = "create_atoms 1 single 6 6 6 units box\n", "create_atoms 1 single ${x0} ${y0} ${z0} units box\n"
        sticks = [(13, 1, 1, 1.0, 1000.0, -5.0, -5.0, 0.3, 1.0, 0.0, 0.0, 0.0)]  # flat on the floor, on a slope of 17 degrees
        same, another = (self.heap(place + text, LINEAR, others=sticks) for text in (delete + new + other, other + delete + new))
        self.assertEqual(same.dump("dump.txt")[-1][1]["id"][-2], 13)
        self.assertGreater(same.tables[0]["e[2]"][-1], 1.01 * same.tables[1]["e[2]"][0])
        self.assertEqual(same.tables[1]["e[2]"][0], another.tables[1]["e[2]"][0])

    def test_the_pair_style_again(self):
        for law in (LINEAR, HERTZ):
            again = law[0][law[0].index("pair_style"):]
            one = self.heap("", law)
            for ranks in (1, 2):
                self.check_same(one, self.heap(again, law, ranks))
            self.check_same(one, self.heap(again + "\nwrite_restart a.restart", law))
        one, other = self.heap("", LINEAR), self.heap(LINEAR[0].replace("nurbs\n", "nurbs tolerance 1e-7\n") + "\n" + self.TWO, LINEAR)
        self.assertAlmostEqual(other.tables[1]["e[2]"][0] / one.tables[1]["e[2]"][0], 1, delta=1e-4)

    def test_another_model_says_that_contacts_begin_anew(self):
        other = self.heap(MATERIALS + "pair_style gran/nurbs model hertz tangential no_history\npair_coeff * *", LINEAR)
        self.assertEqual(other.screen.count("all contacts begin anew, without their friction springs"), 1)
        self.assertNotIn("begin anew", self.heap(LINEAR[0], LINEAR).screen)


class Refused(unittest.TestCase):
    def refuse(self, text, *expected, ranks=1):
        run = deck.run(text, ranks=ranks, files=files())
        self.assertNotEqual(run.status, 0, run.screen)
        self.assertTrue(run.errors, run.screen)
        for words in expected:
            self.assertIn(words, run.errors[0])

    def test_settings(self):
        run = "run 1\n"
        for ranks, text, *expected in (
                (2, DECK.replace("0.3 bin", "0.3 multi"), "neighbor .. multi", "use bin"),
                (1, DECK + "run_style respa 2 2 pair 1\n", "run_style respa", "verlet"),
                (1, DECK + "change_box all triclinic\n", "triclinic", "orthogonal"),
                (2, DECK + "timestep 0\n", "timestep = 0 must be > 0"), (1, DECK + "timestep -2e-5\n", "timestep = -2e-05 must be > 0"),
                (1, DECK.replace("pair_style", "#").replace("pair_coeff", "#"), "no pair_style gran/nurbs"),
                (1, DECK.replace("pair_style gran/nurbs", "pair_style hybrid gran/nurbs gran model hooke").replace("* * kn", "* * gran/nurbs kn"), "hybrid"),
                (1, DECK.replace("gran/nurbs", "hybrid gran/nurbs").replace("* * kn", "* * gran/nurbs kn"), "hybrid"),
                (1, DECK.replace("pair_style gran/nurbs", "pair_style sph/artVisc/tensCorr").replace("pair_coeff", "#"), "pair")):
            self.refuse(text + run, *expected, ranks=ranks)
        self.refuse(DECK + "minimize 1e-4 1e-4 10 10\n", "minimize")

    def test_fixes(self):
        plane = "model hooke tangential history primitive type 1 zplane 0.0"
        for command, *expected in (
                ("fix motion all nve", "Fix nve motion", "fix nve/nurbs"), ("fix motion all nve/noforce", "fix nve/nurbs"),
                ("fix motion all nve/limit radius_ratio 0.1", "fix nve/nurbs"), ("fix motion all nve/sphere", "sphere"),
                ("fix motion all rigid single", "rigid", "fix nve/nurbs"),
                ("variable d equal 2\nfix a all adapt 1 atom diameter v_d", "Fix adapt a", "nurbs/scale"),
                ("fix s all massflow/mesh/sieve mesh m", "massflow/mesh/sieve", "fix massflow/mesh"),
                (f"fix w all wall/gran {plane}", "Fix wall/gran", "fix wall/nurbs"),
                ("region r block -6 6 -6 6 0 12\nfix w all wall/region r lj126 1 1 2", "Fix wall/region", "fix wall/nurbs")):
            text = DECK.replace("fix motion all nve/nurbs", "") if "fix motion" in command else DECK
            self.refuse(text + command + "\nrun 1\n", *expected)

    def test_commands(self):
        for command, *expected in (
                ("set group all nurbs/shape ball", "shape ball", "box cube"), ("set group all nurbs/scale 0", "nurbs/scale = 0", "> 0"),
                ("set group all nurbs/scale", "nurbs/scale needs 1 value"), ("set group all nurbs/size 1", "nurbs/size", "nurbs/scale"),
                ("set group all density -1", "density = -1", "> 0"),
                ("set group all vx 1 shape ball", "shape can't be set", "nurbs/shape nurbs/scale quat"),
                ("set group all scale 2", "scale can't be set", "nurbs/scale"), ("set group none density 1", "no group none"),
                ("set atom 1 quat 0 0 0 10", "axis 0 0 0"), ("set group all quat 1 0 0", "quat needs 4 values"),
                ("set group all nurbs/scale v_x", "no variable x"), ("set all all density 1", "all must be one of"),
                ("variable x atom id-2\nset group all nurbs/scale v_x", "v_x must be a number > 0"),
                ("fix s all set/nurbs", "needs one of shape scale"), ("fix s all set/nurbs size 1", "unknown keyword size"),
                ("create_atoms 1 single 4 4 4 template x", "template x is no fix particletemplate/nurbs"),
                ("create_atoms 1 single 4 4 4 template", "needs the ID"), ("replicate 2 1 1 offset 12 0 0", "Replicate"),
                ("read_dump x.txt 0 x y z", "Read_dump")):
            self.refuse(DECK + command + "\n", *expected)
        self.refuse(DECK + "set group all nurbs/shape ball\n", "shape ball", ranks=2)
        for command, *expected in (("set group all type 7", "type = 7", "in [1, "), ("set group all type 1.5", "type = 1.5"),
                                   ("set group all vx 0 mass -1", "mass = -1", "> 0")):
            run = deck.run(DECK + command + "\n", ranks=4, files=files())  # LIGGGHTS says it once a rank
            self.assertEqual(len(run.errors), 1, run.screen)
            self.refuse(DECK + command + "\n", *expected)


class Warned(unittest.TestCase):
    def warnings(self, text, more=None, ranks=1):
        run = deck.run_ok(text, files={**files(), **(more or {})}, ranks=ranks)
        return [line for line in run.screen.splitlines() if line.startswith("WARNING")]

    def test_default_density(self):
        text = DECK + "create_atoms 1 single 4 4 4\n"
        self.assertIn("1 particles made by create_atoms have density 1", "".join(self.warnings(text + "run 0\n")))
        for setting in ("set group all density 1\n", "set atom 4 density 2\n"):
            self.assertNotIn("density", "".join(self.warnings(text + setting + "run 0\n")))

    def test_particles_wider_than_the_box(self):
        """Millimetres taken for metres: said once, before the host's own end; a long body in a short box is none."""
        for ranks in (1, 2):
            for scale, count in ((9, 0), (13, 1)):
                run = deck.run(DECK.replace("p p f", "f f f") + f"set atom 2 nurbs/scale {scale}\nrun 0\nrun 0\n", ranks=ranks, files=files())
                self.assertEqual(run.screen.count("particles of inner diameter 13 in a box 12 wide"), count, run.screen[-800:])

    def test_move_without_turning(self):
        text = DECK.replace("nve/nurbs", "move linear 1 0 0")
        self.assertEqual(self.warnings(text + "run 1\n"), [])
        self.assertIn("doesn't turn", "".join(self.warnings(text + "set atom 1 omegax 3\nrun 1\n")))

    def test_mesh_that_is_no_wall(self):
        """Told once for all runs; not of a mesh that counts."""
        mesh = "solid m\nfacet normal 0 0 1\nouter loop\nvertex -5 -5 1\nvertex 5 -5 1\nvertex 0 5 1\nendloop\nendfacet\nendsolid m\n"
        text = DECK + "fix m all mesh/surface/planar file m.stl type 1\n"
        for ranks in (1, 2):
            told = [line for line in self.warnings(text + "run 1\nrun 1\n", {"m.stl": mesh}, ranks) if "is no wall" in line]
            self.assertEqual(len(told), 1)
        counted = text + "fix c all massflow/mesh mesh m count once vec_side 0 0 -1\nrun 1\n"
        self.assertNotIn("is no wall", "".join(self.warnings(counted, {"m.stl": mesh})))

    def test_no_fix_moves_the_particles(self):
        still = DECK.replace("fix motion all nve/nurbs\n", "")
        for text, told in ((still + "run 2\nrun 2\n", 1), (still + "run 0\n", 0), (DECK + "run 2\n", 0),
                           (still + "fix motion all freeze\nrun 2\n", 0),
                           (still + "group none id 99\nfix motion none nve/nurbs\nrun 2\n", 1),
                           (still + "group one id 1\nfix motion one freeze\nrun 2\n", 1),
                           (still + "group one id 1\nfix motion one nve/nurbs\nrun 2\n", 0),
                           (still + "fix motion all move linear 0 0 1\nrun 2\n", 0)):
            screen = deck.run_ok(text, files=files()).screen
            self.assertEqual(screen.count("No fix moves the particles"), told, text)

    def test_frozen_particles_that_turn(self):
        """The host's fix freeze leaves them their speed and spin; stopped, they stand, whatever falls on them."""
        moving = [(1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0), (2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)]
        for ranks in (1, 2):
            run = deck.run_ok(DECK + "fix ice all freeze\nrun 1\nrun 1\n", files=files(moving), ranks=ranks)
            self.assertEqual(run.screen.count("Fix freeze ice: 1 of its particles go on moving"), 1)
        stop = "velocity all set 0 0 0\nset group all omegax 0 omegay 0 omegaz 0\nfix ice all freeze\n"
        run = deck.run_ok(DECK + stop + "run 100\n" + DUMP, files=files(moving))
        self.assertNotIn("go on moving", run.screen)
        np.testing.assert_array_equal(run.dump("dump.txt")[-1][1]["z"], [atom[7] for atom in ATOMS])

    def test_sphere_volumes(self):
        self.assertIn("bounding spheres", "".join(self.warnings(DECK + "fix w all buoyancy level 3 dim z density 1000\nrun 1\n")))

    PLATE = ("solid m\nfacet normal 0 0 1\nouter loop\nvertex -5 -5 0\nvertex 5 -5 0\nvertex 0 5 0\nendloop\nendfacet\n"
             "endsolid m\n")

    def test_a_mesh_that_moved_before_a_restart(self):
        """Its motion and its place are known by ID; left out or named otherwise, it stands or starts anew, which is said."""
        mesh = "fix m all mesh/surface file m.stl type 1\n"
        move = "fix mv all move/mesh mesh m linear 0 0 1\n"
        text = DECK.replace("fix floor all wall/nurbs plane 0 0 0 0 0 1", mesh + move + "fix floor all wall/nurbs mesh m")
        run = deck.run_ok(text + "run 10\nwrite_restart a.restart\n", files={**files(), "m.stl": self.PLATE})
        more = {"a.restart": run.path / "a.restart", "m.stl": self.PLATE}
        again = text[:text.index("atom_style")] + "boundary p p f\nread_restart a.restart\n" + text[text.index("neighbor"):]
        again = again.replace("pair_style", "#").replace("pair_coeff", "#") + "run 1\nrun 1\n"
        for ranks in (1, 2):
            self.assertEqual([line for line in self.warnings(again, more, ranks) if "restart file holds" in line], [])
            for old, new, words in ((move, "", "the motion of fix move/mesh mv"), ("fix mv", "fix mw", "the motion of fix move/mesh mv"),
                                    ("mesh/surface file", "mesh/surface/stress file", "the place of fix mesh/surface m")):
                told = [line for line in self.warnings(again.replace(old, new), more, ranks) if "restart file holds" in line]
                self.assertEqual(len(told), 1, told)
                self.assertIn(words, told[0])
        plane = again.replace(mesh + move, "").replace("mesh m", "plane 0 0 0 0 0 1")  # no meshes, nothing missed but contacts
        self.assertFalse([line for line in self.warnings(plane, more) if "motion of" in line or "place of" in line])

    def test_a_wall_that_is_elsewhere_than_in_the_restart(self):
        for wall, elsewhere in (("plane 0 0 0 0 0 1", "plane 0 0 0.01 0 0 1"), ("cylinder x 9 0 6", "cylinder x 9 0.01 6")):
            moving = f"{COEFFICIENTS} move linear 0 1e-9 1e-2"
            floor = "fix floor all wall/nurbs plane 0 0 0 0 0 1 " + COEFFICIENTS
            text = DECK.replace(floor, f"fix floor all wall/nurbs {wall} {moving}")
            run = deck.run_ok(text + "run 100\nwrite_restart a.restart\n", files=files())
            more = {"a.restart": run.path / "a.restart"}
            again = text[:text.index("atom_style")] + "boundary p p f\nread_restart a.restart\n" + text[text.index("neighbor"):]
            again = again.replace("pair_style", "#").replace("pair_coeff", "#") + "run 1\nrun 1\n"
            for ranks in (1, 2):
                told = lambda text: [line for line in self.warnings(text, more, ranks) if "from where it was" in line]  # noqa: E731
                self.assertEqual(told(again), [])
                for other, way in ((again.replace(moving, COEFFICIENTS), 1e-4), (again.replace(wall, elsewhere), 1e-2),
                                   (again.replace("1e-9 1e-2", "1e-9 -1e-2"), 2e-4)):
                    self.assertEqual(len(told(other)), 1)
                    self.assertAlmostEqual(float(told(other)[0].split(" from where")[0].split()[-1]) / way, 1, delta=1e-3)

    def test_walls_without_the_pair_styles_tangential_model_rolling_friction_or_cohesion(self):
        """LIGGGHTS's own walls go without a word; here it is said once, unless the wall says off."""
        rolling = ("fix m5 all property/global coefficientRollingFriction peratomtypepair 2 .1 .1 .1 .1\n"
                   "fix m6 all property/global cohesionEnergyDensity peratomtypepair 2 10 10 10 10\n")
        materials = MATERIALS.replace("peratomtype 5e6", "peratomtype 5e6 5e6").replace("peratomtype 0.3", "peratomtype .3 .3").replace(
            "peratomtypepair 1 0.5", "peratomtypepair 2 .5 .5 .5 .5").replace("peratomtypepair 1 0.4", "peratomtypepair 2 .4 .4 .4 .4")
        text = DECK.replace(f"pair_style gran/nurbs\npair_coeff * * {COEFFICIENTS}", materials + rolling + "pair_style gran/nurbs PAIR\npair_coeff * *")
        text = text.replace(f"0 0 1 {COEFFICIENTS}", "0 0 1 type 1 WALL")
        model = "model hertz tangential history"
        for pair, wall, words in ((" cohesion sjkr rolling_friction cdt", "", "no cohesion sjkr and rolling_friction cdt"),
                                  (" cohesion sjkr rolling_friction cdt", " rolling_friction cdt", "no cohesion sjkr,"),
                                  ("", "without", "no tangential history,"), ("", "off", None),
                                  (" rolling_friction cdt", " rolling_friction off", None), (" rolling_friction off", "", None), ("", "", None)):
            for ranks in (1, 2):
                walls = {"without": "model hertz", "off": "model hertz tangential off"}.get(wall, model + wall)
                told = [line for line in self.warnings(text.replace("PAIR", model + pair).replace("WALL", walls) + "run 1\nrun 1\n", ranks=ranks)
                        if "Fix wall/nurbs floor has no" in line]
                self.assertEqual(len(told), 0 if words is None else 1, told)
                self.assertIn(words or "", "".join(told))

    def test_wall_given_again(self):
        """Under its ID, between runs, as when a deck changes its friction: its springs are gone, which is said."""
        wall = f"fix floor all wall/nurbs plane 0 0 0 0 0 1 {COEFFICIENTS}\n"
        for text, count in ((DECK + wall + "run 1\nrun 1\n", 0), (DECK + "run 1\n" + wall + "run 1\n", 1),
                            (DECK + "run 1\nunfix floor\n" + wall + "run 1\n", 0)):
            told = [line for line in self.warnings(text) if "Fix wall/nurbs floor: a wall of this ID was there" in line]
            self.assertEqual(len(told), count)

    def test_wall_of_another_name_after_a_restart(self):
        run = deck.run_ok(DECK + "set group all z 0.2\nset atom 2 x 4 z 0.2\nrun 1\nwrite_restart a.restart\n", files=files())
        restart = {"a.restart": run.path / "a.restart"}
        again = DECK[:DECK.index("atom_style")] + "boundary p p f\nread_restart a.restart\n" + DECK[DECK.index("neighbor"):]
        again = again.replace("pair_style", "#").replace("pair_coeff", "#") + "run 1\n"
        for ranks in (1, 2):
            told = "".join(self.warnings(again.replace("fix floor", "fix ground"), restart, ranks))
            self.assertIn("contacts of fix wall/nurbs floor", told)
            self.assertNotIn("restart file holds", "".join(self.warnings(again, restart, ranks)))


if __name__ == "__main__":
    unittest.main()
