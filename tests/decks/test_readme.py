#!/usr/bin/python3
"""The decks that the README and the guide (examples/README.md) print run as printed; their links lead somewhere."""
import re
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import deck  # noqa: E402
from test_walls import stl  # noqa: E402


def section(heading, file="README.md"):
    return (deck.ROOT / file).read_text().split(f"\n## {heading}\n")[1].split("\n## ")[0]


def printed(text):
    """What stands indented: decks, or parts of them."""
    return re.findall(r"^    (.*)$", text, re.MULTILINE)


GUIDE = "examples/README.md"


class Readme(unittest.TestCase):
    def test_its_deck_runs(self):
        lines = printed(section("A deck"))
        self.assertGreater(len(lines), 10)
        result = deck.run_ok("\n".join(lines) + "\n", files={"pebble.json": deck.shape_file("pebble")})
        self.assertNotIn("WARNING", result.screen)
        self.assertGreater(len(list(result.path.glob("pebbles-*.vtu"))), 10)
        self.assertEqual(result.thermo["Atoms"][-1], 36)
        self.assertLess(result.thermo["KinEng"][-1], 2e6)  # 7e7 J in free fall: the floor holds them

    def test_its_ledger(self):
        pebbles, ledger = printed(section("A deck")), printed(section("Energy", GUIDE))
        self.assertEqual(len(ledger), 8)
        short = [line for line in pebbles if not line.startswith(("dump", "run"))]
        thermo = deck.run_ok("\n".join(short + ledger) + "\nrun 15000\n", files={"pebble.json": deck.shape_file("pebble")}).thermo
        lost = sum(values for name, values in thermo.items() if name.startswith("ledger"))
        self.assertGreater(lost[-1], 1e6)
        self.assertLess(np.ptp(thermo["sum"]), 0.01 * lost[-1])

    def test_its_lines_from_a_deck_for_spheres(self):
        """All of them in one deck, with the materials, the meshes and the box that they speak of: grains pour, and rolling counts."""
        lines = printed(section("From a deck for spheres")) + printed(section("Pouring and insertion", GUIDE))
        style = next(line for line in lines if line.startswith("atom_style"))
        start = f"""units si
newton off
communicate single vel yes
{style}
boundary f f f
region box block -0.06 0.06 -0.06 0.06 -0.01 0.12 units box
create_box 1 box
neighbor 2e-3 bin
neigh_modify delay 0
{deck.materials()}
fix silo all mesh/surface file silo.stl type 1
fix gravity all gravity 9.81 vector 0 0 -1
"""
        square = lambda h, z: stl([((-h, -h, z), (h, -h, z), (h, h, z)), ((-h, -h, z), (h, h, z), (-h, h, z))])  # noqa: E731
        result = deck.run_ok(start + "\n".join(line for line in lines if line != style) +
                             "\npair_coeff * *\ntimestep 2e-5\nrun 5000\n",
                             files={"grain.json": deck.shape_file("pebble"), "silo.stl": square(0.01, 0.005), "face.stl": square(0.02, 0.06)})
        self.assertEqual(re.findall(r"Fix wall/nurbs (\w+) has no rolling_friction", result.screen), ["wall", "tube"])
        self.assertGreater(result.thermo["Atoms"][-1], 100)

    def test_its_whole_deck(self):
        """Files made as it says; grains stay in the drum, which carries them up; the restart goes on, on another number of ranks."""
        text = section("A whole deck", GUIDE)
        lines = printed(text)
        with tempfile.TemporaryDirectory() as place:
            for command in re.findall(r"`build/nurbs-shape ([^`]*)`", text.replace("\n", " ")):
                deck.nurbs_shape(*command.split(), cwd=place).check_returncode()
            files = {name: Path(place) / name for name in ("grain.json", "drum.stl")}
            run = deck.run_ok("\n".join(lines) + "\n", files=files, ranks=2)
            self.assertNotIn("WARNING", run.screen)
            self.assertEqual([table["Atoms"][-1] for table in run.tables], [200, 200])
            again = [line for line in lines if line.split()[0] in ("communicate", "neighbor", "neigh_modify", "timestep") or
                     re.match(r"fix +(E|nu|e|mu|drum|wall|gravity|motion|turn) ", line)]
            more = deck.run_ok("newton off\nread_restart drum.restart\n" + "\n".join(again) + "\nrun 1000\n",
                               files={**files, "drum.restart": run.path / "drum.restart"})
        self.assertNotIn("WARNING", more.screen.replace("WARNING: Restart file used different # of processors", ""))
        self.assertEqual(more.thermo["Atoms"][-1], 200)

    def test_its_restart_recipe(self):
        """What the README says to repeat after read_restart, and no more, goes on to the last bit."""
        lines = printed(section("A deck"))
        kept = [line for line in lines if line.split()[0] not in ("dump", "run", "thermo")]
        output = "dump d all custom 500 dump.txt id x y z omegax\ndump_modify d format \"%d %.17g %.17g %.17g %.17g\"\nrun 500\n"
        pebble = {"pebble.json": deck.shape_file("pebble")}
        whole = deck.run_ok("\n".join(kept) + "\nrun 2500\nwrite_restart a.restart\n" + output, files=pebble)
        repeated = [line for line in kept if line.split()[0] in ("communicate", "neighbor", "neigh_modify", "timestep", "fix")]
        again = "newton off\nread_restart a.restart\n" + "\n".join(repeated) + "\n" + output
        run = deck.run_ok(again, files={"a.restart": whole.path / "a.restart"})
        self.assertNotIn("WARNING", run.screen)
        (step, expected), (found_step, found) = whole.dump("dump.txt")[-1], run.dump("dump.txt")[-1]
        self.assertEqual(step, found_step)
        for name in expected:
            np.testing.assert_array_equal(expected[name], found[name])
        forgotten = deck.run_ok(again.replace("timestep", "#"), files={"a.restart": whole.path / "a.restart"})
        self.assertIn("no 'timestep'", forgotten.screen)

    def test_its_restart_deck(self):
        """The deck printed for going on is the first one's lines that have to be repeated, and no others."""
        lines, again = printed(section("A deck")), printed(section("Restarts", GUIDE))
        repeated = [line for line in lines if line.split()[0] in ("newton", "communicate", "neighbor", "neigh_modify", "fix", "timestep", "run")]
        self.assertEqual(again, [repeated[0], "read_restart half.restart", *repeated[1:]])


class Links(unittest.TestCase):
    def test_links_lead_somewhere(self):
        """Files and headings (as GitHub names them) of every relative link in the READMEs."""
        anchors = lambda text: {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")  # noqa: E731
                                for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE)}
        pages = [deck.ROOT / "README.md", *(page for place in ("src", "examples", "tests", "bench") for page in (deck.ROOT / place).rglob("*.md"))]
        self.assertGreater(len(pages), 10)
        links = 0
        for page in pages:
            for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
                if "://" in link:
                    continue
                links += 1
                name, _, anchor = link.partition("#")
                target = page.parent / name if name else page
                self.assertTrue(target.exists(), f"{page}: {link}")
                if anchor:
                    self.assertIn(anchor, anchors(target.read_text()), f"{page}: {link}")
        self.assertGreater(links, 50)


if __name__ == "__main__":
    unittest.main()
