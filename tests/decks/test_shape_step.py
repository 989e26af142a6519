#!/usr/bin/python3
"""nurbs-shape import and export through CAD files: round trips, solids written here as STEP text, bad files."""
import math
import pathlib
import re
import tempfile
import unittest

import numpy as np

import deck
import test_shape_fit

call = deck.nurbs_shape


HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));
ENDSEC;
DATA;
"""


class Step:
    """The text of a STEP file (once) of solids with plane, cylindrical and spherical faces, bounded by lines and circles."""

    def __init__(self, unit="SI_UNIT(.MILLI.,.METRE.)"):
        self.lines, self.unit, self.solids = [], unit, []

    def add(self, text):
        self.lines.append(text)
        return f"#{len(self.lines)}"

    def triple(self, kind, x):
        return self.add(f"{kind}('',({','.join(f'{v:.16E}' for v in x)}))")

    def frame(self, at, z, x):
        return self.add(f"AXIS2_PLACEMENT_3D('',{self.triple('CARTESIAN_POINT', at)},{self.triple('DIRECTION', z)},"
                        f"{self.triple('DIRECTION', x)})")

    def vertex(self, x):
        return self.add(f"VERTEX_POINT('',{self.triple('CARTESIAN_POINT', x)})")

    def line(self, a, b, at, to):
        way = np.subtract(to, at)
        vector = self.add(f"VECTOR('',{self.triple('DIRECTION', way / np.linalg.norm(way))},1.)")
        curve = self.add(f"LINE('',{self.triple('CARTESIAN_POINT', at)},{vector})")
        return self.add(f"EDGE_CURVE('',{a},{b},{curve},.T.)")

    def circle(self, a, b, frame, radius):
        curve = self.add(f"CIRCLE('',{frame},{radius:.16E})")
        return self.add(f"EDGE_CURVE('',{a},{b},{curve},.T.)")

    def face(self, surface, loop, same=True):
        """`loop`: (edge, forward) pairs, counter-clockwise seen from outside."""
        edges = ",".join(self.add(f"ORIENTED_EDGE('',*,*,{edge},.{'FT'[way]}.)") for edge, way in loop)
        loop = self.add(f"EDGE_LOOP('',({edges}))")
        bound = self.add(f"FACE_OUTER_BOUND('',{loop},.T.)")
        return self.add(f"ADVANCED_FACE('',({bound}),{surface},.{'FT'[same]}.)")

    def solid(self, faces, name=""):
        shell = self.add(f"CLOSED_SHELL('',({','.join(faces)}))")
        self.solids.append(self.add(f"MANIFOLD_SOLID_BREP('{name}',{shell})"))

    def polyhedron(self, points, polygons, name=""):
        """Polygons counter-clockwise seen from outside."""
        vertices, edges, faces = [self.vertex(p) for p in points], {}, []
        for polygon in polygons:
            loop = []
            for i, j in zip(polygon, polygon[1:] + polygon[:1]):
                if (j, i) in edges:
                    loop.append((edges[j, i], False))
                else:
                    edges[i, j] = self.line(vertices[i], vertices[j], points[i], points[j])
                    loop.append((edges[i, j], True))
            a, b, c = (np.array(points[k]) for k in polygon[:3])
            plane = self.add(f"PLANE('',{self.frame(a, np.cross(b - a, c - b), b - a)})")
            faces.append(self.face(plane, loop))
        self.solid(faces, name)

    def cylinder(self, radius, height):
        z, x = (0, 0, 1), (1, 0, 0)
        ends = [(radius, 0, 0), (radius, 0, height)]
        low, high = (self.vertex(p) for p in ends)
        bottom, top = (self.frame((0, 0, h), z, x) for h in (0, height))
        rim0, rim1 = self.circle(low, low, bottom, radius), self.circle(high, high, top, radius)
        seam = self.line(low, high, *ends)
        side = self.add(f"CYLINDRICAL_SURFACE('',{bottom},{radius:.16E})")
        under = self.add(f"PLANE('',{self.frame((0, 0, 0), (0, 0, -1), x)})")
        self.solid([self.face(side, [(rim0, True), (seam, True), (rim1, False), (seam, False)]),
                    self.face(under, [(rim0, False)]), self.face(self.add(f"PLANE('',{top})"), [(rim1, True)])])

    def ball_cut_by(self, radius, height, upper=True):
        """The part z > height > 0 of a ball whose own axis is x, so that the cut is no line of its parameters; or the rest."""
        rim = math.sqrt(radius**2 - height**2)
        at = self.vertex((rim, 0, height))
        frame = self.frame((0, 0, height), (0, 0, 1), (1, 0, 0))
        edge = self.circle(at, at, frame, rim)
        ball = self.add(f"SPHERICAL_SURFACE('',{self.frame((0, 0, 0), (1, 0, 0), (0, 0, -1))},{radius:.16E})")
        plane = self.add(f"PLANE('',{self.frame((0, 0, height), (0, 0, -1 if upper else 1), (1, 0, 0))})")
        self.solid([self.face(ball, [(edge, upper)]), self.face(plane, [(edge, not upper)])])

    def text(self):
        context = self.add("APPLICATION_CONTEXT('')")
        kind = self.add(f"PRODUCT_CONTEXT('',{context},'')")
        product = self.add(f"PRODUCT('p','p','',({kind}))")
        version = self.add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
        view = self.add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{context},'design')")
        design = self.add(f"PRODUCT_DEFINITION('','',{version},{view})")
        shape = self.add(f"PRODUCT_DEFINITION_SHAPE('','',{design})")
        length = self.add(f"(LENGTH_UNIT()NAMED_UNIT(*){self.unit})")
        angle = self.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
        solid = self.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
        unsure = self.add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),{length},'','')")
        units = self.add("(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((" + unsure +
                         f"))GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid}))REPRESENTATION_CONTEXT('',''))")
        form = self.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({','.join(self.solids)}),{units})")
        self.add(f"SHAPE_DEFINITION_REPRESENTATION({shape},{form})")
        data = "".join(f"#{k + 1}={line};\n" for k, line in enumerate(self.lines))
        return HEAD + data + "ENDSEC;\nEND-ISO-10303-21;\n"


def prism(n, radius, height):
    turn = [2 * math.pi * k / n for k in range(n)]
    points = [(radius * math.cos(t), radius * math.sin(t), z) for z in (0, height) for t in turn]
    sides = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    return points, [list(range(n))[::-1], list(range(n, 2 * n)), *sides]


class ShapeStep(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.place = pathlib.Path(place.name)

    def good(self, *arguments):
        done = call(*arguments)
        self.assertEqual((done.returncode, done.stderr), (0, ""), done.stdout)
        return done.stdout

    def refused(self, words, *arguments):
        before = sorted(self.place.iterdir())
        done = call(*arguments)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertRegex(done.stderr, "^ERROR: [^\n]*" + words + "[^\n]*\n$")
        self.assertEqual(sorted(self.place.iterdir()), before)

    def write(self, name, step):
        (self.place / name).write_text(step.text())
        return self.place / name

    def volume(self, file):
        return float(re.search(r"volume +(\S+)", self.good("info", file)).group(1))

    def test_round_trips_keep_the_body(self):
        bodies = {"sphere --radius 5": 4 / 3 * math.pi * 125, "ellipsoid --axes 3,2,1": 8 * math.pi,
                  "box --axes 3,2,1": 48, "capsule --radius 2 --length 4": math.pi * 4 * (4 + 8 / 3),
                  "revolved --equatorial 4 --polar 3": 64 * math.pi, "tablet --radius 5 --height 4 --rim 1": None,
                  "rounded-box --axes 3,2,1 --rounding 0.4": None, "pebble --seed 7": None}
        for kind, volume in bodies.items():
            made, step, back = (self.place / name for name in ("made.json", "made.step", "back.json"))
            self.good("make", *kind.split(), "-o", made)
            self.good("export", made, "-o", step)
            self.assertIn("exact", self.good("import", step, "-o", back), kind)
            volume = volume or self.volume(made)
            self.assertAlmostEqual(self.volume(back) / volume, 1, delta=1e-10, msg=kind)
            points = [test_shape_fit.sample(f, 9)[0] for f in (made, back)] if kind.startswith("pebble") else None
            if points:  # the same surface, in whatever order the faces come
                off = max(np.linalg.norm(points[0] - p, axis=1).min() for p in points[1])
                self.assertLess(off, 1e-12)

    def test_solids_of_other_programs(self):
        step = Step()
        step.cylinder(5, 12)
        out = self.place / "out.json"
        self.assertIn("exact", self.good("import", self.write("cylinder.step", step), "-o", out))
        self.assertAlmostEqual(self.volume(out) / (300 * math.pi), 1, delta=1e-10)
        self.good("check", out)
        for n in (3, 5, 8):
            step = Step()
            step.polyhedron(*prism(n, 2.0, 3.0))
            self.assertIn("exact", self.good("import", self.write("prism.stp", step), "-o", out))
            volume = 0.5 * n * 4 * math.sin(2 * math.pi / n) * 3
            self.assertAlmostEqual(self.volume(out) / volume, 1, delta=1e-10)

    def test_solids_that_say_the_same_otherwise(self):
        """Files as Open CASCADE's modelling operations write them."""
        cases = {"extruded-ellipse": 24 * math.pi,  # both ends are one edge, in two places
                 "scaled-place": 20 * math.pi * 2.5**3,  # a place that scales
                 "sheared-cylinder": 120 * math.pi,  # plane faces that are splines
                 "inner-wire": 64}  # a line drawn on a face, which bounds nothing
        out = self.place / "out.json"
        for name, volume in cases.items():
            told = self.good("import", deck.ROOT / f"tests/cases/cad-{name}.brep", "-o", out)
            self.assertNotIn("not exact", told, name)
            self.assertAlmostEqual(self.volume(out) / volume, 1, delta=1e-10, msg=name)

    def test_faces_beside_a_solid_are_named(self):
        done = call("import", deck.ROOT / "tests/cases/cad-loose-face.brep", "-o", self.place / "out.json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stderr, "^WARNING: [^\n]*1 face that belongs to no solid is left out\n$")
        self.assertAlmostEqual(self.volume(self.place / "out.json"), 60, delta=1e-9)

    def test_faces_closed_by_themselves_are_solids(self):
        two, out = deck.ROOT / "tests/cases/cad-sphere-faces.brep", self.place / "out.json"
        self.refused("has 2 solids", "import", two, "-o", out)
        for solid in (1, 2):
            self.assertNotIn("not exact", self.good("import", two, "--solid", solid, "-o", out))
            self.assertAlmostEqual(self.volume(out) / (36 * math.pi), 1, delta=1e-10)

    def test_trimmed_faces_are_fitted_with_their_error_stated(self):
        step, radius, height = Step(), 5.0, 1.0
        step.ball_cut_by(radius, height)
        out = self.place / "out.json"
        told = self.good("import", self.write("cut.step", step), "--tolerance", "10%", "-o", out)
        self.assertIn("not exact", told)
        found = re.search(r"hull: (\S+) % outward, (\S+) % inward of its radius (\S+)", told)
        outward, inward, size = (float(x) for x in found.groups())
        self.assertLess(max(outward, inward), 10)
        points = test_shape_fit.sample(out, 60)[0]
        above = np.maximum(np.linalg.norm(points, axis=1) - radius, height - points[:, 2]).max()
        self.assertLess(above, (outward + 0.01) / 100 * size)
        rim = math.sqrt(radius**2 - height**2)  # the farthest corner of the solid from the smooth body
        corners = [(rim * math.cos(t), rim * math.sin(t), height) for t in np.linspace(0, 6, 20)]
        missed = max(np.linalg.norm(points - c, axis=1).min() for c in corners)
        self.assertLess(missed, (inward + 1) / 100 * size + 0.1)  # 0.1: the points' own distance

    def test_an_outline_has_its_face_to_the_left(self):
        """Either part of a ball, each bounded by the same circle."""
        radius, height, out = 5.0, 1.0, self.place / "out.json"
        cap = math.pi * (radius - height)**2 * (2 * radius + height) / 3
        for upper, volume in ((True, cap), (False, 4 / 3 * math.pi * radius**3 - cap)):
            step = Step()
            step.ball_cut_by(radius, height, upper)
            told = self.good("import", self.write("cut.step", step), "--tolerance", "10%", "-o", out)
            added, found = (float(x) for x in re.search(r"hull: .*adds (\S+) % to the mesh's volume of (\S+)\n", told).groups())
            self.assertLess(added, 1)
            self.assertAlmostEqual(found / volume, 1, delta=0.01)

    def test_a_ring_beside_a_cut_ball(self):
        """Each is read wrongly by the settings that are right for the other."""
        radius, height, out = 5.0, 1.0, self.place / "out.json"
        cap = math.pi * (radius - height)**2 * (2 * radius + height) / 3
        file = deck.ROOT / "tests/cases/cad-ring-and-cut-ball.step"
        for solid, volume in ((1, 2 * math.pi**2 * 4), (2, 4 / 3 * math.pi * radius**3 - cap)):
            done = call("import", file, "--solid", solid, "--tolerance", "10%", "-o", out)
            self.assertEqual((done.returncode, "WARNING: " in done.stderr), (0, solid == 1), done.stderr)  # a ring has a hole
            found = float(re.search(r"to the mesh's volume of (\S+)\n", done.stdout).group(1))
            self.assertAlmostEqual(found / volume, 1, delta=0.02)

    def test_a_solid_that_is_not_convex_is_told(self):
        step, out = Step(), self.place / "out.json"
        outline = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
        points = [(x, y, z) for z in (0, 2) for x, y in outline]
        step.polyhedron(points, prism(6, 1, 1)[1])
        done = call("import", self.write("block.step", step), "--tolerance", "10%", "-o", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("not exact: the solid is not convex; fitted\n", done.stdout)
        self.assertRegex(done.stderr, "^WARNING: [^\n]*block.step: is not convex: its convex hull has 40 % more volume[^\n]*\n$")

    def test_units(self):
        out, step = self.place / "out.json", self.place / "out.step"
        for name, unit, length in (("mm.step", "SI_UNIT(.MILLI.,.METRE.)", 1), ("m.step", "SI_UNIT($,.METRE.)", 1000)):
            made = Step(unit)
            made.polyhedron(*prism(4, 2.0, 3.0))
            self.write(name, made)
            for option, scale in (([], 1), (["--unit", "m"], 1e-3), (["--unit", "25.4"], 1 / 25.4)):
                self.good("import", self.place / name, *option, "-o", out)
                self.assertAlmostEqual(self.volume(out) / (24 * (length * scale)**3), 1, delta=1e-9)
        self.good("import", self.place / "mm.step", "--unit", "m", "-o", out)
        self.assertIn("solid of 24 mm^3", self.good("export", out, "--unit", "m", "-o", step))

    def test_sizes_and_units_are_told(self):
        """By import as by export."""
        made, step, out = (self.place / name for name in ("made.json", "made.step", "out.json"))
        self.good("make", "egg", "--radius", "3", "--blunt", "3", "--pointed", "4", "-o", made)
        self.assertIn(", 60 x 60 x 70 mm\n", self.good("export", made, "--unit", "cm", "-o", step))
        for unit, told in (("m", "0.06 x 0.06 x 0.07 in m"), ("10", "6 x 6 x 7 in units of 10 mm")):
            self.assertIn(f" faces, {told}; the file is in millimetre\n", self.good("import", step, "--unit", unit, "-o", out))
        metres = Step("SI_UNIT($,.METRE.)")
        metres.polyhedron(*prism(4, 2.0, 3.0))
        self.assertIn("4000 x 4000 x 3000 in mm; the file is in metre\n", self.good("import", self.write("m.step", metres), "-o", out))
        box = deck.ROOT / "tests/cases/cad-inner-wire.brep"
        self.assertIn("in mm; the file names no unit\n", self.good("import", box, "-o", out))

    def test_several_solids_are_chosen_from(self):
        step, out = Step(), self.place / "out.json"
        step.polyhedron(*prism(4, 2.0, 3.0), name="post")
        step.polyhedron([(x + 10, y, z) for x, y, z in prism(6, 1.0, 1.0)[0]], prism(6, 1.0, 1.0)[1], name="nut")
        two = self.write("two.step", step)
        self.refused("has 2 solids .*post.*nut.*--solid N", "import", two, "-o", out)
        self.refused("--solid is 3, must be 1 to 2", "import", two, "--solid", 3, "-o", out)
        self.good("import", two, "--solid", 1, "-o", out)
        self.assertAlmostEqual(self.volume(out), 24, delta=1e-9)
        self.good("import", two, "--solid", 2, "-o", out)
        self.assertAlmostEqual(self.volume(out), 1.5 * math.sqrt(3), delta=1e-9)

    def test_bad_files(self):
        out, step = self.place / "out.json", Step()
        step.cylinder(5, 12)
        text = step.text()
        self.good("make", "sphere", self.place / "ball.json")
        cases = {"none.step": (None, "can't be read"), "text.step": ("solid stl", "is no STEP file"),
                 "text.iges": ("solid stl", "is no IGES file"), "text.brep": ("solid", "is no BREP file"),
                 "none.brep": (None, "can't be read"), "ball.json": (None, "ending '.json' is not known"),
                 "empty.step": ("", "is no STEP file"), "cut.step": (text[:len(text) // 2], "cut.step"),
                 "bare.step": (HEAD + "ENDSEC;\nEND-ISO-10303-21;\n", "holds no"),
                 # Open CASCADE itself may die of this one
                 "gone.step": (re.sub(r"#\d+=CARTESIAN_POINT[^;]*;\n", "", text), "gone.step"),
                 "head.brep": ("DBRep_DrawableShape\n\nCASCADE Topology V1, (c) Matra-Datavision\nLoc", "head.brep")}
        for name, (content, words) in cases.items():
            if content is not None:
                (self.place / name).write_text(content)
            self.refused(words, "import", self.place / name, "-o", out)
        good = self.place / "good.step"
        good.write_text(text)
        self.refused("--unit is 'furlong'", "import", good, "--unit", "furlong", "-o", out)
        self.refused("--tolerance", "import", good, "--tolerance", 0, "-o", out)
        self.refused("can't write", "import", good, "-o", self.place / "no" / "out.json")
        self.refused("can't be written", "export", self.place / "ball.json", "-o", self.place / "no" / "out.step")
        self.refused("choose another --unit", "export", self.place / "ball.json", "--unit", "1e-9", "-o",
                     self.place / "out.step")
        # An open shell encloses nothing.
        lid = re.sub(r"(CLOSED_SHELL\('',\(#\d+,#\d+),#\d+\)", r"\1)", text).replace("CLOSED_SHELL", "OPEN_SHELL")
        (self.place / "open.step").write_text(lid.replace("MANIFOLD_SOLID_BREP('',", "SHELL_BASED_SURFACE_MODEL('',(")
                                              .replace("ADVANCED_BREP_SHAPE", "MANIFOLD_SURFACE_SHAPE"))
        self.refused("open.step", "import", self.place / "open.step", "-o", out)


if __name__ == "__main__":
    unittest.main()
