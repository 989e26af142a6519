#!/usr/bin/python3
"""What a pair remembers belongs to its bodies as they are: a changed size between runs is seen, apart or touching, by
pairs and walls, and one solver does not believe another's memory."""
import sys
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402
import meshes  # noqa: E402
import models  # noqa: E402

LAW = "kn 1e6 kt 5e5 mu 0.3"
HEAD = """
units si
newton off
communicate single vel yes
boundary f f f
atom_style nurbs ball.json
read_data balls.data
"""
DECK = HEAD + """neighbor 0.4 bin
neigh_modify delay 0
pair_style gran/nurbs
pair_coeff * * {law}
fix floor all wall/nurbs plane 0 0 0 0 0 1 {law}
fix motion all nve/nurbs
compute gaps all nurbs/local id1 id2 gap
dump rows all local 1 rows.txt c_gaps[1] c_gaps[2] c_gaps[3]
timestep 1e-6
run 3
{change}
run 1
"""

HELD = HEAD + """neighbor 0.05 bin
neigh_modify delay 0
{materials}
pair_style gran/nurbs {law}
pair_coeff * *
{wall}
fix hold all move linear 0 0 0 units box
variable f atom abs(fz)
compute f all reduce max v_f
thermo_style custom step c_f
timestep 1e-5
run 100
set group all diameter 0.22
run 1
"""


HERTZ = "model hertz tangential history"
MATERIAL = models.materials({"youngsModulus": 5e7, "poissonsRatio": 0.3, "coefficientRestitution": 0.5, "coefficientFriction": 0.3},
                            types=1)
FLOOR = meshes.ascii_stl([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2), (0, 2, 3)])
MESH = f"fix m all mesh/surface file floor.stl type 1\nfix w all wall/nurbs mesh m type 1 {HERTZ}"


def hertz_force(radius, overlap):
    return 4 / 3 * 5e7 / (2 * (1 - 0.3**2)) * radius**0.5 * overlap**1.5


class Size(unittest.TestCase):
    def gaps(self, apart, height, change):
        atoms = [(1, 1, 1, 1.0, 1000.0, 0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0),
                 (2, 1, 1, 1.0, 1000.0, apart, 0.0, height, 1.0, 0.0, 0.0, 0.0)]
        files = {"ball.json": deck.shape_file("sphere", 1), "balls.data": deck.data_file(atoms)}
        run = deck.run_ok(DECK.format(law=LAW, change=change), files=files)
        last = run.read("rows.txt").split("ITEM: TIMESTEP")[-1].split("ITEM: ENTRIES")[-1].splitlines()[1:]
        rows = [[float(word) for word in line.split()] for line in last if line.strip()]
        return {(int(row[0]), int(row[1])): row[2] for row in rows}

    def test_balls_that_grow_between_runs_touch(self):
        gaps = self.gaps(2.06, 1.03, "set group all diameter 2.1")
        self.assertAlmostEqual(gaps[(1, 2)], -0.04, delta=1e-6)
        self.assertAlmostEqual(gaps[(1, 0)], -0.02, delta=1e-6)
        self.assertAlmostEqual(gaps[(2, 0)], -0.02, delta=1e-6)

    def test_contacts_follow_a_size_changed_between_runs(self):
        for diameter in (2.05, 2.01):
            gaps = self.gaps(1.99, 0.99, f"set group all diameter {diameter}")
            self.assertAlmostEqual(gaps[(1, 2)], 1.99 - diameter, delta=1e-6)
            self.assertAlmostEqual(gaps[(1, 0)], 0.99 - diameter / 2, delta=1e-6)

    def test_balls_that_shrink_between_runs_part(self):
        self.assertEqual(self.gaps(1.99, 0.99, "set group all diameter 1.9"), {})

    def test_one_solver_after_another(self):
        other = f"pair_style gran/nurbs solver cso\npair_coeff * * {LAW}\nrun 3\n" \
                f"pair_style gran/nurbs\npair_coeff * * {LAW}"
        gaps = self.gaps(1.99, 5.0, other)
        self.assertAlmostEqual(gaps[(1, 2)], -0.01, delta=1e-5)

    def test_a_resized_body_has_its_own_effective_radius(self):
        """Hertz's force of a ball held down on a wall and on another ball is that of its new radius at once."""
        for wall in (f"fix w all wall/nurbs plane 0 0 0 0 0 1 type 1 {HERTZ}", MESH, ""):
            held = [(k + 1, 1, 1, 0.1, 2500.0, 0.0, 0.0, 0.099 + 0.198 * k, 1.0, 0.0, 0.0, 0.0) for k in range(1 if wall else 2)]
            text = HELD.format(law=HERTZ, wall=wall, materials=MATERIAL)
            run = deck.run_ok(text, files={"ball.json": deck.shape_file("sphere", 1), "balls.data": deck.data_file(held), "floor.stl": FLOOR})
            force = hertz_force(0.11, 0.011) if wall else hertz_force(0.055, 0.022)
            self.assertAlmostEqual(run.thermo["f"][-1], force, delta=1e-6 * force, msg=wall)

    def test_a_wall_learns_of_a_size_changed_on_the_way(self):
        """So it is where the contact has come from a restart or another rank before the run that follows."""
        files = {"ball.json": deck.shape_file("sphere", 1), "floor.stl": FLOOR,
                 "balls.data": deck.data_file([(1, 1, 1, 0.1, 2500.0, 0.0, 0.0, 0.099, 1.0, 0.0, 0.0, 0.0)])}
        force = hertz_force(0.11, 0.011)  # a cylinder's too, as between LIGGGHTS's own
        for name, wall in (("mesh", MESH), ("plane", f"fix w all wall/nurbs plane 0 0 0 0 0 1 type 1 {HERTZ} move linear 0 0 0"),
                           ("cylinder", f"fix w all wall/nurbs cylinder y 1 0 1 type 1 {HERTZ}")):
            text = HELD.format(law=HERTZ, wall=wall, materials=MATERIAL)
            first, last = text.split("set group")
            half = deck.run_ok(first + "write_restart half.restart\n", files=files)
            restart = text.replace("read_data balls.data", "read_restart half.restart").replace("run 100\n", "")
            other_rank = "processors 2 1 1\n" + first + "displace_atoms all move -1e-6 0 0 units box\nset group" + last
            for way, run in (("at once", deck.run_ok(text, files=files)),
                             ("restart", deck.run_ok(restart, files={**files, "half.restart": half.path / "half.restart"})),
                             ("ranks", deck.run_ok(other_rank, files=files, ranks=2))):
                self.assertAlmostEqual(run.thermo["f"][-1], force, delta=1e-6 * force, msg=f"{name}, {way}")


if __name__ == "__main__":
    unittest.main(verbosity=1)
