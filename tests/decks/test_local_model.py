#!/usr/bin/python3
"""Contacts served by the local model: their share in a settling bed, and that the energy ledger does not notice."""
import functools
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402

LAW = "kn 1e5 kt 5e4 cn 150 ct 60 mu 0.3"
STEPS = 80000
DECK = """
units si
atom_style nurbs pebble.json
boundary f f f
newton off
communicate single vel yes
read_data bodies.data
pair_style gran/nurbs tolerance {tolerance}
pair_coeff * * {law}
neighbor 0.005 bin
neigh_modify delay 0
fix 1 all nve/nurbs
fix g all gravity 9.81 vector 0 0 -1
fix floor all wall/nurbs plane 0 0 0 0 0 1 {law}
fix left all wall/nurbs plane -0.1 0 0 1 0 0 {law}
fix right all wall/nurbs plane 0.1 0 0 -1 0 0 {law}
fix front all wall/nurbs plane 0 -0.1 0 0 1 0 {law}
fix back all wall/nurbs plane 0 0.1 0 0 -1 0 {law}
compute ke all ke
compute er all erotate/nurbs
compute led all nurbs/energy
compute st all nurbs/stats
compute at all nurbs/atom mass
variable mgz atom c_at*9.81*z
compute mgz all reduce sum v_mgz
variable kinetic equal c_ke+c_er
variable ledger equal c_ke+c_er+c_mgz+c_led[1]+c_led[2]+c_led[3]+c_led[4]
variable lost equal c_led[3]+c_led[4]
fix share all ave/time 1 1000 1000 c_st[4] c_st[5] c_st[6] c_st[7] c_st[8] c_st[10] file share.txt
thermo_style custom step v_ledger v_lost v_kinetic
thermo_modify format float %.15g norm no
thermo 1000
timestep 1e-5
run {steps}
"""


class Bed:
    """27 pebbles fall into a bin and come to rest."""

    def __init__(self, tolerance):
        atoms = []
        random = np.random.default_rng(3)
        for k in range(27):
            x, y, z = 0.064 * (np.array([k % 3, k // 3 % 3, k // 9]) - [1, 1, -0.6]) + random.uniform(-1e-3, 1e-3, 3)
            q = random.normal(size=4)
            atoms.append((k + 1, 1, 1, 0.025, 2500.0, float(x), float(y), float(z), *map(float, q / np.linalg.norm(q))))
        files = {"pebble.json": deck.shape_file("pebble"),
                 "bodies.data": deck.data_file(atoms, (), ((-0.2, 0.2), (-0.2, 0.2), (-0.05, 0.4)))}
        run = deck.run_ok(DECK.format(law=LAW, tolerance=tolerance, steps=STEPS), files=files)
        self.ledger, self.lost, self.kinetic = (np.array(run.thermo[name]) for name in ("ledger", "lost", "kinetic"))
        rows = np.array([line.split() for line in run.read("share.txt").splitlines() if line[0] != "#"], dtype=float)
        self.local, self.warm, self.cold, self.fallback, self.contacts, self.unresolved = rows[:, 1:].T

    @property
    def share(self):
        """Of the pairs that got past the bounds, those the local model served."""
        return self.local / np.maximum(self.local + self.warm + self.cold + self.fallback, 1e-9)

    @property
    def residual(self):
        """Of the ledger over what was dissipated."""
        return abs(self.ledger - self.ledger[0]).max() / self.lost[-1]


@functools.lru_cache(maxsize=None)
def bed(tolerance):
    return Bed(tolerance)


class LocalModel(unittest.TestCase):
    def test_serves_a_bed_at_rest_almost_alone(self):
        b = bed(1e-9)
        solved = b.local + b.warm + b.cold + b.fallback
        whole = b.local.sum() / solved.sum()
        print(f"    share served: {whole:.3f} of the whole run, {b.share.max():.3f} of its best 1000 steps", flush=True)
        self.assertEqual(b.unresolved.max(), 0)
        self.assertGreater(b.contacts[-1], 50)
        self.assertGreater(b.share.max(), 0.99)
        self.assertGreater(whole, 0.6)

    def test_the_ledger_does_not_notice(self):
        served, exact = bed(1e-9), bed(1e-13)
        print(f"    residual over dissipated: {served.residual:.2e} with the local model ({served.local.sum():.3g} of it), "
              f"{exact.residual:.2e} at 1e-13 ({exact.local.sum():.3g})", flush=True)
        self.assertLess(exact.local.sum(), 0.9 * served.local.sum())
        self.assertLess(served.residual, 1.5 * exact.residual + 1e-6)
        self.assertLess(served.residual, 1e-3)


if __name__ == "__main__":
    unittest.main(verbosity=1)
