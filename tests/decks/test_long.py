#!/usr/bin/python3
"""Crowds that mix what tests elsewhere try one by one: sizes 1:10, periodic in all directions, restarts in the middle of
contacts on other rank counts, ranks without particles, deletion and frozen groups; the energy ledger closes and
memory stays flat. KICKS=1000 makes the shaken crowd's run a million steps."""
import os
import pathlib
import re
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck

KICKS = int(os.environ.get("KICKS", 6))  # of the shaken crowd, 1000 steps each
LAW = "kn 1e6 kt 5e5 cn 1e2 ct 1e2 mu 0.4"
START = f"""
units si
newton off
communicate single vel yes
atom_style nurbs ell.json ball.json
atom_modify map array
boundary {{boundary}}
{{processors}}
region box block 0 6 0 6 0 6 units box
create_box 1 box
neighbor 0.2 bin
neigh_modify delay 0
timestep 5e-5
pair_style gran/nurbs
pair_coeff * * {LAW}
fix t1 all particletemplate/nurbs 15485863 atom_type 1 density constant 1000 shape ell scale constant {{big}}
fix t2 all particletemplate/nurbs 15485867 atom_type 1 density constant 1000 shape ball scale uniform 0.1 0.2
fix d all particledistribution/discrete 32452843 2 t1 0.5 t2 0.5
fix i all insert/pack seed 49979687 distributiontemplate d insert_every once maxattempt 500 all_in yes verbose no {{amount}} region box
run 1
unfix i
"""
MOTION = """
fix m all nve/nurbs
compute e all nurbs/energy
compute r all erotate/nurbs
thermo_style custom step atoms ke c_r c_e[1] c_e[2] c_e[3] c_e[4]
thermo_modify norm no format float %.15g
dump d all custom 1000000 dump.txt id x y z vx vy vz omegax omegay omegaz
dump_modify d first yes format "%d FORMAT"
""".replace("FORMAT", "%.17g " * 9)
PUSH = "region half block 0 3 0 6 0 6 units box\ngroup h region half\nvelocity h set 3 1 0.5\n"
AGAIN = "newton off\natom_modify map array\nread_restart a.restart\ncommunicate single vel yes\nneighbor 0.2 bin\nneigh_modify delay 0\n"


class Crowds(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.files = {"ell.json": deck.shape_file("ellipsoid", 1, 0.8, 0.6), "ball.json": deck.shape_file("sphere", 1)}

    def start(self, boundary="p p p", big=1, amount="volumefraction_region 0.2", processors=""):
        return START.format(boundary=boundary, big=big, amount=amount, processors=processors)

    def energies(self, table):
        return sum(column for name, column in table.items() if name not in ("Step", "Atoms"))

    def check_same(self, one, two, tolerance=0.0):
        first, second = (run.dump("dump.txt")[-1][1] for run in (one, two))
        for name in first:
            np.testing.assert_allclose(first[name], second[name], rtol=0, atol=tolerance, err_msg=name)

    def test_sizes_one_to_ten_and_restarts_on_other_ranks(self):
        text = self.start() + MOTION + PUSH + "run 1500\nwrite_restart a.restart\nrun 1000\n"
        whole = deck.run_ok(text.replace("run 1000\n", "undump d\n" + MOTION[MOTION.index("dump d"):] + "run 1000\n"
                                         + "undump d\n" + MOTION[MOTION.index("dump d"):] + "run 0\n"), files=self.files)
        self.assertGreater(whole.thermo["Atoms"][0], 500)
        # e[2] > 0: the restart falls into contacts that stick
        middle = whole.tables[1]
        self.assertGreater(middle["e[2]"][-1], 0)
        moved = self.energies(middle)
        self.assertLess(abs(moved[-1] / moved[0] - 1), 1e-4)
        for ranks in (2, 4):
            again = deck.run_ok(AGAIN + "timestep 5e-5\n" + MOTION + "run 1000\nundump d\n" + MOTION[MOTION.index("dump d"):] + "run 0\n",
                                ranks=ranks, files={"a.restart": whole.path / "a.restart"})
            self.check_same(whole, again, 1e-9)  # periodic: round-off, see examples/README.md, "Restarts"

    def test_deletion_frozen_groups_and_ranks_without_particles(self):
        """On four ranks all particles are soon on one or two; some vanish, some stay put."""
        plane = f"fix floor all wall/nurbs plane 0 0 0 0 0 1 {LAW}\nfix gravity all gravity 9.81 vector 0 0 -1\n"
        for processors in ("processors 1 1 4", "processors 4 1 1"):
            text = (self.start("p p f", 0.3, "particles_in_region 120", "PROCESSORS") + plane + MOTION
                    + "run 2000\nregion low block 0 6 0 2 0 6 units box\ngroup low region low\ndelete_atoms group low compress no\n"
                      "region mid block 0 6 2 3 0 1 units box\ngroup mid region mid\nvelocity mid set 0 0 0\n"
                      "set group mid omegax 0 omegay 0 omegaz 0\nfix ice mid freeze\nrun 3000\n"
                      "undump d\n" + MOTION[MOTION.index("dump d"):] + "run 0\n")
            # The same particles for both: made on one rank, read on four.
            made = deck.run_ok(text[:text.index("fix floor")].replace("PROCESSORS", "") + "write_data in.data\n", files=self.files)
            data = {**self.files, "in.data": made.path / "in.data"}
            read = text[:text.index("region box")] + "read_data in.data\n" + text[text.index("neighbor"):text.index("fix t1")]
            read += text[text.index("fix floor"):]
            one = deck.run_ok(read.replace("PROCESSORS", ""), files=data)
            four = deck.run_ok(read.replace("PROCESSORS", processors), ranks=4, files=data)
            self.assertLess(one.thermo["Atoms"][-1], 100)
            self.assertGreater(one.thermo["Atoms"][-1], 30)
            self.check_same(one, four, 1e-9)

    def test_shaken(self):
        """Thrown up again and again in a closed box, on two ranks."""
        planes = ("0 0 0 0 0 1", "0 0 6 0 0 -1", "0 0 0 1 0 0", "6 0 0 -1 0 0", "0 0 0 0 1 0", "0 6 0 0 -1 0")
        walls = "".join(f"fix w{k} all wall/nurbs plane {place} {LAW}\n" for k, place in enumerate(planes))
        walls += ("fix gravity all gravity 9.81 vector 0 0 -1\ncompute b all nurbs/atom mass volume\nvariable h atom mass*z*9.81\n"
                  "compute p all reduce sum v_h\n")
        text = self.start("f f f", 0.4, "particles_in_region 200") + walls
        text += MOTION.replace("ke c_r", "ke c_r c_p") + "velocity all set NULL NULL 2 sum yes\nrun 1000\n" * KICKS
        run = deck.run_ok(text.replace("atom_style", "processors 2 1 1\natom_style"), ranks=2, files=self.files, timeout=deck.TIME_LIMIT + 10 * KICKS)
        worst = 0
        for table in run.tables[2:]:
            total = self.energies(table)
            dissipated = sum(table[name][-1] - table[name][0] for name in ("e[3]", "e[4]"))
            worst = max(worst, abs(total[-1] - total[0]) / dissipated)
        self.assertLess(worst, 2e-2)
        self.assertEqual(set(run.thermo["Atoms"]), {200})
        memory = [float(word) for word in re.findall(r"Memory usage per processor = (\S+)", run.screen)]
        self.assertLess(memory[-1] - memory[2], 1)
        if KICKS > 6:
            everything = [self.energies(table) for table in run.tables[2:]]
            net = sum(total[-1] - total[0] for total in everything)
            lost = sum(table[name][-1] - table[name][0] for table in run.tables[2:] for name in ("e[3]", "e[4]"))
            print(f"{run.thermo['Step'][-1]:.0f} steps: dissipated {lost:.6g} J, ledger off by {net:.3g} J in sum, by {worst:.2g} of"
                  f" what a kick dissipates at worst; host memory {memory[2]:.1f} to {memory[-1]:.1f} MB a rank")


if __name__ == "__main__":
    unittest.main()
