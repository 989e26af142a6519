#!/usr/bin/python3
"""Dynamic stability of hard bodies, short versions of bench/stability.py: undamped runs gain no energy beyond the
integrator's order, damped bodies come to rest and stay, nothing is unresolved."""
import functools
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "bench"))
import stability  # noqa: E402

COARSE, FINE = 0.05, 0.0125  # time step / contact period: errors of order dt^2 fall 16 fold


class Bodies:
    """Shape files, made once."""
    directory = tempfile.TemporaryDirectory(prefix="nurbs-stability-")

    @staticmethod
    @functools.lru_cache(maxsize=None)
    def get(name):
        return stability.Shape(name, Bodies.directory.name)


def run(name, body, fraction, seed=7, **options):
    """Outcome of a scene of bench/stability.py."""
    shape = Bodies.get(body)
    scene = stability.SCENES[name](shape, np.random.default_rng(seed), **options)
    return stability.simulate(scene, shape, fraction)


def size(outcome):
    return abs(outcome.error).max()


class Undamped(unittest.TestCase):
    """Errors are fractions of the energy in play. Each contact errs by up to (pi / 2 * fraction)^2 or so, either way."""

    def assert_second_order(self, scene, body, **options):
        coarse, fine = run(scene, body, COARSE, **options), run(scene, body, FINE, **options)
        print(f"    {scene}, {body}: {size(coarse):.2e} at T/20, {size(fine):.2e} at T/80, {fine.contacts} contacts, "
              f"{fine.fallback} by the fallback", flush=True)
        self.assertEqual(coarse.unresolved + fine.unresolved, 0)
        self.assertGreater(fine.contacts, 100)
        self.assertLess(size(coarse), 0.08)
        # phases of onset differ from run to run, hence 5 and not 16
        self.assertLess(size(fine), size(coarse) / 5)

    def test_bouncing(self):
        for body in ("blocky 8", "needle 8:1"):
            with self.subTest(body):
                self.assert_second_order("drop", body)

    def test_colliding(self):
        for body in ("blocky 4 dented", "disc 10:1"):
            with self.subTest(body):
                self.assert_second_order("collide", body)

    def test_shaken(self):
        for body in ("blocky 8", "needle 8:1"):
            with self.subTest(body):
                self.assert_second_order("shake", body, end=3.0)

    def test_boxes_collide_with_witnesses_that_face_each_other(self):
        # normals jump where a contact changes its faces or edges: first order. Contact points that did not face
        # each other once changed the energy of the fourth of these pairs by 7 %, at any time step.
        shape = Bodies.get("box")
        scene = stability.collide(shape, np.random.default_rng(7))
        scene.bodies, scene.energy = scene.bodies[6:8], 1.0
        outcome = stability.simulate(scene, shape, FINE)
        self.assertEqual(outcome.unresolved, 0)
        self.assertGreater(outcome.contacts, 50)
        self.assertLess(size(outcome), 2e-3)


class Damped(unittest.TestCase):

    def test_blocky_body_comes_to_rest_and_stays(self):
        outcome = run("settle", "blocky 8", 0.05)
        print(f"    blocky 8 rests: kinetic energy {outcome.kinetic[-1]:.1e}, creep {outcome.creep:.1e}", flush=True)
        self.assertGreater(outcome.kinetic.max(), 1e-3)
        self.assertLess(outcome.kinetic[-1], 1e-20)
        self.assertLess(outcome.creep, 1e-12)
        self.assertEqual(outcome.unresolved, 0)

    def test_stack_of_blocky_bodies_stands(self):
        outcome = run("stack", "blocky 8", 0.1)
        print(f"    stack: kinetic energy {outcome.kinetic[-1]:.1e}, creep {outcome.creep:.1e}", flush=True)
        self.assertLess(outcome.kinetic[-1], 1e-6)
        self.assertLess(outcome.creep, 5e-3)
        self.assertLess(outcome.error.max(), 1e-12)
        self.assertEqual(outcome.unresolved, 0)

    def test_towers_of_boxes_come_to_rest(self):
        """Boxes land on their corners, so that faces begin up to four times as stiff as the law. Where they stayed so
        until they rested, they did not: four times the springs and twice the dampers on four points are too much for this
        step, and towers swayed for ever by 1e-8 to 8e-5 of the energy of their fall."""
        for seed in (7, 1, 5, 10):
            with self.subTest(seed=seed):
                outcome = run("stack", "box", 0.025, seed)
                print(f"    tower {seed}: kinetic energy {outcome.kinetic[-1]:.1e}", flush=True)
                self.assertLess(outcome.kinetic[-1], 1e-12)
                self.assertLess(outcome.error.max(), 1e-12)


if __name__ == "__main__":
    unittest.main()
