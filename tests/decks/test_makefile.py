#!/usr/bin/python3
"""Makefile.package on machines other than Debian's: what is missing is named, and make goes on with what is there."""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import deck

TOOLS = ["sh", "bash", "make", "grep", "id", "find", "nproc", "mpicxx", "rm", "ar", "mkdir", "env", "cat"]


class OtherMachines(unittest.TestCase):
    def make(self, *arguments, stubs=()):
        """make with none but TOOLS and the stubs (name, script) on the path: (status, output)."""
        with tempfile.TemporaryDirectory() as place:
            for tool in TOOLS:
                found = shutil.which(tool)
                if found:
                    os.symlink(found, os.path.join(place, tool))
            for name, script in stubs:
                path = pathlib.Path(place) / name
                path.unlink(missing_ok=True)
                path.write_text("#!/bin/sh\n" + script + "\n")
                path.chmod(0o755)
            alone = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS")}  # not the make that runs the tests
            done = subprocess.run(["make", "-f", "Makefile.package", *arguments], cwd=deck.ROOT, text=True, stdin=subprocess.DEVNULL,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env={**alone, "PATH": place, "MAKELEVEL": "0"})
            return done.returncode, done.stdout

    def check_goes_on(self, stubs, *expected):
        status, output = self.make("deps", stubs=stubs)
        self.assertEqual(status, 0, output)
        for words in (*expected, "libeigen3-dev", "liggghts", "Going on"):
            self.assertIn(words, output)

    def test_no_apt_get(self):
        self.check_goes_on([], "there is no apt-get")
        self.check_goes_on([("dpkg-query", "exit 1")], "there is no apt-get")

    def test_no_root(self):
        user = ("id", "echo 1000")
        self.check_goes_on([user, ("apt-get", "exit 0")], "neither root nor sudo")
        self.check_goes_on([user, ("apt-get", "exit 0"), ("sudo", "exit 1")], "sudo would ask for a password")

    def test_no_network(self):
        self.check_goes_on([("id", "echo 0"), ("apt-get", "exit 100")], "apt-get failed")

    def test_nothing_missing(self):
        status, output = self.make("deps", stubs=[("dpkg-query", "echo install ok installed"), ("apt-get", "echo apt-get was called")])
        self.assertEqual((status, output), (0, ""))

    def test_no_packaged_host(self):
        """The library and the tools are built, and it is said what is not."""
        status, output = self.make("-n", "core", "tools")
        self.assertEqual(status, 0, output)
        status, output = self.make("-o", "core", "-o", "tools", "host", "HOST_HEADERS=/nowhere", "DEPS=done")
        self.assertEqual(status, 0, output)
        self.assertIn("No LIGGGHTS in /nowhere", output)


if __name__ == "__main__":
    unittest.main()
