#!/usr/bin/python3
"""Whole decks against closed forms: collisions, walls, friction, free rotation, ranks and restarts."""
import functools
import json
import math
import sys
import unittest
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402

SPHERE = (1.0, 1.0, 1.0)


@dataclass
class Body:
    """One line of the Atoms section and one of Velocities; `shape` counts from 1, `mass` is exact."""
    shape: int
    mass: float
    x: tuple
    v: tuple = (0, 0, 0)
    q: tuple = (1, 0, 0, 0)
    omega: tuple = (0, 0, 0)
    kind: int = 1


@dataclass
class Scene:
    """Exact ellipsoids, given by their semi-axes, with the commands that move them."""
    axes: list
    bodies: list
    dt: float
    steps: int
    every: int = 1  # steps between outputs
    box: float = 12.0
    commands: list = field(default_factory=list)  # walls, gravity, fix nve/nurbs
    coefficients: list = field(default_factory=lambda: ["* * kn 1 kt 0 mu 0"])


def volume(axes):
    return 4 / 3 * math.pi * math.prod(axes)


def gyration(axes):
    """Principal moments of a uniform ellipsoid of unit mass."""
    square = np.square(axes)
    return (square.sum() - square) / 5


@functools.lru_cache(maxsize=None)
def ellipsoid(axes):
    """Shape file of an exact ellipsoid; its gyration is written out to make the inertia exact to round-off."""
    content = json.loads(deck.shape_file("ellipsoid", *axes))
    content["gyration"] = [*gyration(axes), 0, 0, 0]
    return json.dumps(content)


def shape_names(scene):
    return [f"shape{k + 1}.json" for k in range(len(scene.axes))]


def input_files(scene):
    """Shape files and data file, by name."""
    atoms, velocities = [], []
    for k, body in enumerate(scene.bodies):
        density = body.mass / volume(scene.axes[body.shape - 1])
        atoms.append((k + 1, body.kind, body.shape, 1.0, density, *map(float, (*body.x, *body.q))))
        velocities.append((k + 1, *map(float, (*body.v, *body.omega))))
    limits = ((-scene.box, scene.box), ) * 3
    kinds = max(body.kind for body in scene.bodies)
    files = dict(zip(shape_names(scene), map(ellipsoid, scene.axes)))
    files["bodies.data"] = deck.data_file(atoms, velocities, limits, kinds)
    return files


DUMPED = "x y z vx vy vz omegax omegay omegaz c_body[1] c_body[2] c_body[3] c_body[4] c_body[5]"


def output(scene):
    """Trajectory in bodies.dump, energies as thermo; every digit of both."""
    return """
compute body all nurbs/atom qw qx qy qz mass
compute moving all ke
compute turning all erotate/nurbs
compute contact all nurbs/energy
dump bodies all custom {every} bodies.dump id {columns}
dump_modify bodies sort id format "%d{format}"
thermo {every}
variable spring equal c_contact[1]+c_contact[2]
variable lost equal c_contact[3]+c_contact[4]
thermo_style custom step c_moving c_turning v_spring v_lost
thermo_modify norm no format float %.17g
""".format(every=scene.every, columns=DUMPED, format=" %.17g" * len(DUMPED.split()))


def physics(scene):
    return "\n".join(["pair_style gran/nurbs"] + ["pair_coeff " + c for c in scene.coefficients] + scene.commands +
                     ["timestep %.17g" % scene.dt])


def opening(scene):
    return """units si
newton off
communicate single vel yes
atom_style nurbs {names}
atom_modify map array
boundary f f f
neighbor 0.1 bin
neigh_modify delay 0
""".format(names=" ".join(shape_names(scene)))


class Result:
    """Bodies by time: arrays [frame, body, component]; energies by time: arrays [frame]."""

    def __init__(self, run, scene):
        frames = run.dump("bodies.dump")
        self.time = scene.dt * np.array([step for step, _ in frames])

        def stack(*columns):
            return np.array([[f[c] for c in columns] for _, f in frames]).transpose(0, 2, 1)

        self.x = stack("x", "y", "z")
        self.v = stack("vx", "vy", "vz")
        self.omega = stack("omegax", "omegay", "omegaz")
        self.q = stack("c_body[1]", "c_body[2]", "c_body[3]", "c_body[4]")
        self.mass = stack("c_body[5]")[0, :, 0]
        self.kinetic = run.thermo["moving"] + run.thermo["turning"]
        self.spring = run.thermo["spring"]
        self.dissipated = run.thermo["lost"]
        self.energy = self.kinetic + self.spring + self.dissipated

    def angular_momenta(self, scene):
        """Of each body about its own centre and about the origin."""
        turn = rotation_matrices(self.q)
        moments = np.array([gyration(scene.axes[b.shape - 1]) for b in scene.bodies]) * self.mass[:, None]
        body = np.einsum("tbji,tbj->tbi", turn, self.omega) * moments
        return np.einsum("tbij,tbj->tbi", turn, body), np.cross(self.x, self.mass[:, None] * self.v)


def rotation_matrices(q):
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def angle_between(p, q):
    """Of two orientations; first order in the difference, so good to round-off."""
    return 2 * np.linalg.norm(p[0] * q[1:] - q[0] * p[1:] - np.cross(p[1:], q[1:]))


def simulate(scene, ranks=1):
    text = [opening(scene), "read_data bodies.data", physics(scene), output(scene), f"run {scene.steps}"]
    return Result(deck.run_ok("\n".join(text), ranks=ranks, files=input_files(scene)), scene)


def slopes(steps, errors):
    return np.diff(np.log(errors)) / np.diff(np.log(steps))


def normalized(q):
    return tuple(np.array(q) / np.linalg.norm(q))


def report(text, *values):
    print("    " + text % values, flush=True)


class Collision(unittest.TestCase):
    """Two ellipsoids meet obliquely, turning, without friction and damping.

    With the first touch a fraction t of a step before the step that sees it, velocity Verlet changes the energy of a
    linear contact by (t^2 - t) omega^2 dt^2 m v^2 / 2, and likewise at the end: of order dt^2, but anything within
    that bound. So the deck holds pairs evenly spread over both fractions, by distance (begin of the contact) and mass
    (its duration), and the root mean square over them is measured.
    """

    PHASES, SPACING = 6, 6.0
    DURATION = 0.085  # of the contact, s, about

    def scene(self, dt):
        bodies = []
        for k in range(self.PHASES**2):
            i, j = divmod(k, self.PHASES)
            far, y, z = i / self.PHASES * dt, self.SPACING * i, self.SPACING * j
            heavy = (1 + j / self.PHASES * dt / self.DURATION)**2
            bodies.append(Body(1, 1.3 * heavy, (-1.0 - far, 0.1 + y, 0.05 + z), (1.0, 0.1, 0),
                               normalized((1, 0.2, -0.4, 0.3)), (0.3, -0.5, 0.8)))
            bodies.append(Body(2, 0.7 * heavy, (1.0 + far, -0.3 + y, -0.1 + z), (-1.0, 0, 0.2),
                               normalized((0.3, 0.9, 0.2, -0.5)), (-0.6, 0.4, 0.2)))
        steps = round(0.448 / dt)
        return Scene(axes=[(1.0, 0.8, 0.6), (0.9, 0.7, 0.5)], bodies=bodies, dt=dt, steps=steps, every=steps // 14, box=40,
                     coefficients=["* * kn 400 kt 0 mu 0"], commands=["fix move all nve/nurbs"])

    def energy_errors(self, scene, result):
        """Of each pair after the collision, relative to its energy before; springs are empty then."""
        spin, _ = result.angular_momenta(scene)
        energy = 0.5 * (result.mass * (result.v**2).sum(axis=2) + (spin * result.omega).sum(axis=2))
        pairs = energy[:, 0::2] + energy[:, 1::2]
        np.testing.assert_allclose(energy.sum(axis=1), result.kinetic, rtol=1e-12)
        return pairs[-1] / pairs[0] - 1

    def test_energy_and_momenta(self):
        steps = [4e-3, 2e-3, 1e-3, 5e-4]
        errors = []
        for dt in steps:
            scene = self.scene(dt)
            result = simulate(scene)
            self.assertGreater(result.spring.max(), 0.05 * result.energy[0], "they must meet")
            self.assertEqual(result.spring[-1], 0, "they must part again")
            self.assertEqual(np.abs(result.dissipated).max(), 0)
            errors.append(np.sqrt(np.mean(self.energy_errors(scene, result)**2)))
            self.check_momenta(scene, result)
        rates = slopes(steps, errors)
        report("collision: energy errors %s at dt %s, slopes %s", np.array(errors), steps, rates)
        self.assertAlmostEqual(np.mean(rates), 2, delta=0.1)
        self.assertLess(np.abs(rates - 2).max(), 0.2)
        self.assertLess(errors[-1], 3e-5)

    def check_momenta(self, scene, result):
        """Of each pair, about the origin of the lab; the first pair is near it."""
        pairs = np.arange(2 * self.PHASES**2).reshape(-1, 2)
        linear = result.mass[:, None] * result.v
        spin, orbit = result.angular_momenta(scene)
        drifts = []
        for momentum in (linear, spin + orbit):
            total = momentum[:, pairs].sum(axis=2)
            scale = np.linalg.norm(momentum[0, pairs], axis=2).sum(axis=1)
            drifts.append((np.linalg.norm(total - total[0], axis=2) / scale).max())
        self.assertGreater(np.linalg.norm(spin[-1] - spin[0], axis=1).min(), 0.05, "spin must be exchanged")
        report("collision: dt %g, linear momentum to %.1e, angular to %.1e", scene.dt, *drifts)
        self.assertLess(max(drifts), 1e-12)


class SpheroidOnWall(unittest.TestCase):
    """A spheroid tilted by 45 degrees falls on a frictionless wall: impulsive limit in closed form."""

    EQUATORIAL, POLAR = 2.0, 1.0

    def closed_form(self):
        a, c, tilt, m, v, e = self.EQUATORIAL, self.POLAR, math.pi / 4, 1.0, 1.0, 1.0
        height = math.hypot(a * math.sin(tilt), c * math.cos(tilt))
        lever = (a * a - c * c) * math.sin(tilt) * math.cos(tilt) / height
        moment = m * (a * a + c * c) / 5
        impulse = (1 + e) * v / (1 / m + lever**2 / moment)
        return height, impulse / m - v, impulse * lever / moment

    def outgoing(self, kn):
        height, _, _ = self.closed_form()
        contact = math.pi / math.sqrt(1.9 * kn)  # 1.9 = 1/m + lever^2/I
        dt = contact / 400
        scene = Scene(axes=[(self.EQUATORIAL, self.EQUATORIAL, self.POLAR)],
                      bodies=[Body(1, 1.0, (0, 0, height + 0.1 * contact), (0, 0, -1),
                                   (math.cos(math.pi / 8), 0, math.sin(math.pi / 8), 0))],
                      dt=dt, steps=520, every=20, box=10,
                      commands=["fix floor all wall/nurbs plane 0 0 0 0 0 1 kn %r kt 0 mu 0" % kn,
                                "fix move all nve/nurbs"])
        result = simulate(scene)
        self.assertEqual(result.energy[-1], result.kinetic[-1], "it must have left the wall")
        self.assertAlmostEqual(result.energy[-1], 0.5, delta=1e-5)
        return result.v[-1, 0, 2], np.linalg.norm(result.omega[-1, 0])

    def test_impulsive_limit(self):
        _, v, omega = self.closed_form()
        self.assertAlmostEqual(v, 0.0526316, delta=5e-8)
        self.assertAlmostEqual(omega, 0.998614, delta=5e-7)
        errors = []
        stiffness = [1e4, 1e6, 1e8, 1e10]
        for kn in stiffness:
            got_v, got_omega = self.outgoing(kn)
            report("spheroid on wall: kn %g, outgoing v %+.7f (closed %+.7f), |omega| %.6f (closed %.6f)", kn, got_v, v,
                   got_omega, omega)
            errors.append(math.hypot(got_v - v, got_omega - omega))
        rates = slopes(stiffness, errors)
        report("spheroid on wall: errors %s, slopes in kn %s", np.array(errors), rates)
        self.assertTrue(all(late < 0.3 * early for early, late in zip(errors, errors[1:])))
        self.assertLess(errors[-1], 5e-5)


class SlidingToRolling(unittest.TestCase):
    def test_five_sevenths(self):
        v0, mu, g, stiffness, m = 1.0, 0.3, 9.81, 1e7, 1.0
        scene = Scene(axes=[SPHERE],
                      bodies=[Body(1, m, (0, 0, 1 - m * g / stiffness), (v0, 0, 0), normalized((1, 2, -1, 0.5)))],
                      dt=2e-5, steps=7500, every=10, box=10,
                      commands=["fix floor all wall/nurbs plane 0 0 0 0 0 1 kn %g kt %g ct 1000 mu %g" %
                                (stiffness, stiffness, mu), "fix weight all gravity %g vector 0 0 -1" % g,
                                "fix move all nve/nurbs"])
        result = simulate(scene)
        v, spin = result.v[:, 0, 0], result.omega[:, 0, 1]
        rolls = 2 * v0 / (7 * mu * g)
        sliding = result.time < 0.98 * rolls
        np.testing.assert_allclose(v[sliding], v0 - mu * g * result.time[sliding], atol=2e-5)
        np.testing.assert_allclose(spin[sliding], 2.5 * mu * g * result.time[sliding], atol=1e-4)
        slip = v - spin
        measured = result.time[np.argmax(slip < 1e-3 * v0)]
        report("sliding to rolling: v/v0 %.8f (5/7 = %.8f), rolls from %.5f s (closed %.5f)", v[-1] / v0, 5 / 7, measured,
               rolls)
        self.assertAlmostEqual(v[-1], 5 / 7 * v0, delta=1e-5)
        self.assertAlmostEqual(spin[-1], 5 / 7 * v0, delta=1e-5)
        self.assertAlmostEqual(measured, rolls, delta=1e-3 * rolls + scene.every * scene.dt)
        after = v[result.time > 1.1 * rolls]
        self.assertLess(np.ptp(after), 1e-6)
        # What friction took: 1/7 of the kinetic energy, wherever else it might have gone.
        self.assertAlmostEqual(result.kinetic[-1], 5 / 7 * 0.5 * m * v0**2, delta=1e-5)


def restitution(ratio):
    """Of F = max(0, kn delta + cn rate), damping `ratio` of critical (Schwager & Poeschel, Gran. Matter 9 (2007) 465).

    The overlap is that of a damped oscillator until its acceleration vanishes; then the bodies part freely.
    """
    b = ratio
    if b < 1:
        w = math.sqrt(1 - b * b)
        end = math.atan2(2 * b * w, 2 * b * b - 1) / w
        return -math.exp(-b * end) * (math.cos(w * end) - b / w * math.sin(w * end))
    w = math.sqrt(b * b - 1)
    end = math.atanh(2 * b * w / (2 * b * b - 1)) / w
    return -math.exp(-b * end) * (math.cosh(w * end) - b / w * math.sinh(w * end))


class HeadOn(unittest.TestCase):
    """Damped head-on collisions of two spheres, and of a sphere with a wall, many in one deck."""

    RATIOS = [0.0, 0.05, 0.3, 0.7, 0.95, 2.0]
    KN, MASS, SPEED = 1e4, 1.0, 0.5

    def measure(self, dt):
        bodies, coefficients, commands = [], [], []
        for k, ratio in enumerate(self.RATIOS):
            y = 3.0 * k
            pair_cn = 2 * ratio * math.sqrt(self.KN * self.MASS / 2)
            wall_cn = 2 * ratio * math.sqrt(self.KN * self.MASS)
            kind = k + 1
            for side in (-1, 1):
                bodies.append(Body(1, self.MASS, (side * (1 + 1e-3), y, 5), (-side * self.SPEED, 0, 0),
                                   normalized((1, k, side, 0.3)), kind=kind))
            coefficients.append("%d %d kn %r kt 0 cn %.17g mu 0" % (kind, kind, self.KN, pair_cn))
            bodies.append(Body(1, self.MASS, (0, y, 1 + 1e-3), (0, 0, -self.SPEED), kind=kind))
            commands.append("group kind%d type %d" % (kind, kind))
            commands.append("fix floor%d kind%d wall/nurbs plane 0 0 0 0 0 1 kn %r kt 0 cn %.17g mu 0" %
                            (kind, kind, self.KN, wall_cn))
        coefficients.insert(0, "* * kn 1 kt 0 mu 0")
        scene = Scene(axes=[SPHERE], bodies=bodies, dt=dt, steps=round(0.08 / dt), every=round(0.08 / dt), box=30,
                      coefficients=coefficients, commands=commands + ["fix move all nve/nurbs"])
        result = simulate(scene)
        v = result.v[-1]
        pairs = (v[1::3, 0] - v[0::3, 0]) / (2 * self.SPEED)
        walls = v[2::3, 2] / self.SPEED
        return pairs, walls

    def test_restitution(self):
        closed = np.array([restitution(r) for r in self.RATIOS])
        coarse, fine = self.measure(2e-4), self.measure(5e-5)
        for name, early, late in zip(("pair", "wall"), coarse, fine):
            report("restitution (%s): %s\n      closed form       %s\n      errors at dt 2e-4 %s, 5e-5 %s", name, late,
                   closed, early - closed, late - closed)
            np.testing.assert_allclose(late, closed, atol=2e-4)
            worst = np.abs(early - closed).max(), np.abs(late - closed).max()
            self.assertLess(worst[1], worst[0] / 8, "second order: 16")


def top_rate(moments, l_lab, q):
    """dq/dt of a free top, in plain numbers because numpy is slow on four of them."""
    w, x, y, z = q
    a, b, c = l_lab
    l1 = (1 - 2 * (y * y + z * z)) * a + 2 * (x * y + w * z) * b + 2 * (x * z - w * y) * c
    l2 = 2 * (x * y - w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z + w * x) * c
    l3 = 2 * (x * z + w * y) * a + 2 * (y * z - w * x) * b + (1 - 2 * (x * x + y * y)) * c
    o1, o2, o3 = 0.5 * l1 / moments[0], 0.5 * l2 / moments[1], 0.5 * l3 / moments[2]
    return (-x * o1 - y * o2 - z * o3, w * o1 + y * o3 - z * o2, w * o2 + z * o1 - x * o3, w * o3 + x * o2 - y * o1)


def free_top(moments, l_lab, q, time, steps):
    """Orientation of a free top by Gragg extrapolation of order 12: independent of what is tested."""
    moments, l_lab = [float(m) for m in moments], [float(c) for c in l_lab]

    def euler(base, h, at):
        return [b + h * r for b, r in zip(base, top_rate(moments, l_lab, at))]

    for _ in range(steps):
        rows = []
        start = [float(c) for c in q]
        for k in range(6):
            n = 2 * (k + 1)
            h = time / steps / n
            before, now = start, euler(start, h, start)
            for _ in range(n - 1):
                before, now = now, euler(before, 2 * h, now)
            value = 0.5 * (np.array(now) + euler(before, h, now))
            for j in range(k):
                refined = value + (value - rows[j]) / (((k + 1) / (k - j))**2 - 1)
                rows[j], value = value, refined
            rows.append(value)
        q = rows[-1] / np.linalg.norm(rows[-1])
    return q


class Dzhanibekov(unittest.TestCase):
    """Rotation about the intermediate axis flips: one body for each choice of `rotation`, in one deck."""

    SCHEMES = ["symplectic", "richardson", "exact"]
    AXES = (1.0, 0.8, 0.6)
    START = normalized((0.6, -0.3, 0.5, 0.55))
    TIME = 24.0

    def setUp(self):
        turn = rotation_matrices(np.array(self.START))
        self.omega = turn @ np.array([0.1, 2.0, 0.1])
        self.moments = 1.7 * gyration(self.AXES)
        self.l_lab = turn @ (self.moments * (turn.T @ self.omega))

    def errors(self, dt, reference):
        bodies = [Body(1, 1.7, (4.0 * k, 0, 0), (0, 0, 0), self.START, tuple(self.omega)) for k in range(3)]
        commands = []
        for k, scheme in enumerate(self.SCHEMES):
            commands += ["group g%d id %d" % (k, k + 1), "fix move%d g%d nve/nurbs rotation %s" % (k, k, scheme)]
        steps = round(self.TIME / dt)
        scene = Scene(axes=[self.AXES], bodies=bodies, dt=dt, steps=steps, every=steps // 60, commands=commands)
        result = simulate(scene)
        spin, _ = result.angular_momenta(scene)
        drift = np.linalg.norm(spin - self.l_lab, axis=2).max() / np.linalg.norm(self.l_lab)
        self.assertLess(drift, 1e-12)
        body = np.einsum("tbji,tbj->tbi", rotation_matrices(result.q), spin)
        self.assertLess(body[..., 1].min(), -0.9 * np.linalg.norm(self.l_lab), "it must flip")
        return [angle_between(q, reference) for q in result.q[-1]]

    def test_each_scheme(self):
        reference = free_top(self.moments, self.l_lab, np.array(self.START), self.TIME, 240)
        steps = [0.04, 0.02, 0.01]
        errors = np.array([self.errors(dt, reference) for dt in steps])
        for k, scheme in enumerate(self.SCHEMES):
            report("Dzhanibekov, %s: errors %s rad after %g s", scheme, errors[:, k], self.TIME)
        np.testing.assert_allclose(slopes(steps, errors[:, 0]), 2, atol=0.1)
        # Richardson's phase error falls as dt^2, its drift in energy as dt^3; flips magnify the latter, which still
        # dominates at these steps. test_rotation.cpp measures the second order.
        self.assertGreater(slopes(steps, errors[:, 1]).min(), 1.9)
        self.assertLess(errors[-1, :2].max(), 1e-3)
        self.assertLess(errors[:, 2].max(), 1e-10)


class RanksAndRestart(unittest.TestCase):
    """A heap forming in a corner: the same scene on 1, 2 and 4 ranks, and cut in two by a restart."""

    def scene(self):
        random = np.random.default_rng(7)
        bodies = []
        for k in range(16):
            i, j, layer = k % 2, k // 2 % 2, k // 4
            x = np.array([2.3 * i - 1.15, 2.3 * j - 1.15, 1.2 + 2.1 * layer]) + random.uniform(-0.1, 0.1, 3)
            bodies.append(Body(1 + k % 3, random.uniform(0.8, 1.2), tuple(x), tuple(random.normal(0, 0.5, 3)),
                               normalized(random.normal(0, 1, 4)), tuple(random.normal(0, 1, 3))))
        law = "kn 2e4 kt 1e4 cn 20 ct 10 mu 0.4"
        planes = {"floor": "0 0 0 0 0 1", "left": "-2.3 0 0 1 0 0", "right": "2.3 0 0 -1 0 0", "front": "0 -2.3 0 0 1 0",
                  "back": "0 2.3 0 0 -1 0"}
        commands = ["fix %s all wall/nurbs plane %s %s" % (name, plane, law) for name, plane in planes.items()]
        commands += ["fix weight all gravity 9.81 vector 0 0 -1", "fix move all nve/nurbs"]
        return Scene(axes=[(1.0, 0.8, 0.6), SPHERE, (1.1, 0.9, 0.8)], bodies=bodies, dt=5e-4, steps=2400, every=200, box=12,
                     coefficients=["* * " + law], commands=commands)

    def cut(self, ranks):
        """Half the steps, a restart, the other half: without the shape files, which a restart carries."""
        scene = self.scene()
        half = f"run {scene.steps // 2}"
        first = [opening(scene), "read_data bodies.data", physics(scene), half, "write_restart half.restart"]
        done = deck.run_ok("\n".join(first), ranks=ranks, files=input_files(scene))
        head = [line for line in opening(scene).splitlines() if not line.startswith("atom_style")]
        second = [*head, "read_restart half.restart", physics(scene), output(scene), half]
        again = deck.run_ok("\n".join(second), ranks=ranks, files={"half.restart": done.path / "half.restart"})
        return Result(again, scene)

    def difference(self, a, b):
        n = min(len(a.x), len(b.x))
        return [max(np.abs(getattr(a, c)[-k] - getattr(b, c)[-k]).max() for c in ("x", "v", "q", "omega"))
                for k in range(n, 0, -1)]

    def test_same_trajectory(self):
        one = simulate(self.scene(), 1)
        self.assertLess(one.x[-1, :, 2].max(), one.x[0, :, 2].max() - 1, "the heap must have fallen")
        self.assertGreater(one.dissipated[-1], 10)
        for name, other in (("2 ranks", simulate(self.scene(), 2)), ("4 ranks", simulate(self.scene(), 4)),
                            ("restart", self.cut(1)), ("restart on 2 ranks", self.cut(2))):
            differences = self.difference(one, other)
            report("against 1 rank, %s: largest difference at each frame %s", name,
                   " ".join("%.0e" % d for d in differences))
            # This heap comes out bit for bit, but not every one does: the order in which a body's contacts are summed
            # is that of the neighbour list, which depends on the ranks and on when the list was built. A last bit so
            # lost grows with every collision, and may tip a contact from the local model to a full solve, whose normal
            # is the same to the root of the tolerance only. With 72 bodies 1 and 4 ranks differ by 1e-9 after 3000
            # steps, 2 ranks not at all, a restart by 1e-5.
            self.assertLess(differences[-1], 1e-8)


if __name__ == "__main__":
    unittest.main(verbosity=2)
