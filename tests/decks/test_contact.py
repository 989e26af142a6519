#!/usr/bin/python3
"""pair gran/nurbs and fix wall/nurbs in whole decks: ranks, restarts, energy ledger, output, bad input."""
import functools
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402

LAW = "kn 1e5 kt 5e4 cn 20 ct 5 mu 0.3"
DUMPED = "id x y z vx vy vz omegax omegay omegaz"

# Two ellipsoids and a sphere fall on each other and on the plane z = 0, near x = 0, where ranks meet.
ATOMS = [(1, 1, 1, 0.03, 2500.0, 0.0, 0.0, 0.05, 0.8, 0.3, -0.5, 0.2),
         (2, 1, 1, 0.03, 2500.0, 0.005, 0.01, 0.13, 1.0, 0.0, 0.0, 0.0),
         (3, 2, 2, 0.025, 2500.0, -0.01, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0)]
VELOCITIES = [(1, 0.1, 0.0, -0.3, 3.0, -2.0, 5.0), (2, 0.0, 0.0, -0.5, 0.0, 10.0, 0.0),
              (3, 0.0, 0.0, -0.6, 0.0, 0.0, 20.0)]
BOX = ((-0.2, 0.2), (-0.2, 0.2), (-0.05, 0.4))
FLOOR = """solid floor
facet normal 0 0 1
outer loop
vertex -0.19 -0.19 0.2
vertex 0.19 -0.19 0.2
vertex 0 0.19 0.2
endloop
endfacet
endsolid floor
"""


@functools.lru_cache(maxsize=None)
def files():
    return {"ell.json": deck.shape_file("ellipsoid", 1.2, 1, 0.8), "sphere.json": deck.shape_file("sphere", 1),
            "bodies.data": deck.data_file(ATOMS, VELOCITIES, BOX, types=2)}


START = """
units si
atom_style nurbs ell.json sphere.json
boundary f f f
newton off
communicate single vel yes
read_data bodies.data
pair_style gran/nurbs
pair_coeff * * {law}
"""
RESUME = """
units si
newton off
communicate single vel yes
read_restart {file}
"""
SCENE = """
neighbor 0.005 bin
neigh_modify delay 0
fix 1 all nve/nurbs
fix g all gravity 9.81 vector 0 0 -1
fix w all wall/nurbs plane 0 0 0 0 0 2.5 {law}
compute ke all ke
compute er all erotate/nurbs
compute pe all pe
compute led all nurbs/energy
compute st all nurbs/stats
compute at all nurbs/atom mass
variable mgz atom c_at*9.81*z
compute mgz all reduce sum v_mgz
variable spring equal c_led[1]+c_led[2]
variable mech equal c_ke+c_er+c_mgz
variable ledger equal c_ke+c_er+c_mgz+c_led[1]+c_led[2]+c_led[3]+c_led[4]
thermo_style custom step v_ledger c_pe f_w v_spring c_led[3] c_led[4] c_st[1] c_st[8] c_st[10] f_w[3] v_mech
thermo_modify format float %.15g norm no
thermo 500
timestep {dt}
dump d all custom 500 out.dump """ + DUMPED + """
dump_modify d format "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g" sort id
"""


def scene(law=LAW, dt=1e-5, start=START, extra="", run="run 12000", file=None):
    return start.format(law=law, file=file) + SCENE.format(law=law, dt=dt) + extra + "\n" + run + "\n"


def columns(run):
    """Thermo columns in the order of thermo_style: step ledger pe wall spring damping friction pairs contacts unresolved."""
    return list(run.thermo.values())


def last_state(run):
    return [list(column) for column in run.dump("out.dump")[-1][1].values()]


@functools.lru_cache(maxsize=None)
def reference():
    return deck.run_ok(scene(), files=files())


class NewRun(unittest.TestCase):
    def test_a_run_begins_with_what_was_changed(self):
        """Forces at the start of a run are those of the velocities, coefficients and places as they are then, and where
        nothing was changed those of the end of the last run."""
        deck_text = """
units si
newton off
atom_modify map array
communicate single vel yes
atom_style nurbs sphere.json
boundary f f f
region box block -5 5 -5 5 -5 5 units box
create_box 1 box
create_atoms 1 single 0 0 0 units box
create_atoms 1 single 1.98 0 0 units box
set group all density 1000
group b id 2
neighbor 0.3 bin
neigh_modify delay 0
pair_style gran/nurbs tolerance 1e-4
pair_coeff * * kn 1e5 kt 5e4 cn 1e3 mu 0.5
fix motion all nve/nurbs
timestep 1e-6
variable fx equal fx[2]
thermo_style custom step v_fx
thermo_modify format float %.12g
run 1
velocity b set -1 0 0 units box
run 0
velocity b set 1 0 0 units box
run 0
velocity all set 0 0 0 units box
pair_coeff * * kn 2e5 kt 5e4 cn 1e3 mu 0.5
run 0
displace_atoms b move -3e-4 0 0 units box
run 0
displace_atoms b move -3e-4 0 0 units box
run 1
run 0
"""
        result = deck.run_ok(deck_text, files=files())
        forces = [float(line.split()[1]) for line in result.screen.splitlines()
                  if len(line.split()) == 2 and line.split()[0] in ("0", "1", "2")]
        expected = [2000, None, 3000, 1000, 4000, 4060, 4120, None]
        self.assertEqual(len(forces), 9)
        for got, wanted in zip(forces, expected):
            if wanted:
                self.assertAlmostEqual(got, wanted, delta=0.1)
        self.assertEqual(forces[-1], forces[-2])
        # The same between a restart and its first run, whether it was written between runs or within one.
        written = deck_text[:deck_text.index("velocity b set -1")]
        for steps in ("run 1\nwrite_restart a.restart\n", "restart 1 a.restart\nrun 1\n"):
            first = deck.run_ok(written.replace("run 1\nrun 0\n", steps).replace("run 1\n", steps, 1), files=files())
            place = first.path / ("a.restart" if "write" in steps else "a.restart.1")
            again = ("newton off\natom_modify map array\nread_restart a\ncommunicate single vel yes\ngroup b id 2\nneighbor 0.3 bin\n"
                     "neigh_modify delay 0\n" + deck_text[deck_text.index("fix motion"):deck_text.index("run 1\n")])
            for change, expected in (("", 2000), ("velocity b set -1 0 0 units box\n", 3000), ("velocity b set 1 0 0 units box\n", 1000)):
                for ranks in (1, 2):
                    run = deck.run_ok(again + change + "run 0\n", ranks=ranks, files={"a": place})
                    self.assertAlmostEqual(run.thermo["fx"][0], expected, delta=0.1)


class Ledger(unittest.TestCase):

    def test_energy_and_dissipation_add_up(self):
        _, ledger, pe, wall, spring, damping, friction, *_ = columns(reference())
        dissipated = damping[-1] + friction[-1]
        self.assertGreater(dissipated, 0.1)
        self.assertLess(np.ptp(ledger), 1e-4 * dissipated)
        np.testing.assert_allclose(pe + wall, spring, rtol=1e-12, atol=1e-15)
        self.assertGreater(spring.max(), 0)
        self.assertTrue((np.diff(damping) >= 0).all())

    def test_residual_falls_with_the_square_of_the_step(self):
        residual = []
        for k in (1, 2, 4):
            # phases of onset within a step differ from run to run: the worst of three neighbouring steps
            worst = 0
            for stretch in (1, 1.017, 1.034):
                run = deck.run_ok(scene(dt=4e-5 / k * stretch, run=f"run {2000 * k}", extra="thermo 5"), files=files())
                worst = max(worst, np.ptp(columns(run)[1]))
            residual.append(worst)
        order = np.polyfit(np.log([1, 0.5, 0.25]), np.log(residual), 1)[0]
        print(f"ledger residual {residual}, order {order:.2f}")
        self.assertGreater(order, 1.6)

    def test_undamped_frictionless_dissipates_exactly_nothing(self):
        law = "kn 1e5 kt 5e4 mu 0"
        _, ledger, _, _, _, damping, friction, *_ = columns(deck.run_ok(scene(law), files=files()))
        self.assertEqual((np.abs(damping).max(), np.abs(friction).max()), (0, 0))
        self.assertLess(np.ptp(ledger), 2e-5 * ledger[0])

    def test_nothing_is_unresolved(self):
        *_, pairs, contacts, unresolved, wall_force, _ = columns(reference())
        self.assertEqual(unresolved.max(), 0)
        self.assertGreaterEqual(pairs.max(), contacts.max())
        self.assertGreater(contacts.max(), 0)
        self.assertLess(wall_force.min(), 0)  # particles push the wall down


class RanksAndRestarts(unittest.TestCase):

    def assert_same(self, run):
        self.assertEqual(last_state(run), last_state(reference()))
        for mine, theirs in zip(columns(run)[1:10], columns(reference())[1:10]):
            self.assertAlmostEqual(mine[-1], theirs[-1], delta=1e-13 * (1 + abs(theirs[-1])))

    def test_two_and_four_ranks_give_the_same_bits(self):
        for ranks in (2, 4):
            self.assert_same(deck.run_ok(scene(extra="", run="run 12000"), ranks=ranks, files=files()))

    def test_a_run_in_two_parts_gives_the_same_bits(self):
        self.assert_same(deck.run_ok(scene(run="run 4321\nrun 7679"), files=files()))

    def test_across_a_restart_the_same_bits(self):
        # step 4321 lies in a contact
        for first, second in ((1, 1), (2, 4)):
            half = deck.run_ok(scene(run="run 4321\nwrite_restart half.rst"), ranks=first, files=files())
            resumed = scene(start=RESUME, file="half.rst", run="run 7679")
            self.assert_same(deck.run_ok(resumed, ranks=second, files={"half.rst": half.path / "half.rst"}))

    def test_restart_written_within_a_run(self):
        half = deck.run_ok(scene(run="restart 4321 a.rst b.rst\nrun 4400"), ranks=2, files=files())
        resumed = scene(start=RESUME, file="a.rst", run="run 7679")
        self.assert_same(deck.run_ok(resumed, files={"a.rst": half.path / "a.rst"}))


LOCAL = """
compute loc all nurbs/local id1 id2 gap nx ny nz px py pz fnx fny fnz ftx fty ftz
dump l all local 100 local.dump c_loc[1] c_loc[2] c_loc[3] c_loc[4] c_loc[5] c_loc[6] c_loc[7] c_loc[8] c_loc[9] &
  c_loc[10] c_loc[11] c_loc[12] c_loc[13] c_loc[14] c_loc[15]
dump f all custom 100 force.dump id x y z fx fy fz tqx tqy tqz
dump_modify f format "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g" sort id
"""


def local_frames(text):
    frames, lines = {}, iter(text.splitlines())
    for line in lines:
        if line.startswith("ITEM: TIMESTEP"):
            step = int(next(lines))
            frames[step] = []
        elif line.startswith("ITEM: ENTRIES"):
            rows = frames[step]
            for row in lines:
                if row.startswith("ITEM: TIMESTEP"):
                    step = int(next(lines))
                    frames[step] = []
                    break
                rows.append([float(word) for word in row.split()])
        elif line and not line.startswith("ITEM") and len(line.split()) == 15:
            frames[step].append([float(word) for word in line.split()])
    return frames


class Output(unittest.TestCase):

    def test_local_rows_explain_the_forces_and_count_each_contact_once(self):
        seen = set()
        for ranks in (1, 4):
            run = deck.run_ok(scene(extra=LOCAL, run="run 8000"), ranks=ranks, files=files())
            rows = local_frames(run.read("local.dump"))
            for step, frame in run.dump("force.dump"):
                total = np.zeros((4, 3))
                pairs = [(row[0], row[1]) for row in rows[step]]
                self.assertEqual(len(pairs), len(set(pairs)))
                for row in rows[step]:
                    one, two, gap = int(row[0]), int(row[1]), row[2]
                    n, p, fn, ft = (np.array(row[k:k + 3]) for k in (3, 6, 9, 12))
                    seen.add((one, two))
                    self.assertLess(gap, 0)
                    self.assertAlmostEqual(np.linalg.norm(n), 1, places=4)
                    self.assertGreaterEqual(fn @ n, 0)
                    self.assertLess(abs(ft @ n), 1e-3 * (1 + np.linalg.norm(ft)))
                    self.assertLessEqual(np.linalg.norm(ft), 0.3 * np.linalg.norm(fn) * (1 + 1e-4) + 1e-6)
                    total[one] += fn + ft
                    if two:
                        self.assertLess(one, two)
                        total[two] -= fn + ft
                    else:
                        self.assertAlmostEqual(n[2], 1)
                weight = np.array([frame["fx"], frame["fy"], frame["fz"]]).T - total[1:]
                np.testing.assert_allclose(weight[:, :2], 0, atol=1e-3 * (1 + np.abs(total).max()))
                self.assertTrue((weight[:, 2] < 0).all())  # what is left is gravity
        self.assertTrue({(1, 2), (2, 3), (1, 0)} <= seen, seen)

    def test_host_features_that_look_for_gran(self):
        extra = """
compute pgl all pair/gran/local pos id force torque contactPoint
dump p all local 100 pgl.dump c_pgl[7] c_pgl[8] c_pgl[10] c_pgl[11] c_pgl[12] c_pgl[16] c_pgl[17] c_pgl[18]
"""
        run = deck.run_ok(scene(extra=LOCAL + extra, run="run 8000"), ranks=2, files=files())
        lines = [line.split() for line in run.read("pgl.dump").splitlines() if len(line.split()) == 8]
        rows = [[float(word) for word in line] for line in lines if line[0].replace(".", "").isdigit()]
        self.assertTrue(rows)
        ours = [row for frame in local_frames(run.read("local.dump")).values() for row in frame if row[1]]
        self.assertEqual(len(rows), len(ours))
        points = np.sort(np.array([row[5:8] for row in rows]), axis=0)
        np.testing.assert_allclose(points, np.sort(np.array([row[6:9] for row in ours]), axis=0), atol=1e-6)

    def test_features_for_spheres_are_refused(self):
        for extra, message in (("compute c all contact/atom/gran skin 0.1", "skin can't be used"),
                               ("fix 2 all check/timestep/gran 10 0.1 0.1", "gran")):
            run = deck.run(scene(extra=extra, run="run 1"), files=files())
            self.assertNotEqual(run.status, 0, extra)
            self.assertIn(message, "\n".join(run.errors), extra)

    def test_particles_wider_than_a_period_are_refused(self):
        for boundary, refused in (("f f f", False), ("f p f", True)):
            text = scene(run="run 0").replace("boundary f f f", "boundary " + boundary)
            text = text.replace("run 0", "set group all nurbs/scale 100\nrun 0")
            run = deck.run(text, ranks=2, files=files())
            lines = [line for line in run.screen.splitlines() if "There are particles of inner diameter" in line]
            self.assertEqual(len(lines), 1, run.screen)
            self.assertIn("in a periodic box" if refused else "in a box", lines[0])
            self.assertIn("ERROR" if refused else "WARNING", lines[0])
            self.assertTrue(run.status != 0 or not refused)

    def test_time_step_too_long_is_warned_of_once_with_the_step_to_use(self):
        law = "kn 1e5 kt 5e4 cn 2000 mu 0.3"
        run = deck.run_ok(scene(law, dt=5e-4, run="run 0\nrun 0"), files=files())
        lines = [line for line in run.screen.splitlines() if "does not resolve contacts" in line]
        self.assertEqual(len(lines), 1)
        self.assertIn("types 2 and 2; use ", lines[0])
        mass = 2500 * 4 / 3 * np.pi * 0.025**3 / 2
        self.assertAlmostEqual(float(lines[0].split("use ")[1].split()[0]), mass / 2000, delta=1e-6 * mass / 2000)


    def warnings(self, run, words):
        return [line for line in run.screen.splitlines() if "WARNING" in line and words in line]

    def test_wall_across_a_periodic_edge_is_warned_of_once(self):
        wall = "plane 0 0 0 0 0 2.5"
        for normal, boundary, expected in (("0 0 1", "p p p", ["periodic z;"]), ("1 0 1", "p p f", ["periodic x;"]),
                                           ("1 1 0", "p p f", ["periodic x y;"]), ("0 0 1", "p p f", [])):
            text = scene(run="run 0\nrun 0").replace("boundary f f f", "boundary " + boundary)
            run = deck.run_ok(text.replace(wall, "plane 0 0 -9 " + normal), files=files())
            lines = self.warnings(run, "the plane's normal lies along")
            self.assertEqual(len(lines), len(expected), run.screen)
            for line, words in zip(lines, expected):
                self.assertIn(words, line)
                self.assertIn("use boundary f", line)

    def test_two_contacts_across_a_short_box(self):
        """A row of two balls that touch on both sides turns and slides as one of four in a box twice as long."""
        width = 0.0996
        balls = [(0.0, 3.0), (0.5, -2.0)]  # place, spin

        def row(copies):
            atoms, moving = [], []
            for k in range(2 * copies):
                place, spin = balls[k % 2]
                y = (k // 2 + place + 0.25 - 0.5 * copies) * width
                atoms.append((k + 1, 2, 2, 0.025, 2500.0, 0.0, y, 0.1, 1.0, 0.0, 0.0, 0.0))
                moving.append((k + 1, 0.1 * spin, 0.0, 0.0, spin, 0.0, 5 * spin))
            box = ((-0.2, 0.2), (-width * copies / 2, width * copies / 2), (-0.2, 0.4))
            text = scene(run="run 3000").replace("boundary f f f", "boundary f p f").replace("neighbor 0.005", "neighbor 0.002")
            run = deck.run_ok(text, files={**files(), "bodies.data": deck.data_file(atoms, moving, box, types=2)})
            return run.dump("out.dump")[-1][1]

        short, long = row(1), row(2)
        for name in ("x", "z", "vx", "vy", "vz", "omegax", "omegay", "omegaz"):
            for k in range(2):
                np.testing.assert_allclose(long[name][k::2], short[name][k], rtol=0, atol=1e-9, err_msg=name)
        self.assertGreater(abs(short["vx"][0] - 0.3), 0.01)  # they dragged each other


    def test_deep_contacts_at_the_start_are_counted(self):
        def ball(number, x, z, y=0.0, radius=0.025):
            return (number, 2, 2, radius, 2500.0, x, y, z, 1.0, 0.0, 0.0, 0.0)

        # 1-2 across the ranks, 30 % of the smaller radius; 3-4, 5 %; 5 reaches 40 % through the wall, 6 is behind it
        balls = [ball(1, -0.0175, 0.1), ball(2, 0.0215, 0.1, radius=0.02), ball(3, -0.1, 0.1),
                 ball(4, -0.1, 0.14875), ball(5, 0.1, 0.015), ball(6, 0.1, -0.03, 0.1), ball(7, 0.1, 0.2)]
        for ranks in (1, 2):
            run = deck.run_ok(scene(run="run 0\nrun 0"), ranks=ranks,
                              files={**files(), "bodies.data": deck.data_file(balls, box=BOX, types=2)})
            pair, = self.warnings(run, "Pair gran/nurbs: at the start of the run contacts deeper than 10 %")
            self.assertIn(": 1, deepest 30 %; do particles overlap?", pair)
            wall, = self.warnings(run, "Fix wall/nurbs w: at the start of the run contacts deeper than 10 %")
            self.assertIn(": 2, deepest 220 %;", wall)
            self.assertIn("normal reversed?", wall)

    def test_deep_contacts_in_a_run_are_counted(self):
        """Balls thrown at each other and at the wall, and a box on its face, which has a polygon there."""
        atoms = [(1, 2, 2, 0.025, 2500.0, -0.03, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0), (2, 2, 2, 0.025, 2500.0, 0.03, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0),
                 (3, 2, 2, 0.025, 2500.0, 0.0, 0.1, 0.05, 1.0, 0.0, 0.0, 0.0), (4, 1, 1, 0.025, 2500.0, 0.0, -0.1, 0.05, 1.0, 0.0, 0.0, 0.0)]
        speeds = [(1, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0), (2, -6.0, 0.0, 0.0, 0.0, 0.0, 0.0), (3, 0.0, 0.0, -8.0, 0.0, 0.0, 0.0),
                  (4, 0.0, 0.0, -12.0, 0.0, 0.0, 0.0)]
        given = {**files(), "ell.json": deck.box_shape(1, 1, 1), "bodies.data": deck.data_file(atoms, speeds, BOX, types=2)}
        text = scene(run="run 1500\nrun 0", extra="thermo_style custom step c_st[8] c_st[11]\nthermo 10")
        found = []
        for ranks in (1, 2):
            run = deck.run_ok(text, ranks=ranks, files=given)
            self.assertFalse(self.warnings(run, "at the start"))
            pair, = self.warnings(run, "Pair gran/nurbs: in the run contacts were as deep as")
            wall, = self.warnings(run, "Fix wall/nurbs w: in the run contacts were as deep as")
            self.assertEqual(run.tables[0]["st[11]"][0], 0)
            self.assertGreaterEqual(run.tables[0]["st[11]"].max(), 2)
            self.assertGreater(float(wall.split("as deep as ")[1].split()[0]), 40)  # the box
            self.assertGreater(float(pair.split("as deep as ")[1].split()[0]), 30)
            found.append((pair, wall, list(run.tables[0]["st[11]"])))
        self.assertEqual(*found)

    def test_thin_bodies_that_go_through_each_other_are_told_of(self):
        """Rods 20 : 1, crossed, that come back from each other or go through, by far less than their bounding radius."""
        rod = deck.shape_file("capsule", 0.05, length=1.9)
        turn = 0.5**0.5
        for speed, told in ((0.5, False), (40, True)):
            atoms = [(1, 1, 1, 0.05, 2500.0, 0.0, 0.0, 0.2, turn, turn, 0.0, 0.0),
                     (2, 1, 1, 0.05, 2500.0, 0.0, 0.0, 0.21, turn, 0.0, turn, 0.0)]
            speeds = [(1, 0.0, 0.0, speed, 0.0, 0.0, 0.0), (2, 0.0, 0.0, -speed, 0.0, 0.0, 0.0)]
            run = deck.run_ok(scene(extra="dump_modify d every 50", run=f"run {round(3000 / speed)}"), files={**files(), "ell.json": rod,
                                                            "bodies.data": deck.data_file(atoms, speeds, BOX, types=2)})
            frame = run.dump("out.dump")[-1][1]
            self.assertEqual(bool(frame["z"][0] > frame["z"][1]), told)
            warned = self.warnings(run, "Pair gran/nurbs: in the run bodies overlapped by as much as")
            self.assertEqual(len(warned), int(told))

    def test_thin_bodies_that_go_through_a_mesh_are_told_of(self):
        """A plate on its face: back from a floor of triangles, or through it."""
        plate = deck.box_shape(1, 1, 0.03)
        for speed, told in ((0.2, False), (20, True)):
            atoms, speeds = [(1, 1, 1, 0.05, 2500.0, 0.0, 0.0, 0.205, 1.0, 0.0, 0.0, 0.0)], [(1, 0.0, 0.0, -speed, 0.0, 0.0, 0.0)]
            start = START.replace("pair_style", "fix m all mesh/surface file floor.stl type 1\npair_style")
            text = scene(start=start, extra="dump_modify d every 50", run=f"run {round(1000 / speed)}")
            text = text.replace("plane 0 0 0 0 0 2.5", "mesh m")
            run = deck.run_ok(text, files={**files(), "ell.json": plate, "floor.stl": FLOOR,
                                           "bodies.data": deck.data_file(atoms, speeds, BOX, types=2)})
            self.assertEqual(bool(run.dump("out.dump")[-1][1]["z"][0] < 0.2), told)
            self.assertEqual(len(self.warnings(run, "Fix wall/nurbs w: in the run bodies overlapped by as much as")), int(told))

    def test_shallow_contacts_are_not_warned_of(self):
        self.assertFalse(self.warnings(deck.run_ok(scene(run="run 4321\nrun 1"), files=files()), "in the run"))


class BadInput(unittest.TestCase):

    def fails(self, text, *words):
        run = deck.run(text, ranks=1, files=files())
        self.assertEqual(len(run.errors), 1, run.screen[-800:])
        self.assertEqual(run.status, 1)
        for word in words:
            self.assertIn(word, run.errors[0])

    def with_coeff(self, coeff):
        text = scene(run="run 1")
        return text.replace(f"pair_coeff * * {LAW}", coeff)

    def test_pair_coefficients(self):
        for coeff, words in (("pair_coeff * * kn 0 kt 1 mu 0", ("kn = 0", "> 0")),
                             ("pair_coeff * * kn -1 kt 1 mu 0", ("kn = -1", "> 0")),
                             ("pair_coeff * * kn nan kt 1 mu 0", ("kn = nan", "> 0")),
                             ("pair_coeff * * kn 1 kt -2 mu 0", ("kt = -2", ">= 0")),
                             ("pair_coeff * * kn 1 kt 1 mu -0.1", ("mu = -0.1", ">= 0")),
                             ("pair_coeff * * kn 1 kt 1 cn -3 mu 0", ("cn = -3", ">= 0")),
                             ("pair_coeff * * kn 1 kt 1 ct x mu 0", ("ct = x", ">= 0")),
                             ("pair_coeff * * kn 1 kt 1", ("missing", "mu")),
                             ("pair_coeff * * kn 1 kn 1 kt 1 mu 0", ("kn", "twice")),
                             ("pair_coeff * * kn 1 kt 1 mu", ("mu", "value")),
                             ("pair_coeff * * kn 1 kt 1 mu 0 q 1", ("unknown keyword q", "allowed"))):
            with self.subTest(coeff):
                self.fails(self.with_coeff(coeff), *words)

    def test_missing_pair_coeff_names_the_types(self):
        self.fails(self.with_coeff(f"pair_coeff 1 1 {LAW}\npair_coeff 2 2 {LAW}"), "missing pair_coeff", "types 1 2")
        self.fails(self.with_coeff(f"pair_coeff 1 * {LAW}"), "missing pair_coeff", "types 2 2")
        self.fails(self.with_coeff(""), "pair coeffs are not set")

    def test_pair_style(self):
        for style, words in (("gran/nurbs tolerance 0", ("tolerance = 0", "[1e-15, 0.1]")),
                             ("gran/nurbs tolerance 1e-4 tolerance 1e-5", ("tolerance is there twice",)),
                             ("gran/nurbs tolerance", ("tolerance", "value")),
                             ("gran/nurbs solver gjk", ("gjk", "default or cso")),
                             ("gran/nurbs speed 1", ("unknown keyword speed", "allowed"))):
            with self.subTest(style):
                self.fails(scene(run="run 1").replace("pair_style gran/nurbs", "pair_style " + style), *words)

    def test_host_settings(self):
        self.fails(scene(run="run 1").replace("newton off", "newton on"), "newton off")
        self.fails(scene(run="run 1").replace("communicate single vel yes", ""), "communicate single vel yes")

    def test_wall(self):
        wall = f"fix w all wall/nurbs plane 0 0 0 0 0 2.5 {LAW}"
        for other, words in (("plane 0 0 0 0 0 0 " + LAW, ("normal", "0 0 0")),
                             ("plane 0 0 0 0 0 inf " + LAW, ("normal = inf",)),
                             ("plane 0 0 0 0 0", ("NX NY NZ",)),
                             ("sphere 1", ("sphere", "plane")),
                             ("plane 0 0 0 0 0 1 kn 0 kt 1 mu 0", ("kn = 0", "> 0")),
                             ("plane 0 0 0 0 0 1 kn 1 kt 1 mu -1", ("mu = -1", ">= 0")),
                             ("plane 0 0 0 0 0 1 kn 1 kt 1", ("missing", "mu"))):
            with self.subTest(other):
                self.fails(scene(run="run 1").replace(wall, "fix w all wall/nurbs " + other), *words)

    def test_computes(self):
        for command, words in (("compute q all nurbs/local", ("id1 id2 gap",)),
                               ("compute q all nurbs/local gap depth", ("depth", "id1 id2 gap")),
                               ("compute q all nurbs/energy x", ("x",)), ("compute q all nurbs/stats x", ("x",))):
            with self.subTest(command):
                self.fails(scene(extra=command, run="run 1"), *words)

    def test_sphere_walls_are_refused(self):
        self.fails(scene(extra="fix h all heat/gran initial_temperature 300", run="run 1"), "heat/gran")


if __name__ == "__main__":
    unittest.main()
