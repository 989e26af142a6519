#!/usr/bin/python3
"""No length, time or mass is built in: a scene in other units is the same scene."""
import pathlib
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck
import meshes

SHAPES = {"pebble.json": deck.ROOT / "examples/shapes/pebble.json", "tablet.json": deck.ROOT / "examples/shapes/tablet.json",
          "box.json": deck.box_shape(0.5, 0.6, 0.7), "blocky.json": deck.ROOT / "examples/shapes/blocky.json"}
SCALES = (0.5, 0.5, 0.75, 0.375)  # to about the same size
LAWS = ("linear", "hertz")
STEPS = 250
COLUMNS = {"": (1, 0, 0), "v": (1, 0, -1), "omega": (0, 0, -1), "f": (1, 1, -2), "tq": (2, 1, -2)}  # powers of length, mass, time


def hills(length):
    """STL text of a floor of 32 triangles that is not flat."""
    at = np.linspace(-4, 4, 5)
    points = np.array([(x, y, 0.125 * ((3 * i + j) % 4)) for i, x in enumerate(at) for j, y in enumerate(at)]) * length
    corners = [(5 * i + j, 5 * i + j + 5, 5 * i + j + 6, 5 * i + j + 1) for i in range(4) for j in range(4)]
    return meshes.ascii_stl(points, meshes.halves(corners))


def scene(law, floor, length=1.0, mass=1.0, time=1.0, units="si", ranks=1):
    """Bodies thrown on each other, a floor and into a tube; what they do, in metres, kilograms and seconds."""
    random = np.random.default_rng(5)
    atoms, velocities = [], []
    for k in range(18):
        turn = random.normal(size=4)
        place = np.array([1.15 * (k % 3 - 1), 1.15 * (k // 3 % 3 - 1), 1.1 + 1.2 * (k // 9)]) + random.integers(-16, 17, size=3) / 512
        atoms.append((k + 1, 1, 1 + k % 4, SCALES[k % 4] * length, 2500.0 * mass / length**3, *(place * length).tolist(),
                      *(turn / np.linalg.norm(turn)).tolist()))
        velocity = (random.normal(size=3) - [0, 0, 2]) * length / time
        velocities.append((k + 1, *velocity.tolist(), *(random.normal(size=3) / time).tolist()))
    pressure = mass / length / time**2
    if law == "hertz":
        materials = (f"youngsModulus peratomtype {5e6 * pressure!r}", "poissonsRatio peratomtype 0.3",
                     "coefficientRestitution peratomtypepair 1 0.5", "coefficientFriction peratomtypepair 1 0.5",
                     "coefficientRollingFriction peratomtypepair 1 0.1", f"cohesionEnergyDensity peratomtypepair 1 {2e4 * pressure!r}")
        model = "model hertz tangential history cohesion sjkr2 rolling_friction epsd2"
        pair, wall = "", f"type 1 {model}"
    else:
        materials, model = (), ""
        stiffness, damping = mass / time**2, mass / time
        pair = wall = f"kn {1e6 * stiffness!r} kt {5e5 * stiffness!r} cn {1e3 * damping!r} ct {5e2 * damping!r} mu 0.4"
    floor_lines = {"plane": f"fix floor all wall/nurbs plane 0 0 0 0 0 1 {wall}",
                   "mesh": f"fix mesh all mesh/surface file hills.stl type 1\nfix floor all wall/nurbs mesh mesh {wall}"}[floor]
    text = "\n".join([
        f"units {units}", "soft_particles yes", "hard_particles yes", f"atom_style nurbs {' '.join(SHAPES)}", "boundary f f f",
        "newton off", "communicate single vel yes", "read_data in.data", f"neighbor {0.25 * length!r} bin", "neigh_modify delay 0",
        *(f"fix m{k} all property/global {words}" for k, words in enumerate(materials)),
        f"pair_style gran/nurbs {model}", f"pair_coeff * * {pair}", floor_lines,
        f"fix tube all wall/nurbs cylinder z {1.75 * length!r} 0 0 {wall}",
        f"fix gravity all gravity {9.81 * length / time**2!r} vector 0 0 -1", "fix motion all nve/nurbs", f"timestep {1e-4 * time!r}",
        "compute s all nurbs/stats", "compute q all nurbs/atom qw qx qy qz", "thermo_style custom step c_s[8] c_s[10]", "thermo 50",
        "thermo_modify lost error",
        f"dump d all custom {STEPS} out.dump id x y z vx vy vz omegax omegay omegaz fx fy fz tqx tqy tqz c_q[1] c_q[2] c_q[3] c_q[4]",
        'dump_modify d format "%d' + " %.17g" * 19 + '"', f"run {STEPS}", ""])
    box = ((-6 * length, 6 * length), (-6 * length, 6 * length), (-6 * length, 12 * length))
    result = deck.run_ok(text, ranks=ranks, files={**SHAPES, "in.data": deck.data_file(atoms, velocities, box), "hills.stl": hills(length)})
    frame = result.dump("out.dump")[-1][1]
    for name, (of_length, of_mass, of_time) in COLUMNS.items():
        for axis in "xyz":
            frame[name + axis] /= length**of_length * mass**of_mass * time**of_time
    return frame, result.thermo


class Units(unittest.TestCase):
    def test_powers_of_two_give_the_same_bits(self):
        """They are exact in floating point, so that any length, stiffness or time in our code would show."""
        for law in LAWS:
            for floor, scales in (("plane", ((2.0**-30, 2.0**-90, 2.0**-30), (2.0**20, 1.0, 2.0**5))),
                                  ("mesh", ((2.0**-14, 2.0**-44, 2.0**-4), ))):
                one, thermo = scene(law, floor)
                self.assertGreater(thermo["s[8]"].max(), 10)  # contacts
                self.assertEqual(thermo["s[10]"].max(), 0)    # unresolved
                for length, mass, time in scales:
                    with self.subTest(law=law, floor=floor, length=length):
                        other, _ = scene(law, floor, length, mass, time)
                        for name in one:
                            np.testing.assert_array_equal(other[name], one[name], name)

    def test_cgs(self):
        for law in LAWS:
            one, other = scene(law, "mesh")[0], scene(law, "mesh", 100.0, 1000.0, 1.0, "cgs", ranks=2)[0]
            for name in one:
                np.testing.assert_allclose(other[name], one[name], rtol=0, atol=1e-6 * np.abs(one[name]).max(), err_msg=name)


if __name__ == "__main__":
    unittest.main()
