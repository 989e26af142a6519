#!/usr/bin/python3
"""The source-tree install against Debian's LIGGGHTS source: styles are found, in an order that lets ours stand for the
host's of the same name, and compile there. Skipped, with the reason, where apt-get has no source packages."""
import concurrent.futures
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck

COMMON = ["liggghts/nurbs_contact.h", "liggghts/atom_vec_nurbs.h", "atom.h", "comm.h", "domain.h", "fix.h", "force.h", "modify.h",
          "neighbor.h", "update.h"]
SKIPPED = {"register.cpp", "main.cpp"}  # for the packaged host only


def source_lists(place):
    """apt-get's options for lists of source packages of its own, in `place`, of the archives that the system knows."""
    lists = pathlib.Path(place) / "apt"
    for directory in ("parts", "lists/partial", "cache/archives/partial"):
        (lists / directory).mkdir(parents=True)
    known = pathlib.Path("/etc/apt")
    for path in [known / "sources.list", *sorted((known / "sources.list.d").glob("*"))]:
        if path.suffix in (".list", ".sources") and path.exists():
            text = re.sub(r"^Types:.*$", "Types: deb-src", path.read_text(), flags=re.MULTILINE)
            (lists / "parts" / path.name).write_text(re.sub(r"^deb ", "deb-src ", text, flags=re.MULTILINE))
    options = {"Dir::Etc::sourcelist": "/dev/null", "Dir::Etc::sourceparts": lists / "parts",
               "Dir::State::lists": lists / "lists", "Dir::Cache": lists / "cache", "APT::Sandbox::User": ""}
    return [word for name, value in options.items() for word in ("-o", f"{name}={value}")]


def fetch_source(place):
    """The host's src directory, unpacked from the source package."""
    if shutil.which("apt-get") is None:
        raise unittest.SkipTest("there is no apt-get to get LIGGGHTS's source with")
    apt = ["apt-get", *source_lists(place)]
    for step in (["update"], ["source", "--download-only", "--tar-only", "liggghts"]):
        done = subprocess.run([*apt, "-qq", *step], cwd=place, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              stdin=subprocess.DEVNULL, timeout=200)
    balls = sorted(pathlib.Path(place).glob("liggghts_*.orig.tar.*"))
    if done.returncode != 0 or not balls:
        raise unittest.SkipTest(f"apt-get source liggghts: {done.stdout.strip()[-200:]}")
    with tarfile.open(balls[0]) as ball:  # without Debian's patches; the one that new compilers need is in its header
        members = [member for member in ball.getmembers() if re.match(r"[^/]+/src/", member.name)]
        ball.extractall(place, members)
    tree = next(pathlib.Path(place).glob("*/src"))
    shutil.copy("/usr/include/liggghts/utils.h", tree)
    return tree


class SourceTree(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        place = tempfile.TemporaryDirectory(prefix="nurbs-tree-")
        cls.addClassCleanup(place.cleanup)
        cls.tree = fetch_source(place.name)
        cls.before = {path.name for path in cls.tree.iterdir()}
        cls.make("install")
        subprocess.run(["sh", "Make.sh", "style"], cwd=cls.tree, check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)  # lists of the styles found, which both tests read

    @classmethod
    def make(cls, goal):
        subprocess.run(["make", "-f", "Makefile.package", goal, f"LIGGGHTS_SRC={cls.tree}"], cwd=deck.ROOT, check=True,
                       stdout=subprocess.DEVNULL)

    def included(self, kind):
        return re.findall(r'#include "(.*)"', (self.tree / f"style_{kind}.h").read_text())

    def test_styles_are_found_and_ours_come_last(self):
        """The host's maps keep the last style of a name."""
        ours = [path for path in self.tree.glob("*.h") if path.is_symlink()]
        places = {}
        for kind in ("atom", "command", "compute", "dump", "fix", "pair"):
            for header in self.included(kind):
                styles = re.findall(rf"^{kind.capitalize()}Style\((\S+?),", (self.tree / header).read_text(), re.MULTILINE)
                for style in styles:
                    places.setdefault((kind, style), []).append((self.tree / header).is_symlink())
        named = sum(len(re.findall(r"^\w+Style\(", path.read_text(), re.MULTILINE)) for path in ours)
        self.assertEqual(named, sum(who[-1] for who in places.values()))
        twice = {name: who for name, who in places.items() if len(who) > 1 and any(who)}
        self.assertIn(("fix", "contacthistory"), twice)
        self.assertIn(("command", "set"), twice)
        for name, who in twice.items():
            self.assertEqual(who, [False, True], name)

    def test_styles_compile(self):
        flags = re.search(r"^PKG_INC \+= (.*)$", (self.tree / "Makefile.package").read_text(), re.MULTILINE)[1].split()
        mpi = subprocess.run(["mpicxx", "--showme:compile"], check=True, stdout=subprocess.PIPE, text=True).stdout.split()
        sources = [path for path in self.tree.glob("*.cpp") if path.is_symlink()]
        self.assertEqual({path.name for path in sources},
                         {path.name for path in (deck.ROOT / "src/liggghts").glob("*.cpp")} - SKIPPED)

        # As LIGGGHTS's own make has it unless told otherwise; the packaged host, which all else is compiled for, has neither.
        flags += ["-DSUPERQUADRIC_ACTIVE_FLAG", "-DNONSPHERICAL_ACTIVE_FLAG"]
        compiler = [os.environ.get("CXX", "g++").split()[-1], "-w", *mpi, *flags, "-I."]
        # What most of them include, compiled once.
        (self.tree / "common.h").write_text("".join(f'#include "{name}"\n' for name in COMMON))
        subprocess.run([*compiler, "-x", "c++-header", "common.h", "-o", "common.h.gch"], cwd=self.tree, check=True)

        def errors(source):
            command = [*compiler, "-fsyntax-only", "-include", "common.h", source.name]
            done = subprocess.run(command, cwd=self.tree, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            return "" if done.returncode == 0 else done.stdout[-2000:]

        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            self.assertEqual([failure for failure in pool.map(errors, sources) if failure], [])

    def test_uninstall_leaves_nothing(self):
        self.make("uninstall")
        try:
            self.assertEqual([path for path in self.tree.iterdir() if path.is_symlink()], [])
            self.assertNotIn("nurbs", (self.tree / "Makefile.package").read_text())
        finally:
            self.make("install")


if __name__ == "__main__":
    unittest.main()
