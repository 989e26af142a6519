#!/usr/bin/python3
"""The host's contact models on NURBS bodies: equal to the host's spheres, and to elliptical Hertz theory where bodies
are none; ranks, restarts, energies, the host's computes, bad input."""
import dataclasses
import json
import math
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402
import models  # noqa: E402
from models import Ball, Scene  # noqa: E402

# Two balls of unequal size and material that meet each other and the floor, sliding, rolling and spinning.
PAIR = [Ball(0.01, (0, 0, 0.00999), (0.3, 0.1, -0.4), (5, -8, 3), 2500.0, 1),
        Ball(0.008, (0.0175, 0.001, 0.0105), (-0.6, 0.2, -0.2), (-10, 4, 20), 2300.0, 2)]

# Every model of every kind at least once, each with several of the others.
COMBINATIONS = [
    "hertz tangential history",
    "hertz tangential no_history cohesion sjkr rolling_friction cdt",
    "hertz tangential history cohesion sjkr2 rolling_friction epsd",
    "hertz tangential history cohesion sjkr rolling_friction epsd2 tangential_reduce on",
    "hertz tangential history rolling_friction epsd3 tangential_damping off limitForce on",
    "hertz rolling_friction epsd torsionTorque on",
    "hertz/stiffness tangential history rolling_friction epsd2",
    "hooke tangential history rolling_friction cdt",
    "hooke tangential no_history rolling_friction epsd viscous on",
    "hooke tangential history cohesion sjkr ktToKnUser on",
    "hooke/stiffness tangential history absolute_damping on",
    "hooke/stiffness tangential no_history rolling_friction epsd2",
    "hooke/hysteresis tangential history rolling_friction epsd",
    "hooke/hysteresis tangential no_history cohesion sjkr",
    "luding tangential history",
    "luding tangential tan_luding rolling_friction luding torsion on",
]


def difference(a, b):
    """Largest difference of positions, velocities and spins in all frames, relative to the largest of their kind."""
    worst = 0
    for (step, p), (other, q) in zip(a.frames, b.frames, strict=True):
        assert step == other
        for names in (("x", "y", "z"), ("vx", "vy", "vz"), ("omegax", "omegay", "omegaz")):
            ours, theirs = (np.array([frame[name] for name in names]) for frame in (p, q))
            worst = max(worst, np.abs(ours - theirs).max() / np.abs(theirs).max())
    return worst


class HostSpheres(unittest.TestCase):

    def test_every_model_moves_nurbs_spheres_as_host_spheres(self):
        for words in COMBINATIONS:
            with self.subTest(words):
                scene = Scene(PAIR, words, floor=1, gravity=9.81)
                self.assertLess(difference(scene.run("nurbs"), scene.run("sphere")), 1e-12)

    def test_models_that_double_round_off(self):
        """edinburgh's loads are powers of differences; thornton_ning takes i's radius for the pair's, so equal balls."""
        equal = [dataclasses.replace(ball, radius=0.009) for ball in PAIR]
        for words, balls in (("edinburgh tangential history fixKc on", PAIR),
                             ("edinburgh/stiffness tangential history rolling_friction cdt", PAIR),
                             ("thornton_ning tangential history", equal)):
            with self.subTest(words):
                scene = Scene(balls, words)
                self.assertLess(difference(scene.run("nurbs"), scene.run("sphere")), 1e-10)

    def test_forces_are_good_to_the_tolerance(self):
        exact = Scene(PAIR, "hertz tangential history", floor=1, steps=100, every=10)
        host = exact.run("sphere")
        for tolerance in (1e-9, 1e-6, 1e-3):
            ours = dataclasses.replace(exact, tolerance=tolerance).run("nurbs")
            self.assertLess(difference(ours, host), 10 * tolerance)

    def test_a_frozen_ball(self):
        scene = Scene(PAIR, "hertz tangential history rolling_friction epsd2",
                      commands="group still id 2\nfix still still freeze\nvelocity still set 0 0 0")
        self.assertLess(difference(scene.run("nurbs"), scene.run("sphere")), 1e-12)

    def test_preloaded_library_leaves_host_spheres_alone(self):
        scene = Scene(PAIR, "hertz tangential history cohesion sjkr rolling_friction epsd2", floor=1, gravity=9.81)
        plain = scene.run("sphere", program="/usr/bin/liggghts")
        loaded = scene.run("sphere", program="/usr/bin/liggghts",
                           env={"LD_PRELOAD": str(deck.BUILD / "libliggghts_nurbs.so")})
        self.assertEqual(plain.read("out.dump"), loaded.read("out.dump"))
        self.assertEqual(plain.read("out.dump"), scene.run("sphere").read("out.dump"))


# --- bodies that are no spheres


def rotation(q):
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def support(axes, q, d):
    """Support function of an ellipsoid, its point and its inverse Weingarten map (3 x 3), for unit d."""
    r = rotation(q)
    m = r @ np.diag(np.square(axes)) @ r.T
    h = math.sqrt(d @ m @ d)
    return h, m @ d / h, m / h - np.outer(m @ d, m @ d) / h**3


def curvatures(maps, normal):
    """Relative principal curvatures, ascending, of surfaces with these inverse Weingarten maps."""
    t = np.linalg.svd(normal[None])[2][1:].T
    return np.linalg.eigvalsh(sum(np.linalg.inv(t.T @ w @ t) for w in maps))


def elliptic(m):
    """Complete elliptic integrals K, E of parameter m by the arithmetic-geometric mean."""
    a, g, c, power, total = 1.0, math.sqrt(1 - m), math.sqrt(m), 0.5, 0.5 * m
    while abs(c) > 1e-16:
        a, g, c = (a + g) / 2, math.sqrt(a * g), (a - g) / 2
        power *= 2
        total += power * c * c
    k = math.pi / (2 * a)
    return k, k * (1 - total)


def hertz_force(modulus, k_a, k_b, overlap):
    """Exact elliptical Hertz contact (Johnson, Contact Mechanics, 4.2): relative curvatures k_a <= k_b."""
    if k_b / k_a - 1 < 1e-9:
        return 4 / 3 * modulus * math.sqrt(1 / k_a) * overlap**1.5
    low, high = 1e-14, 1 - 1e-14  # e^2 of the contact ellipse
    for _ in range(200):
        m = (low + high) / 2
        k, e = elliptic(m)
        low, high = (m, high) if (e / (1 - m) - k) / (k - e) < k_b / k_a else (low, m)
    k, e = elliptic(m)
    a = math.sqrt(overlap * (k - e) / (k_a / 2 * m * k))
    return 2 / 3 * math.pi * a * modulus * overlap / k


@dataclasses.dataclass
class Body:
    shape: int
    x: tuple
    v: tuple = (0, 0, 0)
    q: tuple = (1, 0, 0, 0)
    omega: tuple = (0, 0, 0)
    density: float = 2500.0


PLAIN = {"youngsModulus": 5e6, "poissonsRatio": 0.25, "coefficientRestitution": 1.0, "coefficientFriction": 0.0,
         "coefficientRollingFriction": 0.1, "coefficientRollingViscousDamping": 0.1, "characteristicVelocity": 1.0,
         "cohesionEnergyDensity": 1e4}
MODULUS = 5e6 / (2 * (1 - 0.25**2))  # of two bodies of PLAIN


def bodies_deck(bodies, shapes, words, values=PLAIN, floor=False, gravity=0.0, dt=1e-5, steps=0, every=100, commands="",
                tolerance=1e-12, end=None, box=0.1, radius=""):
    """A deck of NURBS bodies, all of scale 0.01, and its files. Thermo: energies; dump: motion."""
    names = [f"shape{k}.json" for k in range(len(shapes))]
    atoms = [(k + 1, 1, b.shape, 0.01, b.density, *map(float, b.x), *map(float, np.array(b.q) / np.linalg.norm(b.q)))
             for k, b in enumerate(bodies)]
    velocities = [(k + 1, *map(float, (*b.v, *b.omega))) for k, b in enumerate(bodies)]
    files = dict(zip(names, shapes))
    files["bodies.data"] = deck.data_file(atoms, velocities, ((-box, box), ) * 3)
    text = ["units si", "atom_style nurbs " + " ".join(names), "boundary f f f", "newton off",
            "communicate single vel yes", "read_data bodies.data", "neighbor 0.002 bin", "neigh_modify delay 0",
            models.materials(values, 1), f"pair_style gran/nurbs tolerance {tolerance} {radius} model {words}",
            "pair_coeff * *"]
    if floor:
        text.append(f"fix floor all wall/nurbs plane 0 0 0 0 0 1 type 1 {radius} model {words}")
    if gravity:
        text.append(f"fix gravity all gravity {gravity} vector 0 0 -1")
    text += ["fix move all nve/nurbs", f"timestep {dt!r}", "compute spin all erotate/nurbs",
             "compute held all nurbs/energy", "compute body all nurbs/atom qw qx qy qz", f"thermo {every}",
             "thermo_style custom step ke c_spin c_held[1] c_held[2] c_held[3] c_held[4]",
             "thermo_modify format float %.15g norm no lost error",
             f"dump d all custom {every} out.dump {models.DUMPED} c_body[1] c_body[2] c_body[3] c_body[4]",
             'dump_modify d format "%d' + " %.17g" * 19 + '"', commands, end or f"run {steps}"]
    return "\n".join(text) + "\n", files


def run_bodies(*arguments, ranks=1, **options):
    text, files = bodies_deck(*arguments, **options)
    run = deck.run_ok(text, ranks=ranks, files=files)
    run.frames = run.dump("out.dump")
    return run


def unit(*q):
    return tuple(np.array(q) / np.linalg.norm(q))


class EllipticalHertz(unittest.TestCase):
    """Forces against elliptic integrals; the fit of the effective radius is good to 6e-5."""

    def test_on_a_plane(self):
        down = np.array([0, 0, -1.0])
        for axes, q in (((1, 1, 1), (1, 0, 0, 0)), ((1.25, 1, 0.8), (1, 0, 0, 0)), ((1.25, 1, 0.8), unit(3, 1, -2, 4)),
                        ((2, 1, 1), (1, 0, 0, 0)), ((2, 1, 1), unit(1, 0, 1, 0)), ((3, 1, 1.5), unit(2, 2, -1, 3))):
            with self.subTest(axes=axes, q=q):
                h, _, w = support(axes, q, down)
                overlap = 2e-5
                run = run_bodies([Body(1, (0, 0, 0.01 * h - overlap), q=q)], [models.ellipsoid(*map(float, axes))],
                                 "hertz tangential history", floor=True)
                force = hertz_force(MODULUS, *curvatures([0.01 * w], down), overlap)
                self.assertAlmostEqual(run.frames[0][1]["fz"][0] / force, 1, delta=7e-5)

    def test_of_two_ellipsoids(self):
        axes, q = ((1.25, 1, 0.8), (2, 1, 1.2)), (unit(3, 1, -2, 4), unit(1, -2, 2, 5))
        d = np.array(unit(2, -1, 2))
        (ha, pa, wa), (hb, pb, wb) = (support(axes[k], q[k], side) for k, side in enumerate((d, -d)))
        overlap = 2e-5  # along d, which stays the normal: the points lie on it
        apart = 0.01 * (pa - pb) - overlap * d
        run = run_bodies([Body(1, (0, 0, 0), q=q[0]), Body(2, tuple(apart), q=q[1])],
                         [models.ellipsoid(*map(float, a)) for a in axes], "hertz tangential history")
        force = hertz_force(MODULUS, *curvatures([0.01 * wa, 0.01 * wb], d), overlap)
        f = np.array([run.frames[0][1][name][1] for name in ("fx", "fy", "fz")])
        self.assertAlmostEqual(f @ d / force, 1, delta=7e-5)
        self.assertLess(np.linalg.norm(f - f @ d * d), 1e-6 * force)

    def test_in_and_on_a_cylinder(self):
        axes, down, wall, overlap = (1.25, 1, 0.8), np.array([0, 0, -1.0]), 0.03, 2e-5
        bent = np.linalg.inv(0.01 * support(axes, (1, 0, 0, 0), down)[2][:2, :2])
        for inside in (1, -1):
            run = run_bodies([Body(1, (0, 0, -inside * (wall - inside * 0.008) - overlap))],
                             [models.ellipsoid(*map(float, axes))], "hertz",
                             commands=f"fix pipe all wall/nurbs cylinder x {wall} 0 0 type 1 model hertz")
            k = np.linalg.eigvalsh(bent - inside * np.diag([0, 1 / wall]))
            self.assertAlmostEqual(run.frames[0][1]["fz"][0] / hertz_force(MODULUS, *k, overlap), 1, delta=7e-5)

    def test_flat_and_volume_radii(self):
        """A face on a plane has the bounding radius; `radius volume` that of the ball of equal volume."""
        overlap = 2e-5
        box = deck.box_shape(1.0, 0.8, 0.6)
        run = run_bodies([Body(1, (0, 0, 0.006 - overlap))], [box], "hertz tangential history", floor=True)
        radius = 0.01 * math.sqrt(1 + 0.64 + 0.36)
        self.assertAlmostEqual(run.frames[0][1]["fz"][0] / (4 / 3 * MODULUS * math.sqrt(radius) * overlap**1.5), 1,
                               delta=1e-6)
        run = run_bodies([Body(1, (0, 0, 0.008 - overlap))], [models.ellipsoid(1.25, 1.0, 0.8)], "hertz", floor=True,
                         radius="radius volume")
        self.assertAlmostEqual(run.frames[0][1]["fz"][0] / (4 / 3 * MODULUS * math.sqrt(0.01) * overlap**1.5), 1,
                               delta=1e-6)


def plate(cells, half):
    """STL of the square |x|, |y| <= half at z = 0, cut into 2 cells^2 triangles."""
    edge, facets = np.linspace(-half, half, cells + 1), []
    for x0, x1 in zip(edge, edge[1:]):
        for y0, y1 in zip(edge, edge[1:]):
            for corners in (((x0, y0), (x1, y0), (x1, y1)), ((x0, y0), (x1, y1), (x0, y1))):
                vertices = "".join(f"vertex {x!r} {y!r} 0\n" for x, y in np.array(corners).tolist())
                facets.append(f"facet normal 0 0 1\nouter loop\n{vertices}endloop\nendfacet\n")
    return "solid plate\n" + "".join(facets) + "endsolid plate\n"


class RollingFriction(unittest.TestCase):
    def test_a_body_rolls_down_slopes_steeper_than_the_coefficient(self):
        """Whatever its shape: a long pill on its side stopped where a ball rolled, since the effective radius, which is the
        lever of spheres, has its length. Thrown on slopes of 0.13 and 0.07, coefficient 0.1."""
        materials = {"youngsModulus": 1e7, "poissonsRatio": 0.3, "coefficientRestitution": 0.3, "coefficientFriction": 0.6,
                     "coefficientRollingFriction": 0.1}
        for name, shape, height in (("ball", deck.shape_file("sphere", radius=1), 1), ("spheroid", deck.shape_file("ellipsoid", 1, 2, 1), 1),
                                    ("pill", deck.shape_file("capsule", radius=1, length=4), 1),
                                    ("tablet", deck.shape_file("tablet", radius=1, height=1, rim=0.2), 1)):
            # The axis along y; capsules and tablets are made along z.
            turn = "" if name in ("ball", "spheroid") else "set group all quat 1 0 0 90"
            for rolling in ("cdt", "epsd2"):
                for slope in (0.13, 0.07):
                    down = (slope, 0, -1)
                    size = float(np.hypot(slope, 1))
                    run = deck.run_ok(f"""
units si
atom_style nurbs body.json
boundary f f f
newton off
communicate single vel yes
region box block -1 3 -1 1 -1 1 units box
create_box 1 box
neighbor 0.003 bin
neigh_modify delay 0
{models.materials(materials, 1)}
pair_style gran/nurbs model hertz tangential history rolling_friction {rolling}
pair_coeff * *
fix w all wall/nurbs plane 0 0 0 0 0 1 type 1 model hertz tangential history rolling_friction {rolling}
create_atoms 1 single 0 0 {0.01 * height - 1e-6} units box
set group all density 2500
set group all nurbs/scale 0.01
{turn}
velocity all set 0.2 0 0
fix g all gravity {9.81 * size} vector {down[0] / size} 0 {down[2] / size}
fix m all nve/nurbs
timestep 5e-6
variable v equal vcm(all,x)
thermo_style custom step v_v
thermo 20000
run 100000
""", files={"body.json": shape})
                    v = run.thermo["v"]
                    with self.subTest(name, rolling=rolling, slope=slope):
                        if slope > 0.1:
                            self.assertGreater(v[-1], v[1])
                        else:
                            self.assertLess(v[-1], 0.9 * v[1])


class MeshWalls(unittest.TestCase):

    def test_a_plate_of_triangles_is_a_plane(self):
        """Springs, rolling and the curvature go from triangle to triangle."""
        values = {**PLAIN, "coefficientRestitution": 0.6, "coefficientFriction": 0.4}
        body = Body(1, (0, 0, 0.0145), (0.5, 0.2, -0.5), unit(3, 1, -2, 4), (20, -30, 10))
        text, files = bodies_deck([body], [models.ellipsoid(1.25, 1.0, 0.8)],
                                  "hertz tangential history cohesion sjkr rolling_friction epsd2", values, floor=True,
                                  gravity=9.81, steps=6000, every=1000)
        files["plate.stl"] = plate(4, 0.08)
        plane = deck.run_ok(text, files=files)
        mesh = deck.run_ok(text.replace("fix floor all wall/nurbs plane 0 0 0 0 0 1",
                                        "fix plate all mesh/surface file plate.stl type 1\n"
                                        "fix floor all wall/nurbs mesh plate"), files=files, ranks=2)
        for run in (plane, mesh):
            run.frames = run.dump("out.dump")
        self.assertLess(difference(mesh, plane), 1e-11)


class Energy(unittest.TestCase):

    def test_elastic_collisions_keep_it(self):
        """Ellipsoids that tumble against the floor and each other, without damping and friction."""
        q = unit(3, 1, -2, 4)
        cases = {"floor": dict(bodies=[Body(1, (0, 0, 0.019), (0.1, 0, -0.5), q, (20, -30, 10))], floor=True),
                 "pair": dict(bodies=[Body(1, (0, 0, 0), (0, 0, 0.4), q, (5, 20, -10)),
                                      Body(2, (0.003, -0.002, 0.028), (0, 0, -0.4), unit(1, -2, 2, 5), (9, -9, 30))])}
        shapes = [models.ellipsoid(2.0, 1.0, 1.0), models.ellipsoid(1.25, 1.0, 0.8)]
        for name, scene in cases.items():
            for words in ("hertz", "hooke tangential history", "hertz tangential no_history cohesion sjkr2"):
                with self.subTest(name, words=words):
                    run = run_bodies(scene["bodies"], shapes[:2], words, floor=scene.get("floor", False), dt=2e-6,
                                     steps=8000, every=200)
                    t = run.thermo
                    kinetic = t["KinEng"] + t["spin"]
                    total = kinetic + t["held[1]"] + t["held[2]"]
                    self.assertGreater(t["held[1]"].max(), 1e-2 * kinetic[0])  # they have met
                    self.assertEqual(t["held[1]"][-1], 0)
                    self.assertLess(abs(kinetic[-1] / kinetic[0] - 1), 1e-6)
                    self.assertLess(np.abs(total / total[0] - 1).max(), 1e-6)

    def test_elastic_collisions_of_flat_bodies_keep_it(self):
        """Corners and edges come down flat, and roll; a rounded box gained 40 % on the floor, two boxes lost 45 %."""
        rounded = deck.shape_file("rounded-box", 1, 0.8, 0.6, rounding=0.15)
        turned = np.random.default_rng(5)
        grid = [(x, y, 0.0155) for x in (-0.06, -0.02, 0.02, 0.06) for y in (-0.05, 0, 0.05)]
        several = [Body(1, x, (0, 0, -0.2), unit(*turned.normal(size=4)), tuple(turned.uniform(-3, 3, 3))) for x in grid]
        one = Body(1, (0, 0, 0.0153), (0, 0, -0.2),
                   (0.6176912787777149, 0.6950166964508822, 0.031808364872708716, -0.3666026509732002),
                   (-0.0273894774, -0.303053551, 0.909557836))
        x, v = np.array((-0.006305325, 0.007823068, 0.012394956)), (0.032068621, -0.053033789, -0.078479429)
        pair = [Body(1, tuple(x), v, (0.942031194384051, -0.28458639980668865, -0.16367988631313998, 0.06924824621619622),
                     (0.4516732, -0.7452786, 0.374747)),
                Body(1, tuple(-x), tuple(-c for c in v),
                     (-0.47970347823412623, 0.2473590729762991, 0.8376282597882744, 0.0841246717108258),
                     (0.5617568, -0.075104, 0.5617568))]
        # An edge rolled on to where the face that leans over it is open.
        x, v = np.array((-0.002188, 0.015748733, 0.0058821786)), (0.0116865, -0.0910271772, -0.0397174850)
        lean = [Body(1, tuple(x), v, (-0.3280771572516928, 0.4650724614879329, 0.3718171368459795, 0.7333655304163547),
                     (-0.4081081, -0.4620404, 0.6438791)),
                Body(1, tuple(-x), tuple(-c for c in v),
                     (0.6863744121746117, -0.5937058006271023, -0.41280502216662807, -0.07743127460979443),
                     (-0.7213232, 0.0197925, 0.6675686))]
        # A line rolls on to a face, and corners of a solid with all but sharp edges come down flat.
        tube = (0.7672737470740928, -0.6407971289679256, 0.0016817175517496782, -0.025830377144379926)
        roller = Body(1, (0, 0, 0.0114619), (0, 0, -0.2), tube, (2.1424022, 0.6566409, -0.3922096))
        round_box = deck.shape_file("rounded-box", 1, 0.8, 0.6, rounding=0.5)
        for name, bodies, shape, floor, most in (("one", [one], rounded, True, 2e-3), ("several", several, rounded, True, 5e-4),
                                                 ("pair", pair, deck.box_shape(1, 0.8, 0.6), False, 5e-4),
                                                 ("leaning pair", lean, rounded, False, 2e-3),
                                                 ("roller", [roller], round_box, True, 5e-3)):
            for words in ("hertz tangential no_history", "hooke tangential no_history"):
                with self.subTest(name, words=words):
                    t = run_bodies(bodies, [shape], words, floor=floor, dt=1.3e-5, steps=20000, every=200).thermo
                    kinetic = t["KinEng"] + t["spin"]
                    total = kinetic + t["held[1]"]
                    self.assertGreater(t["held[1]"].max(), 1e-2 * kinetic[0])
                    self.assertEqual(t["held[1]"][-1], 0)
                    self.assertLess(abs(kinetic[-1] / kinetic[0] - 1), most)
                    self.assertLess(np.abs(total / total[0] - 1).max(), 5 * most)

    def test_elastic_collisions_in_a_cylinder_keep_it(self):
        """A second place comes into contact at finite overlap: a tablet gained 30 %."""
        tablet = deck.shape_file("tablet", 1, height=0.8, rim=0.15)
        body = Body(1, (0, 0, 0), (-0.196445, 0, 0.0375402),
                    (0.7672737470740928, -0.6407971289679256, 0.0016817175517496782, -0.025830377144379926),
                    (2.2573866, 0.6918823, -0.4132595))
        for words in ("hertz tangential no_history", "hooke tangential no_history"):
            t = run_bodies([body], [tablet], words, dt=1e-5, steps=20000, every=200,
                           commands=f"fix tube all wall/nurbs cylinder y 0.031 0 0 type 1 model {words}").thermo
            total = t["KinEng"] + t["spin"] + t["held[1]"]
            self.assertGreater(t["held[1]"].max(), 0.1 * total[0])
            self.assertLess(np.abs(total / total[0] - 1).max(), 1e-2)

    def test_models_that_tell_no_energy_bounce_no_higher(self):
        """Their polygons held nothing, and let bodies sink in to half their size."""
        body = Body(1, (0, 0, 0.0145), (0, 0, -0.2),
                    (0.6387894387525346, -0.5036351531781682, -0.37408862207939836, 0.44537331335876224),
                    (-1.8914342, -0.8639885, 0.4484429))
        for name, rounding in (("sharp", 0), ("rounded", 0.05)):
            shape = deck.shape_file("rounded-box", 1, 0.8, 0.6, rounding=rounding) if rounding else deck.box_shape(1, 0.8, 0.6)
            for words in ("luding tangential no_history", "hooke/hysteresis tangential no_history"):
                with self.subTest(name, words=words):
                    values = {**models.MATERIALS, "youngsModulus": 5e6, "poissonsRatio": 0.3, "coefficientYieldRatio": 0.02,
                              "coefficientFriction": 0.0, "coefficientRestitution": 0.9, "LoadingStiffness": 7000,
                              "coefficientAdhesionStiffness": 0.0, "surfaceEnergy": 0.0, "pullOffForce": 0.0}
                    run = run_bodies([body], [shape], words, values, floor=True, gravity=9.81, dt=1e-5, steps=30000, every=100)
                    kinetic = run.thermo["KinEng"] + run.thermo["spin"]
                    height = np.array([frame["z"][0] for _, frame in run.frames])
                    self.assertLess(kinetic.max(), 5 * kinetic[0])
                    self.assertLess(height.max(), 0.018)
                    self.assertGreater(height.min(), 0.005)

    def test_ledger_closes_with_everything_on(self):
        """Damping, friction, rolling: the error of the sum falls with the square of the time step."""
        values = {**PLAIN, "coefficientRestitution": 0.5, "coefficientFriction": 0.4}
        body = Body(1, (0, 0, 0.0145), (0.4, 0.1, -0.5), unit(3, 1, -2, 4), (20, -30, 10))
        errors = []
        for dt in (8e-6, 4e-6):
            run = run_bodies([body], [models.ellipsoid(1.25, 1.0, 0.8)],
                             "hertz tangential history rolling_friction epsd2", values, floor=True, gravity=9.81, dt=dt,
                             steps=round(0.1 / dt), every=round(0.1 / dt) // 50)
            t = run.thermo
            mass = 4 / 3 * math.pi * 1e-6 * 2500
            height = np.array([frame["z"][0] for _, frame in run.frames])
            total = sum(t[name] for name in ("KinEng", "spin", "held[1]", "held[2]", "held[3]", "held[4]"))
            total = total + mass * 9.81 * height
            lost = t["held[3]"][-1] + t["held[4]"][-1]
            self.assertGreater(lost, 0.3 * (t["KinEng"] + t["spin"])[0])
            self.assertGreater(t["held[4]"][-1], 0)
            errors.append(np.abs(total - total[0]).max() / total[0])
        self.assertLess(errors[0], 1e-5)
        self.assertLess(errors[1], 0.3 * errors[0])

    def test_a_lasting_contact_follows_the_curvature(self):
        """An ellipsoid that falls aslant, rocks and rests has the stiffness of the place it rests on; the ledger closes."""
        axes, q, down = (2.0, 1.0, 1.0), unit(math.cos(0.5), 0, math.sin(0.5), 0), np.array([0, 0, -1.0])
        values = {**PLAIN, "coefficientRestitution": 0.3, "coefficientFriction": 0.8,
                  "coefficientRollingViscousDamping": 0.5}
        run = run_bodies([Body(1, (0, 0, 0.01 * support(axes, q, down)[0] - 1e-6), q=q)], [models.ellipsoid(*axes)],
                         "hertz tangential history rolling_friction epsd2", values, floor=True, gravity=9.81, dt=2e-5,
                         steps=60000, every=6000)
        weight = 4 / 3 * math.pi * 2e-6 * 2500 * 9.81
        last = run.frames[-1][1]
        h, _, w = support(axes, [last[f"c_body[{k}]"][0] for k in (1, 2, 3, 4)], down)
        force = hertz_force(MODULUS, *curvatures([0.01 * w], down), 0.01 * h - last["z"][0])
        self.assertAlmostEqual(force / weight, 1, delta=1e-3)
        total = sum(run.thermo[name] for name in ("KinEng", "spin", "held[1]", "held[2]", "held[3]", "held[4]"))
        total = total + weight * np.array([frame["z"][0] for _, frame in run.frames])
        self.assertLess(np.abs(total - total[0]).max(), 1e-5 * weight * 0.01)

    def test_a_box_comes_to_rest_on_its_face(self):
        values = {**PLAIN, "coefficientRestitution": 0.3, "coefficientFriction": 0.5}
        box = deck.box_shape(1.0, 0.8, 0.6)
        run = run_bodies([Body(1, (0, 0, 0.008), (0.02, 0, 0), unit(1, 0.1, 0.05, 0.02))], [box],
                         "hertz tangential history", values, floor=True, gravity=9.81, dt=1e-5, steps=40000, every=4000)
        mass, radius = 8 * 0.48e-6 * 2500, 0.01 * math.sqrt(2)
        overlap = (mass * 9.81 / (4 / 3 * MODULUS * math.sqrt(radius)))**(2 / 3)
        last = run.frames[-1][1]
        self.assertAlmostEqual((0.006 - last["z"][0]) / overlap, 1, delta=1e-2)
        self.assertAlmostEqual(last["fz"][0] / (mass * 9.81), 0, delta=1e-2)
        speeds = np.array([[last[name][0] for name in ("vx", "vy", "vz", "omegax", "omegay", "omegaz")]])
        self.assertLess(np.abs(speeds[:, :3]).max(), 1e-6)
        self.assertLess(np.abs(speeds[:, 3:]).max(), 1e-4)


# --- the host around it

HEAP_WORDS = "hertz tangential history cohesion sjkr rolling_friction epsd2"
HEAP_VALUES = {**PLAIN, "coefficientRestitution": 0.5, "coefficientFriction": 0.4}
HEAP_SHAPES = [models.ellipsoid(1.25, 1.0, 0.8), deck.box_shape(1.0, 0.8, 0.6)]


def heap():
    """Nine bodies that fall together, ellipsoids and boxes."""
    random = np.random.default_rng(5)
    return [Body(1 + k % 2, ((k % 3 - 1) * 0.022, (k // 3 - 1) * 0.022, 0.014 + 0.004 * (k % 2)),
                 tuple(random.uniform(-0.3, 0.3, 3) - 4 * np.array([(k % 3 - 1), (k // 3 - 1), 1]) * 0.08),
                 unit(*random.normal(size=4)), tuple(random.uniform(-20, 20, 3))) for k in range(9)]


class RanksAndRestarts(unittest.TestCase):

    def test_same_bits_on_any_number_of_ranks(self):
        runs = [run_bodies(heap(), HEAP_SHAPES, HEAP_WORDS, HEAP_VALUES, floor=True, gravity=9.81, dt=2e-5, steps=2500,
                           ranks=ranks, tolerance=1e-9, commands="dump_modify d sort id") for ranks in (1, 2, 4)]
        self.assertGreater(runs[0].thermo["held[4]"][-1], 0)
        for other in runs[1:]:
            self.assertEqual(runs[0].read("out.dump"), other.read("out.dump"))
            for name, values in runs[0].thermo.items():
                self.assertLess(np.abs(values - other.thermo[name]).max(), 1e-12 * np.abs(values).max() + 1e-300)

    def test_restart_in_the_middle_of_contacts(self):
        """The models come back from the restart by themselves, on another number of ranks."""
        options = dict(floor=True, gravity=9.81, dt=2e-5, steps=2400, tolerance=1e-9)
        text, files = bodies_deck(heap(), HEAP_SHAPES, HEAP_WORDS, HEAP_VALUES, commands="dump_modify d sort id",
                                  end="run 1200\nwrite_restart middle.restart\nrun 1200", **options)
        whole = deck.run_ok(text, files=files)
        for pair in ("", f"pair_style gran/nurbs tolerance 1e-9 model {HEAP_WORDS}\npair_coeff * *\n"):
            with self.subTest(pair):
                again = text.replace("run 1200\nwrite_restart middle.restart\n", "")
                head, tail = again.split("read_data bodies.data\n")
                lines = [line for line in tail.splitlines() if not line.startswith("pair_")]
                again = "newton off\nread_restart middle.restart\ncommunicate single vel yes\n" + pair + "\n".join(lines)
                rest = deck.run_ok(again + "\n", ranks=2,
                                   files={"middle.restart": whole.path / "middle.restart"})
                frames = rest.read("out.dump").partition("ITEM: TIMESTEP\n1300\n")[2]
                self.assertTrue(frames)
                self.assertEqual(whole.read("out.dump").partition("ITEM: TIMESTEP\n1300\n")[2], frames)
                for name in ("held[1]", "held[2]", "held[3]", "held[4]"):
                    self.assertAlmostEqual(rest.thermo[name][-1] / whole.thermo[name][-1], 1, delta=1e-9)


class HostFeatures(unittest.TestCase):

    def test_check_timestep(self):
        """Fractions of Rayleigh and Hertz time: of spheres the host's own, of an ellipsoid by its radii and mass."""
        out = dict(commands="fix check all check/timestep/gran 10 0.001 0.001\n"
                            "variable a equal f_check[1]\nvariable b equal f_check[2]\nvariable c equal f_check[3]\n"
                            'fix out all print 10 "${a} ${b} ${c}" file check.txt screen no', steps=20)
        scene = Scene(PAIR, "hertz tangential history", **out)
        host, ours = scene.run("sphere"), scene.run("nurbs")
        np.testing.assert_allclose(np.loadtxt(ours.path / "check.txt"), np.loadtxt(host.path / "check.txt"), rtol=1e-5)
        run = run_bodies([Body(1, (0, 0, 0), (0.3, 0, 0))], [models.ellipsoid(2.0, 1.0, 0.8)], "hertz", steps=20,
                         commands=out["commands"])
        shear, mass = 5e6 / 2.5, 4 / 3 * math.pi * 1.6e-6 * 2500
        rayleigh = math.pi * 0.008 * math.sqrt(2500 / shear) / (0.1631 * 0.25 + 0.8766)
        hertz = 2.87 * (mass**2 / (0.01 * MODULUS**2 * 0.6))**0.2
        found = np.loadtxt(run.path / "check.txt")[-1]
        self.assertAlmostEqual(found[0] / (1e-5 / rayleigh), 1, delta=1e-3)
        self.assertAlmostEqual(found[1] / (1e-5 / hertz), 1, delta=1e-3)
        self.assertIn("rayleigh time", run.screen)

    def test_computes_of_the_host(self):
        """What other commands show of a contact is what the host's spheres show."""
        commands = ("compute forces all pair/gran/local id force torque\ncompute touching all contact/atom\n"
                    "compute touching_too all contact/atom/gran\n"
                    "compute stress all stress/atom\ncompute heat all temp\ncompute push all pressure heat\ncompute potential all pe\n"
                    "dump l all local 50 local.dump c_forces[1] c_forces[2] c_forces[4] c_forces[5] c_forces[6] "
                    "c_forces[7] c_forces[8] c_forces[9]\n"
                    'dump_modify l format "%.10g %.10g %.10g %.10g %.10g %.10g %.10g %.10g"\n'
                    "dump s all custom 50 stress.dump id c_touching c_touching_too c_stress[1] c_stress[2] c_stress[4]\n"
                    'dump_modify s sort id format "%d %.10g %.10g %.10g %.10g %.10g"\n'
                    "thermo_style custom step c_potential c_push c_heat\nthermo 50")
        scene = Scene(PAIR, "hertz tangential history rolling_friction epsd2", steps=100, every=50, commands=commands)
        host, ours = scene.run("sphere"), scene.run("nurbs")

        def local(run):
            rows = [line.split() for line in run.read("local.dump").splitlines()]
            rows = [np.array(list(map(float, row))) for row in rows if len(row) == 8]
            # Where the host lists the pair the other way, its force is that on the other particle.
            return np.array([row if row[0] < row[1] else np.r_[row[1], row[0], -row[2:5], row[5:]] for row in rows])

        self.assertEqual(local(ours).shape, local(host).shape)
        self.assertGreater(len(local(ours)), 0)
        np.testing.assert_allclose(local(ours)[0, :5], local(host)[0, :5], rtol=1e-7)
        # Later the host asks its models again, with velocities of the end of the step; here are the forces that acted.
        np.testing.assert_allclose(local(ours)[:, :5], local(host)[:, :5], rtol=2e-2)
        np.testing.assert_allclose(local(ours)[:, 2], [frame["fx"][0] for _, frame in ours.frames], rtol=1e-7)
        for (_, a), (_, b) in zip(ours.dump("stress.dump"), host.dump("stress.dump"), strict=True):
            for name in b:
                np.testing.assert_allclose(a[name], b[name], rtol=1e-7, atol=1e-14, err_msg=name)
        np.testing.assert_allclose(ours.thermo["heat"], host.thermo["heat"], rtol=1e-9)
        np.testing.assert_allclose(ours.thermo["push"], host.thermo["push"], rtol=1e-7)
        self.assertGreater(ours.thermo["potentia"].max(), 0)  # the host's own models show none


class BadInput(unittest.TestCase):

    def expect(self, text, files, *parts):
        run = deck.run(text, files=files)
        self.assertNotEqual(run.status, 0)
        self.assertEqual(len(run.errors), 1, run.screen)
        for part in parts:
            self.assertIn(part, run.errors[0])

    def test_words(self):
        good, files = bodies_deck([Body(1, (0, 0, 0))], [models.ellipsoid(1.0, 1.0, 1.0)], "hertz tangential history")
        style = "pair_style gran/nurbs tolerance 1e-12  model hertz tangential history"
        self.assertIn(style, good)
        for words, parts in {
                "model hertzz": ("model hertzz must be one of", "hertz/stiffness"),
                "model": ("model", "must be one of"),
                "tangential history model hertz": ("model NORMAL must stand before tangential", ),
                "model hertz tangential histroy": ("tangential histroy must be one of off history", ),
                "model hertz cohesion sjkr tangential history": ("tangential is out of order", ),
                "model hertz cohesion washino/capillary/viscous": ("washino/capillary/viscous can't be used", ),
                "model hertz cohesion easo/capillary/viscous": ("easo/capillary/viscous can't be used", ),
                "model hertz rolling_friction epsd9": ("rolling_friction epsd9 must be one of", ),
                "model hertz tangential tan_luding": ("need model luding", ),
                "model hertz surface multicontact": ("surface multicontact can't be used", ),
                "model hertz surface superquadric": ("surface superquadric can't be used", ),
                "model hertz computeElasticPotential on": ("computeElasticPotential can't be used", ),
                "model hertz heating_normal_hertz on": ("heating_normal_hertz can't be used", ),
                "model hertz tangential_damping maybe": ("tangential_damping", "maybe"),
                "model hertz tangential_damping": ("tangential_damping needs a value", ),
                "model hertz nonsense on": ("nonsense", ),
                "model edinburgh": ("fixKc on", ),
                "radius large model hertz": ("radius large must be curvature or volume", ),
                "radius volume": ("must begin with model", ),
        }.items():
            with self.subTest(words):
                self.expect(good.replace(style, "pair_style gran/nurbs " + words), files, "Pair style gran/nurbs", *parts)

    def test_the_wall_and_the_materials(self):
        good, files = bodies_deck([Body(1, (0, 0, 0.05))], [models.ellipsoid(1.0, 1.0, 1.0)], "hertz tangential history",
                                  floor=True)
        wall = "type 1  model hertz tangential history"
        self.assertIn(wall, good)
        for words, parts in {"model hertz": ("type T", ), "type 3 model hertz": ("type = 3", "[1, 1]"),
                             "type 1 model hurtz": ("model hurtz", ), "type 1": ("must begin with model", ), "type 1 kn 1e5 kt 1e5 mu 0": ("stands without a type", ),
                             "type x model hertz": ("type = x", )}.items():
            with self.subTest(words):
                self.expect(good.replace(wall, words), files, "Fix wall/nurbs", *parts)
        for name in ("youngsModulus", "coefficientRestitution", "coefficientFriction"):
            with self.subTest(name):
                lines = [line for line in good.splitlines() if name + " " not in line]
                self.expect("\n".join(lines) + "\n", files, name)
        lines = [line.replace(line.split()[-1], "-0.5") if "coefficientFriction " in line else line for line in good.splitlines()]
        self.expect("\n".join(lines) + "\n", files, "coefficientFriction of types 1 1 = -0.5", ">= 0")
        lines = [line.replace("peratomtype 5000000.0", "peratomtype -5e6") for line in good.splitlines()]
        self.expect("soft_particles yes\n" + "\n".join(lines) + "\n", files, "youngsModulus of type 1 = -5000000 must be > 0")
        self.expect(good.replace("pair_coeff * *", "pair_coeff * * kn 1 kt 1 mu 0"), files, "fix property/global")
        self.expect(good.replace(" model hertz tangential history\npair", "\npair", 1), files, "Pair coeff * *", "kn KN")

    def test_what_takes_bodies_for_spheres(self):
        good, files = bodies_deck([Body(1, (0, 0, 0))], [models.ellipsoid(1.0, 1.0, 1.0)], "hertz tangential history")
        for fix in ("fix x all multicontact/halfspace", "fix x all heat/gran initial_temperature 300"):
            with self.subTest(fix):
                self.expect(good.replace("run 0", fix + "\nrun 0"), files, fix.split()[3].split("/")[0])


if __name__ == "__main__":
    unittest.main()
