#!/usr/bin/python3
"""The paper's scene (examples/two_particles) through its collisions: event times, energy ledger, ranks."""
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402

EXAMPLE = deck.ROOT / "examples" / "two_particles"
sys.path.insert(0, str(EXAMPLE))
import converge  # noqa: E402
import plot  # noqa: E402

FILES = ("data.two_particles", "particle_a.json", "particle_b.json")


def run(ranks, time, **variables):
    text = "".join(f"variable {name} index {value}\n" for name, value in {"time": time, **variables}.items())
    text += (EXAMPLE / "in.two_particles").read_text()
    return deck.run_ok(text, ranks=ranks, files={name: EXAMPLE / name for name in FILES})


class TwoParticles(unittest.TestCase):
    def test_first_touches_are_near_the_paper(self):
        """The control points are unpublished: bodies of the same inertia tensors, so within a few per cent."""
        result = run(1, 0.1)
        plane, pair, _ = plot.events(result.path, 1e-6)
        self.assertAlmostEqual(plane, 0.065, delta=0.03 * 0.065)
        self.assertAlmostEqual(pair, 0.07963, delta=0.03 * 0.07963)

    def test_ledger_holds_at_every_step_of_the_impacts(self):
        with tempfile.TemporaryDirectory() as folder:
            e = converge.run(deck.PROGRAM, Path(folder), 1e-6, 0.0805, 1)
        self.assertEqual(len(e), 80500)
        self.assertGreater(e["damping"][-1], 0.1)  # both first impacts are over
        self.assertLess(plot.residual(e), 3e-4)

    def test_error_of_the_ledger_falls_as_dt_squared(self):
        with tempfile.TemporaryDirectory() as folder:
            dt, final, _ = converge.errors(deck.PROGRAM, Path(folder), (5, 7, 10, 14, 20), 0.25).T
        self.assertLess(final[dt < 1.1e-6].max(), 1e-4)
        self.assertAlmostEqual(converge.slope(dt, final), 2, delta=0.35)

    def test_same_energies_on_two_ranks(self):
        results = [run(ranks, 0.1, dt=2e-6) for ranks in (1, 2)]
        one, two = (plot.read_energies(result.path) for result in results)
        for name in one.dtype.names:
            np.testing.assert_allclose(two[name], one[name], rtol=1e-9, atol=1e-11, err_msg=name)


if __name__ == "__main__":
    unittest.main()
