#!/usr/bin/python3
"""atom_style nurbs, fix nve/nurbs and their computes in the host: data files, restarts, ranks, errors."""
import pathlib
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck

BOX = (0.1, 0.2, 0.3)  # half edges: an asymmetric top with closed-form inertia
OTHER = (0.3, 0.25, 0.2)
SHAPES = {"brick.json": deck.box_shape(*BOX), "slab.json": deck.box_shape(*OTHER)}

ATOMS = [(1, 1, 1, 1.0, 1000.0, -8.9, 0.5, 0.25, 1.0, 0.0, 0.0, 0.0),
         (2, 1, 2, 0.5, 2000.0, 3.0, 1.0, 2.0, 0.5, 0.1, -0.2, 0.3),
         (7, 1, 1, 1 / 3, 2650.0, 4.1, -7.5, 9.25, 0.1, 0.9, 0.2, -0.7)]
VELOCITIES = [(1, -20.0, 3.0, 1.0, 1e-3, 9.0, 1e-3), (2, -1.0, 2.0, 5.0, 1.0, -2.0, 3.0),
              (7, 7.0, -30.0, 11.0, 4.0, 5.0, -6.0)]

# The host wants atom sorting off and a cutoff for ghosts when there is no pair style.
HEADER = """
units si
atom_style nurbs brick.json slab.json
atom_modify map array sort 0 0
boundary p p p
newton off
communicate single vel yes cutoff 2
"""
MOTION = """
neighbor 0.1 bin
neigh_modify delay 0
fix move all nve/nurbs {fix}
compute rot all erotate/nurbs
compute body all nurbs/atom qw qx qy qz shape scale volume mass
thermo_style custom step atoms ke c_rot
thermo_modify norm no
thermo 20
timestep 0.002
dump d all custom {every} dump.txt id x y z vx vy vz omegax omegay omegaz c_body[1] c_body[2] c_body[3] c_body[4] &
  c_body[5] c_body[6] c_body[7] c_body[8] radius density mass
dump_modify d format "%d{format}"
"""
MOTION = MOTION.replace("{format}", " %.17g" * 20)


def motion(fix="", every=20):
    return MOTION.replace("{fix}", fix).replace("{every}", str(every))


def files(atoms=ATOMS, velocities=VELOCITIES, **more):
    return {**SHAPES, "in.data": deck.data_file(atoms, velocities), **more}


def rotation_matrix(q):
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def quaternion(frame, i):
    return np.array([frame[f"c_body[{k}]"][i] for k in (1, 2, 3, 4)])


def angular_momentum(frame, i, half_edges):
    """Of atom i, a box of these half edges, in lab axes."""
    square = np.array(half_edges) ** 2 * frame["c_body[6]"][i] ** 2
    inertia = frame["c_body[8]"][i] / 3 * (square.sum() - square)
    turn = rotation_matrix(quaternion(frame, i))
    omega = np.array([frame[name][i] for name in ("omegax", "omegay", "omegaz")])
    return turn @ (inertia * (turn.T @ omega))


class PerAtomValues(unittest.TestCase):
    def test_mass_radius_volume_follow_shape_scale_density(self):
        _, frame = deck.run_ok(HEADER + "read_data in.data\n" + motion() + "run 0\n", files=files()).dump("dump.txt")[0]
        for i, atom in enumerate(ATOMS):
            half, scale, density = np.array((BOX, OTHER)[atom[2] - 1]), atom[3], atom[4]
            volume = 8 * half.prod() * scale**3
            self.assertAlmostEqual(frame["c_body[7]"][i] / volume, 1, 13)
            self.assertAlmostEqual(frame["c_body[8]"][i] / (density * volume), 1, 13)
            self.assertAlmostEqual(frame["mass"][i] / (density * volume), 1, 13)
            # The bounding sphere holds the corners and wastes little.
            corner = np.linalg.norm(half) * scale
            self.assertGreaterEqual(frame["radius"][i], corner * (1 - 1e-14))
            self.assertLess(frame["radius"][i], corner * (1 + 1e-6))
            self.assertEqual(frame["c_body[5]"][i], atom[2])
            self.assertEqual(frame["c_body[6]"][i], scale)
            q = np.array(atom[8:12])
            np.testing.assert_allclose(quaternion(frame, i), q / np.linalg.norm(q), rtol=1e-15, atol=1e-16)

    def test_rotational_energy(self):
        run = deck.run_ok(HEADER + "read_data in.data\n" + motion() + "thermo_modify format 4 %.15g\nrun 0\n",
                          files=files())
        _, frame = run.dump("dump.txt")[0]
        energy = 0
        for i, atom in enumerate(ATOMS):
            omega = np.array(VELOCITIES[i][4:7])
            energy += 0.5 * omega @ angular_momentum(frame, i, (BOX, OTHER)[atom[2] - 1])
        self.assertAlmostEqual(run.thermo["rot"][0] / energy, 1, 12)

    def test_single_column_is_a_vector(self):
        text = (HEADER + "read_data in.data\ncompute s all nurbs/atom shape\ncompute t all reduce sum c_s\n"
                "thermo_style custom step c_t\nfix move all nve/nurbs\nrun 0\n")
        self.assertEqual(deck.run_ok(text, files=files()).thermo["t"][0], 4)

    def test_create_atoms_and_set(self):
        text = (HEADER + "region all block -10 10 -10 10 -10 10\ncreate_box 1 all\n"
                "create_atoms 1 single 1 2 3\ncreate_atoms 1 single 4 5 6\ncreate_atoms 1 single -4 5 6\n"
                "create_atoms 1 single 0 0 0\nset atom 2 density 500\nset atom 3 diameter 2\nset atom 4 mass 96\n"
                "set atom 2 omegax 3\n"
                # Host words before ours, in one command.
                "create_atoms 1 single 7 7 0\nset atom 5 diameter 2 density 500 vx 1\n"
                "create_atoms 1 single -7 7 0\nset atom 6 type 1 mass 96 quat 1 0 0 0 diameter 2\n" + motion() + "run 0\n")
        _, frame = deck.run_ok(text, files=files()).dump("dump.txt")[0]
        radius = np.linalg.norm(BOX)
        np.testing.assert_allclose(frame["radius"], [radius, radius, 1, radius, 1, 1], rtol=1e-6)
        scale = frame["c_body[6]"]
        np.testing.assert_allclose(scale, [1, 1, 1 / radius, 1, 1 / radius, 1 / radius], rtol=1e-6)
        np.testing.assert_allclose(frame["density"], [1, 500, 1, 2000, 500, 2000], rtol=1e-12)
        np.testing.assert_allclose(frame["mass"], frame["density"] * 0.048 * scale**3, rtol=1e-12)
        np.testing.assert_array_equal(frame["c_body[1]"], 1)
        np.testing.assert_array_equal(frame["omegax"], [0, 3, 0, 0, 0, 0])


class FreeMotion(unittest.TestCase):
    def check_free_rotation(self, scheme):
        """An asymmetric top near its unstable axis turns over many times; L keeps to round-off."""
        atoms = [(1, 1, 1, 1.0, 1000.0, 0.0, 0.0, 0.0, 0.5, -0.5, 0.1, 0.7)]
        text = (HEADER + "read_data in.data\n" + motion(f"rotation {scheme}", 100) + "thermo_modify format 4 %.15g\n"
                "run 5000\n")
        run = deck.run_ok(text, files=files(atoms, [(1, 1.0, 2.0, 3.0, 5.0, 30.0, 1e-2)]))
        frames = [frame for _, frame in run.dump("dump.txt")]
        momenta = np.array([angular_momentum(frame, 0, BOX) for frame in frames])
        drift = np.abs(momenta - momenta[0]).max() / np.linalg.norm(momenta[0])
        self.assertLess(drift, 1e-14)  # L itself stays the same bits; this is the dump's and this test's rounding
        for frame in frames:
            self.assertAlmostEqual(np.linalg.norm(quaternion(frame, 0)), 1, 13)
        turned = [rotation_matrix(quaternion(frame, 0)) for frame in frames]
        self.assertGreater(np.abs(turned[0] - turned[-1]).max(), 0.1)
        energy = run.thermo["rot"]
        return np.abs(energy / energy[0] - 1).max()

    def test_symplectic(self):
        self.assertLess(self.check_free_rotation("symplectic"), 2e-3)

    def test_richardson(self):
        self.assertLess(self.check_free_rotation("richardson"), 2e-2)

    def test_exact(self):
        self.assertLess(self.check_free_rotation("exact"), 1e-11)

    def test_free_flight_and_gravity(self):
        text = (HEADER + "read_data in.data\n" + motion() + "fix g all gravity 9.81 vector 0 0 -1\n"
                "run 100\n")
        atoms = [ATOMS[1]]
        run = deck.run_ok(text, files=files(atoms, [VELOCITIES[1]]))
        frames = run.dump("dump.txt")
        t = 100 * 0.002
        final = frames[-1][1]
        np.testing.assert_allclose([final["x"][0], final["y"][0], final["z"][0]],
                                   [3 - t, 1 + 2 * t, 2 + 5 * t - 0.5 * 9.81 * t * t], rtol=1e-12)
        np.testing.assert_allclose(final["vz"][0], 5 - 9.81 * t, rtol=1e-12)

    def test_velocity_command(self):
        text = HEADER + "read_data in.data\nvelocity all set 1 2 3\n" + motion() + "run 0\n"
        _, frame = deck.run_ok(text, files=files()).dump("dump.txt")[0]
        np.testing.assert_array_equal(frame["vy"], 2)

    def test_same_trajectory_on_1_2_4_ranks(self):
        """The particles cross rank and periodic boundaries; without contacts every bit agrees."""
        text = HEADER + "read_data in.data\n" + motion() + "run 400\n"
        frames = [deck.run_ok(text, ranks=n, files=files()).dump("dump.txt") for n in (1, 2, 4)]
        self.assertEqual(len(frames[0]), 21)
        for other in frames[1:]:
            for (step, a), (_, b) in zip(frames[0], other):
                for name in a:
                    np.testing.assert_array_equal(a[name], b[name], f"{name} at step {step}")


class Momentum(unittest.TestCase):
    """A free particle keeps its angular momentum; what a command sets between steps counts."""
    ATOM = [(1, 1, 1, 1.0, 1000.0, 0.123, -0.456, 0.789, 0.5, -0.5, 0.1, 0.7)]
    AT_REST = [(1, 0.0, 0.0, 0.0, 5.0, 30.0, 1e-2)]

    def run_deck(self, commands):
        text = HEADER + "read_data in.data\n" + motion(every=1) + commands
        return deck.run_ok(text, files=files(self.ATOM, self.AT_REST))

    def kept(self, run, name):
        """The bytes of the angular momentum in a restart file: seven numbers after the position."""
        data = (run.path / name).read_bytes()
        at = data.index(np.array(self.ATOM[0][5:8]).tobytes())
        return data[at + 7 * 8:at + 10 * 8]

    def test_is_kept_to_the_last_bit(self):
        for scheme in ("symplectic", "richardson", "exact"):
            text = HEADER + "read_data in.data\n" + motion(f"rotation {scheme}", 5000)
            text += "write_restart a.restart\nrun 5000\nwrite_restart b.restart\nrun 0\nwrite_restart c.restart\n"
            run = deck.run_ok(text, files=files(self.ATOM, self.AT_REST))
            first = self.kept(run, "a.restart")
            self.assertEqual([self.kept(run, name) for name in ("b.restart", "c.restart")], [first, first])
            momentum = angular_momentum(run.dump("dump.txt")[-1][1], 0, BOX)
            np.testing.assert_allclose(np.frombuffer(first), momentum, rtol=0, atol=1e-14 * np.linalg.norm(momentum))

    def test_omega_set_between_runs(self):
        run = self.run_deck("run 30\nset atom 1 omegax 3\nset atom 1 omegay -20\nset atom 1 omegaz 1\nrun 30\n")
        frames = [frame for _, frame in run.dump("dump.txt")]
        momenta = np.array([angular_momentum(frame, 0, BOX) for frame in frames])
        before, after = momenta[:31], momenta[-30:]
        expected = dict(frames[30], omegax=[3], omegay=[-20], omegaz=[1])
        expected = angular_momentum(expected, 0, BOX)
        np.testing.assert_allclose(before, np.tile(before[0], (31, 1)), rtol=0, atol=1e-14 * np.linalg.norm(before[0]))
        np.testing.assert_allclose(after, np.tile(expected, (30, 1)), rtol=0, atol=1e-14 * np.linalg.norm(expected))

    def test_omega_set_within_a_run(self):
        """`run every` gives its command between steps, without a new start. Stopped, the particle stays."""
        stop = "".join(f'"set atom 1 omega{axis} 0" ' for axis in "xyz")
        run = self.run_deck(f"run 40 every 10 {stop}\n")
        frames = dict(run.dump("dump.txt"))
        self.assertGreater(np.abs(quaternion(frames[10], 0) - quaternion(frames[0], 0)).max(), 0.1)
        for step in (11, 20, 40):
            np.testing.assert_array_equal(quaternion(frames[step], 0), quaternion(frames[10], 0))
            np.testing.assert_array_equal(frames[step]["omegay"], 0)

    def test_mass_or_size_set_between_runs(self):
        """Omega stays, so that the momentum changes with the inertia."""
        for command, factor in (("density 500", 0.5), (f"diameter {4 * np.linalg.norm(BOX):.17g}", 32)):
            run = self.run_deck(f"run 30\nset atom 1 {command}\nrun 1\n")
            frames = [frame for _, frame in run.dump("dump.txt")]
            before, after = (angular_momentum(frames[k], 0, BOX) for k in (30, -1))
            np.testing.assert_allclose(after, factor * before, rtol=0, atol=1e-5 * np.linalg.norm(after))


class Files(unittest.TestCase):
    def section(self, text, name):
        lines = text.split(name + "\n\n")[1].split("\n\n")[0].splitlines()
        return sorted(lines, key=lambda line: int(line.split()[0]))

    def test_data_file_round_trip(self):
        """What write_data wrote reads back to the same bits, on other rank counts too."""
        first = deck.run_ok(HEADER + "read_data in.data\n" + motion() + "run 37\nwrite_data out.data\n", files=files())
        written = first.read("out.data")
        for ranks in (1, 2):
            again = deck.run_ok(HEADER + "read_data in.data\n" + motion() + "run 0\nwrite_data out.data\n", ranks=ranks,
                                files={**SHAPES, "in.data": written}).read("out.data")
            for name in ("Atoms", "Velocities"):
                self.assertEqual(self.section(again, name), self.section(written, name))
        self.assertEqual(len(self.section(written, "Atoms")), 3)

    def test_restart_carries_the_shapes(self):
        """A run split by a restart, read without shape files and on more ranks, gives the unsplit run's bits."""
        whole = deck.run_ok(HEADER + "read_data in.data\n" + motion() + "run 200\n", files=files())
        half = deck.run_ok(HEADER + "read_data in.data\n" + motion() + "run 100\nwrite_restart half.restart\n",
                           files=files())
        restart = half.path / "half.restart"
        for ranks in (1, 2, 4):
            text = ("units si\natom_modify map array sort 0 0\nnewton off\ncommunicate single vel yes cutoff 2\n"
                    "read_restart half.restart\n" + motion() + "run 100\nwrite_data out.data\n")
            again = deck.run_ok(text, ranks=ranks, files={"half.restart": restart})
            step, expected = whole.dump("dump.txt")[-1]
            found_step, found = again.dump("dump.txt")[-1]
            self.assertEqual((step, found_step), (200, 200))
            for name in expected:
                np.testing.assert_array_equal(expected[name], found[name], name)

    def test_shapes_are_read_by_rank_0_alone_and_named_by_stem(self):
        run = deck.run(HEADER.replace("slab.json", "sub/brick.json") + "read_data in.data\n" + motion() + "run 0\n",
                       files=files())
        self.assertNotEqual(run.status, 0)
        self.assertIn("Cannot read shape file sub/brick.json", run.screen)


class PreloadedStyles(unittest.TestCase):
    def test_stock_program_with_preload(self):
        text = HEADER + "read_data in.data\n" + motion() + "run 20\n"
        ours = deck.run_ok(text, files=files()).dump("dump.txt")[-1][1]
        stock = deck.run_ok(text, files=files(), program="/usr/bin/liggghts",
                            env={"LD_PRELOAD": str(deck.BUILD / "libliggghts_nurbs.so")}).dump("dump.txt")[-1][1]
        for name in ours:
            np.testing.assert_array_equal(ours[name], stock[name])

    def test_other_atom_styles_still_work(self):
        text = ("units si\natom_style sphere\natom_modify map array sort 0 0\nboundary p p p\n"
                "communicate single vel yes cutoff 2\nregion all block -1 1 -1 1 -1 1\ncreate_box 1 all\n"
                "create_atoms 1 single 0 0 0\nset atom 1 diameter 0.1 density 1000\nfix move all nve/sphere\n"
                "dump d all custom 1 dump.txt id x\nrun 1\n")
        self.assertEqual(len(deck.run_ok(text).dump("dump.txt")), 2)


class BadInput(unittest.TestCase):
    """Each ends with a one-line ERROR and a non-zero exit status; one of each kind of error on 2 ranks too."""

    def refuse(self, text, *expected, on=(1,), **options):
        for ranks in on:
            run = deck.run(text, ranks=ranks, **options)
            self.assertNotEqual(run.status, 0, run.screen)
            lines = [line for line in run.errors if line.startswith("ERROR: ")]
            self.assertTrue(lines, run.screen)
            for words in expected:
                self.assertIn(words, lines[0])

    def refuse_atom(self, changes, *expected, on=(1,)):
        atom = list(ATOMS[1])
        for column, value in changes.items():
            atom[column] = value
        self.refuse(HEADER + "read_data in.data\n", *expected, on=on, files=files([ATOMS[0], tuple(atom)], []))

    def test_shape_number(self):
        self.refuse_atom({2: 3}, "Atom 2", "shape 3", "1 to 2", on=(1, 2, 4))
        self.refuse_atom({2: 0}, "Atom 2", "shape 0", "1 to 2")
        self.refuse_atom({2: "1.5"}, "Atom 2", "shape 1.5", "1 to 2")

    def test_type(self):
        self.refuse_atom({1: 2}, "Atom 2", "type 2", "1 to 1")

    def test_scale(self):
        self.refuse_atom({3: 0.0}, "Atom 2", "scale 0.0", "> 0")
        self.refuse_atom({3: -1.0}, "Atom 2", "scale -1.0", "> 0")
        self.refuse_atom({3: "nan"}, "Atom 2", "scale nan", "> 0")

    def test_density(self):
        self.refuse_atom({4: 0.0}, "Atom 2", "density 0.0", "> 0")
        self.refuse_atom({4: "inf"}, "Atom 2", "density inf", "> 0")

    def test_quaternion(self):
        self.refuse_atom({8: 0.0, 9: 0.0, 10: 0.0, 11: 0.0}, "Atom 2", "quaternion 0 0 0 0", "> 0")
        self.refuse_atom({9: "nan"}, "Atom 2", "quaternion component nan", "number")
        self.refuse_atom({9: "1x"}, "Atom 2", "quaternion component 1x", "number")

    def test_velocity(self):
        self.refuse(HEADER + "read_data in.data\n", "Atom 2", "nan",
                    files=files(velocities=[VELOCITIES[0], (2, 0.0, 0.0, "nan", 0.0, 0.0, 0.0), VELOCITIES[2]]))

        # A line cut short; the host counts the first alone.
        self.refuse(HEADER + "read_data in.data\n", "Velocities section", "there must be 6", on=(1, 2),
                    files=files(velocities=[VELOCITIES[0], VELOCITIES[1][:-1], VELOCITIES[2]]))
        self.refuse(HEADER + "read_data in.data\n", "Velocities section", "5 values", "there must be 6", on=(1, 2),
                    files=files(velocities=[VELOCITIES[0], VELOCITIES[1], VELOCITIES[2][:-1]]))

    def test_id_there_twice(self):
        twin = (2,) + tuple(ATOMS[0][1:5]) + tuple(x + 0.5 for x in ATOMS[0][5:8]) + tuple(ATOMS[0][8:])
        motion = "pair_style gran/nurbs\npair_coeff * * kn 1e6 kt 1e6 mu 0.3\nfix m all nve/nurbs\nrun 0\n"
        self.refuse(HEADER + "read_data in.data\n" + motion, "Atom 2", "id 2 is there twice", on=(1, 2, 4),
                    files=files([ATOMS[0], ATOMS[1], twin], []))

    def test_mass_out_of_range(self):
        for scale, density in (("1e-320", 1000.0), ("1e150", 1000.0), (0.1, "1e-310")):
            self.refuse_atom({3: scale, 4: density}, "Atom 2", "scale", "density", "give a mass of")
        self.refuse(HEADER + "read_data in.data\nset atom 2 nurbs/scale 1e-110\nfix m all nve/nurbs\nrun 0\n",
                    "Atom 2", "scale 1e-110", "give a mass of 0", on=(1, 2), files=files())

    def test_long_quaternion_is_normalised(self):
        atom = tuple(ATOMS[1][:8]) + (0.0, 3e200, 0.0, 4e200)
        text = HEADER + "read_data in.data\nfix m all nve/nurbs\ncompute b all nurbs/atom qw qx qy qz\n" \
            "dump d all custom 1 dump.txt id c_b[1] c_b[2] c_b[3] c_b[4]\nrun 0\n"
        frame = deck.run_ok(text, files=files([ATOMS[0], atom], [])).dump("dump.txt")[-1][1]
        at = list(frame["id"]).index(2)
        np.testing.assert_allclose([frame[f"c_b[{k}]"][at] for k in (1, 2, 3, 4)], [0, 0.6, 0, 0.8], atol=1e-12)

    def test_position_that_is_no_number(self):
        self.refuse_atom({6: "nan"}, "Atom 2", "coordinate nan", "number")

    def test_wrong_number_of_columns(self):
        self.refuse(HEADER + "read_data in.data\n", "Incorrect atom format", files=files([ATOMS[0][:-1]], []))

    def test_atom_style_without_files(self):
        self.refuse("units si\natom_style nurbs\n", "at least one shape file")

    def test_errors_of_the_host_reach_a_pipe(self):
        """Those of one rank end the program without a flush."""
        for ranks in (1, 2):
            run = deck.run("units si\ninclude absent.in\n", ranks=ranks)
            self.assertNotEqual(run.status, 0)
            self.assertTrue(any("Cannot open input script absent.in" in line for line in run.errors), run.screen)

    def test_missing_file(self):
        self.refuse("units si\natom_style nurbs brick.json absent.json\n", "absent.json", on=(1, 2, 4), files=SHAPES)

    def test_directory_as_file(self):
        self.refuse("units si\natom_style nurbs ..\n", "Cannot read shape file ..")

    def test_bad_shape_names_the_file(self):
        self.refuse("units si\natom_style nurbs bad.json\n", "bad.json", on=(1, 2), files={"bad.json": "{"})

    def test_hybrid(self):
        self.refuse("units si\natom_style hybrid nurbs brick.json sphere\n", "hybrid", files=SHAPES)

    def test_two_dimensions(self):
        self.refuse(HEADER.replace("units si", "units si\ndimension 2") + "read_data in.data\nfix m all nve/nurbs\nrun 0\n",
                    "3d", files={**SHAPES, "in.data": deck.data_file([(1, 1, 1, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)])})

    def test_styles_without_the_atom_style(self):
        sphere = ("units si\natom_style nurbs brick.json\natom_style sphere\nregion all block -1 1 -1 1 -1 1\n"
                  "create_box 1 all\n")
        for command in ("fix m all nve/nurbs", "compute c all erotate/nurbs", "compute c all nurbs/atom qw"):
            self.refuse(sphere + command + "\n", "requires atom_style nurbs", files=SHAPES)

    def test_sphere_styles_refuse_the_particles(self):
        for command, instead in (("fix m all nve/sphere", "fix nve/nurbs"),
                                 ("compute c all erotate/sphere", "compute erotate/nurbs")):
            self.refuse(HEADER + "read_data in.data\n" + command + "\n",
                        "can't be used with atom_style nurbs; use " + instead, files=files())

    def test_arguments(self):
        for command, expected in (("fix m all nve/nurbs rotation euler", "euler must be symplectic, richardson or exact"),
                                  ("fix m all nve/nurbs rotation", "symplectic, richardson, exact"),
                                  ("fix m all nve/nurbs turn", "unknown keyword turn"),
                                  ("compute c all erotate/nurbs x", "takes no arguments"),
                                  ("compute c all nurbs/atom", "qw qx qy qz shape scale volume mass"),
                                  ("compute c all nurbs/atom q", "q must be one of")):
            self.refuse(HEADER + "read_data in.data\n" + command + "\n", expected, files=files())

    def test_insertion_of_spheres(self):
        """Insert fixes are refused before they insert; their templates are harmless."""
        templates = ("fix t all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.5\n"
                     "fix d all particledistribution/discrete 32452843 1 t 1.0\n")
        text = HEADER + "read_data in.data\natom_modify sort 0 0\n" + templates + "fix m all nve/nurbs\n"
        region = "region r block -1 1 -1 1 6 9 units box\n"
        for kind, options in (("pack", "insert_every once all_in yes particles_in_region 1 region r"),
                              ("rate/region", "nparticles 1 particlerate 100 insert_every 10 all_in yes region r")):
            insert = f"fix i all insert/{kind} seed 86028121 distributiontemplate d {options}\n"
            self.refuse(text + region + insert + "run 10\n", f"Fix insert/{kind} i: its template t is of particletemplate/sphere",
                        on=(1, 2), files=files())
        deck.run_ok(text + "run 1\n", files=files())

    def test_set_command_spoils_a_particle(self):
        self.refuse(HEADER + "read_data in.data\nset atom 2 diameter 0\nfix m all nve/nurbs\nrun 0\n", "Atom 2", "scale 0",
                    files=files())


if __name__ == "__main__":
    unittest.main()
