#!/usr/bin/env python3
"""./dev writes through no name that another user can have put a link at: its process number is known beforehand."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

DEV = pathlib.Path(__file__).resolve().parent.parent.parent / "dev"


class Dev(unittest.TestCase):
    def test_logs_follow_no_link_in_the_temporary_folder(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            for file, text in {"packages.apt": "absent\n", "victim": "mine\n"}.items():
                (folder / file).write_text(text)
            (folder / "dev").write_text(DEV.read_text())
            tools = folder / "tools"
            tools.mkdir()
            for tool, code in {"cmake": "echo configured", "dpkg-query": "exit 1", "apt-get": "echo installed",
                               "sudo": 'while [ "${1#-}" != "$1" ]; do shift; done; exec "$@"'}.items():
                (tools / tool).write_text(f"#!/bin/sh\n{code}\n")
                (tools / tool).chmod(0o755)
            # $$ stays the same in a process that becomes another program.
            plant = f"for what in apt cmake; do ln -s {folder}/victim /tmp/tutti-$what-$$.log; done; exec bash {folder}/dev build"
            process = subprocess.Popen(["bash", "-c", plant], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                       env={**os.environ, "PATH": f"{tools}:{os.environ['PATH']}", "TMPDIR": name})
            output = process.communicate()[0]
            for what in ("apt", "cmake"):
                pathlib.Path(f"/tmp/tutti-{what}-{process.pid}.log").unlink(missing_ok=True)
            self.assertEqual(process.returncode, 0, output)
            self.assertEqual((folder / "victim").read_text(), "mine\n")
            self.assertEqual(list(folder.glob("tmp.*")), [], "a log stays")


if __name__ == "__main__":
    sys.exit(unittest.main())
