#!/usr/bin/python3
"""The eight benchmarks of Chung & Ooi (Granular Matter 13, 643 (2011)) with NURBS spheres and the host's Hertz model.

Impacts of one test run side by side in one deck. Expected are the published figures, and where those are curves the
closed forms they follow: gross sliding, momentum and angular momentum."""
import math
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from models import Ball, Scene, ball_mass  # noqa: E402

MATERIALS = {  # GPa, Poisson's ratio, kg / m^3
    "glass": (48, 0.20, 2800), "limestone": (20, 0.25, 2500), "aluminium": (70, 0.30, 2699),
    "magnesium": (40, 0.35, 1800), "aluminium oxide": (380, 0.23, 4000), "iron": (100, 0.25, 7000),
    "aluminium alloy": (70, 0.33, 2700), "steel": (208, 0.30, 7850), "polyethylene": (1, 0.40, 1400),
    "nylon": (2.5, 0.40, 1000), "copper": (120, 0.35, 8900), "rigid": (1e9, 0.30, 1000),
}
STEPS = 200  # of a collision


def modulus(a, b="rigid"):
    return 1 / sum((1 - nu**2) / (young * 1e9) for young, nu, _ in (MATERIALS[a], MATERIALS[b]))


def duration(mass, radius, stiffness, speed):
    """Of a Hertz collision: reduced mass and radius, relative speed."""
    return 2.8683 * (mass**2 / (radius * stiffness**2 * speed))**0.2


def impacts(names, balls, restitution, friction, time, floor=False, steps=STEPS, every=1, settings=""):
    """Runs the balls, each in its own place, for the time of a collision and a half."""
    types = [*names, "rigid"]
    values = {"youngsModulus": tuple(MATERIALS[name][0] * 1e9 for name in types),
              "poissonsRatio": tuple(MATERIALS[name][1] for name in types),
              "coefficientRestitution": tuple(map(tuple, restitution)) if np.ndim(restitution) else float(restitution),
              "coefficientFriction": float(friction)}
    place = np.abs(np.array([ball.x for ball in balls])).max() + 3 * max(ball.radius for ball in balls)
    scene = Scene(balls, "hertz tangential history " + settings, dt=time / steps, steps=3 * steps // 2, every=every,
                  floor=len(types) if floor else 0, types=len(types), box=place, materials=values, tolerance=1e-12)
    return scene, scene.run("nurbs")


def ball(names, name, radius, x, v=(0, 0, 0), omega=(0, 0, 0)):
    return Ball(radius, x, v, omega, float(MATERIALS[name][2]), names.index(name) + 1)


def column(run, name):
    """By frame and ball."""
    return np.array([frame[name] for _, frame in run.frames])


def run_length(run):
    return len(run.frames)


class ChungOoi(unittest.TestCase):

    def check(self, found, expected, relative):
        for value, target in zip(np.ravel(found), np.ravel(expected), strict=True):
            self.assertAlmostEqual(value / target, 1, delta=relative)

    def test_1_two_spheres_head_on(self):
        names, r = ["glass", "limestone"], 0.01
        gap = 1e-9
        balls = [ball(names, name, r, (side * (r + gap), k * 0.1, 0), (-10 * side, 0, 0))
                 for k, name in enumerate(names) for side in (-1, 1)]
        scene, run = impacts(names, balls, 1, 0.35, 54.2e-6)
        x, force = column(run, "x"), column(run, "fx")
        overlap = np.array([(2 * r - (x[:, 2 * k + 1] - x[:, 2 * k])).max() for k in (0, 1)])
        self.check(overlap, (274.1e-6, 368.3e-6), 2e-3)
        self.check(force.max(axis=0)[1::2], (10.70e3, 7.108e3), 2e-3)
        self.check((force[:, 1::2] > 0).sum(axis=0) * scene.dt, (40.3e-6, 54.2e-6), 1e-2)

    def test_2_a_sphere_on_a_rigid_plane(self):
        names, r = ["aluminium", "magnesium"], 0.1
        balls = [ball(names, name, r, (k * 0.5, 0, r + 1e-9), (0, 0, -0.2)) for k, name in enumerate(names)]
        scene, run = impacts(names, balls, 1, 0, 767e-6, floor=True)
        self.check((r - column(run, "z")).max(axis=0), (49.7e-6, 52.1e-6), 2e-3)
        self.check(column(run, "fz").max(axis=0), (11.37e3, 7.233e3), 2e-3)
        self.check((column(run, "fz") > 0).sum(axis=0) * scene.dt, (732e-6, 767e-6), 1e-2)

    def test_3_restitution(self):
        """The rebound is the coefficient of restitution, of any material."""
        r = 0.0025
        for e in (0.2, 0.5, 0.8, 1.0):
            names = ["aluminium oxide", "iron"]
            balls = [ball(names, name, r, (k * 0.02, 0, r + 1e-12), (0, 0, -3.9)) for k, name in enumerate(names)]
            time = duration(ball_mass(balls[1]), r, modulus("iron"), 3.9)
            _, run = impacts(names, balls, e, 0, 2 * time, floor=True, steps=2000, every=500)
            self.check(column(run, "vz")[-1] / 3.9, (e, e), 2e-3)

    def test_4_oblique_impacts(self):
        """Tangential restitution of the sphere's centre; beyond 32.5 degrees it slides throughout."""
        r, mu, e = 0.0025, 0.092, 0.98
        published = {10: 0.687, 20: 0.616, 30: 0.684, 50: 0.845, 80: 0.966}
        angles = np.array([5, 10, 20, 30, 40, 50, 60, 70, 80, 85])
        for name in ("aluminium oxide", "aluminium alloy"):
            radians = np.radians(angles)
            balls = [ball([name], name, r, (0, k * 0.01, r + 1e-12), (3.9 * math.sin(a), 0, -3.9 * math.cos(a)))
                     for k, a in enumerate(radians)]
            # The steepest are the longest: a collision takes vn^(-1/5).
            time = duration(ball_mass(balls[0]), r, modulus(name), 3.9 * math.cos(radians[-1]))
            _, run = impacts([name], balls, e, mu, time, floor=True)
            rebound = column(run, "vx")[-1] / column(run, "vx")[0]
            for angle, found in zip(angles, rebound):
                if angle in published:
                    self.check(found, published[angle], 2.5e-2 if angle < 30 else 3e-3)
                if angle > 32.5:
                    self.check(found, 1 - mu * (1 + e) / math.tan(math.radians(angle)), 2e-3)
            spin = column(run, "omegay")[-1]  # no torque about the contact: angular momentum about it stays
            self.check(0.4 * r * spin, column(run, "vx")[0] - column(run, "vx")[-1], 3e-3)

    def test_5_constant_normal_velocity(self):
        """Spin after the impact, r omega / (mu vn): -5 where it slides throughout, less where it sticks."""
        r, mu, vn = 1e-5, 0.3, 5.0
        for name in ("steel", "polyethylene"):
            ratio = np.array([0.1, 0.5, 2.0, 5.0, 10.0, 14.0])  # tangential velocity / (mu vn)
            balls = [ball([name], name, r, (0, k * 1e-4, r + 1e-14), (mu * vn * s, 0, -vn)) for k, s in enumerate(ratio)]
            _, run = impacts([name], balls, 1, mu, duration(ball_mass(balls[0]), r, modulus(name), vn), floor=True)
            shorter = (1 - column(run, "z").min() / r)  # the arm, by half the overlap
            spin = -r * column(run, "omegay")[-1] / (mu * vn)
            self.check(spin[-2:], (-5.0, -5.0), shorter + 2e-3)
            self.assertTrue((np.diff(spin[:5]) < 0).all())
            self.check(spin * 0.4, column(run, "vx")[-1] / (mu * vn) - ratio, shorter + 2e-3)

    def spinning(self, names, pairs, floor):
        """Impacts of spinning spheres at normal velocity 0.2 each: gross sliding and what is conserved."""
        omega = np.array([0.175, 0.873, 3.49, 8.73, 17.5, 21.0])
        mu, e, vn = 0.4, 0.5, 0.2
        balls, masses = [], []
        for k, spin in enumerate(omega):
            for (name, r, side) in pairs:
                x = (0, 1.0 * k, r + 1e-9) if floor else (side * (r + 1e-9), 1.0 * k, 0)
                v = (0, 0, -vn) if floor else (-side * vn, 0, 0)
                balls.append(ball(names, name, r, x, v, (0, spin, 0) if floor or side < 0 else (0, 0, 0)))
                masses.append(ball_mass(balls[-1]))
        radii = [r for _, r, _ in pairs]
        reduced, radius = (masses[0], radii[0]) if floor else (1 / sum(1 / m for m in masses[:2]), 1 / sum(1 / r for r in radii))
        other = "rigid" if floor else pairs[1][0]
        speed = vn if floor else 2 * vn
        time = 1.2 * duration(reduced, radius, modulus(pairs[0][0], other), speed)
        # The host's tangential damper knows no cone; without it the friction is Coulomb's.
        scene, run = impacts(names, balls, e, mu, time, floor=floor, settings="tangential_damping off")
        across = column(run, "vx" if floor else "vz")[-1].reshape(len(omega), -1)
        spin = column(run, "omegay")[-1].reshape(len(omega), -1)
        impulse = masses[0] * across[:, 0]
        if not floor:  # linear momentum
            np.testing.assert_allclose(masses[0] * across[:, 0] + masses[1] * across[:, 1], 0, atol=1e-9 * masses[0] * vn)
        # The friction force acts at the contact point.
        change = 0.4 * masses[0] * radii[0] * (spin[:, 0] - omega)
        np.testing.assert_allclose(change, -impulse, atol=3e-3 * np.abs(impulse).max())
        # The slowest stick; the fastest slides all the time, also while the damper pulls.
        pressed = np.abs(column(run, "fz" if floor else "fx")).reshape(run_length(run), len(omega), -1)[:, :, 0]
        sliding = mu * pressed.sum(axis=0) * scene.dt
        self.check(np.abs(impulse[-1]), sliding[-1], 1e-2)
        self.assertLess(np.abs(impulse[0]), 0.1 * sliding[0])

    def test_6_spinning_sphere_on_a_rigid_plane(self):
        for name in ("aluminium", "nylon"):
            self.spinning([name], [(name, 0.1, 0)], True)

    def test_7_spinning_on_an_equal_sphere(self):
        for name in ("aluminium", "copper"):
            self.spinning([name], [(name, 0.1, -1), (name, 0.1, 1)], False)

    def test_8_spinning_on_an_unequal_sphere(self):
        self.spinning(["aluminium", "nylon"], [("aluminium", 0.1, -1), ("nylon", 0.2, 1)], False)


if __name__ == "__main__":
    unittest.main()
