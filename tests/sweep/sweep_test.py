#!/usr/bin/env python3
"""The sweep of apps/examples/sweep on a tiny synthetic town, with one configuration that always fails.

usage: sweep_test.py TUTTI SNAKEFILE. Exit status 77: skipped, Snakemake is absent.
"""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

TUTTI, SNAKEFILE = (str(pathlib.Path(name).resolve()) for name in sys.argv[1:3])


class Sweep(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tutti-sweep-"))
        cls.town = cls.folder / "town's data"  # quotes and spaces must do no harm
        subprocess.run([TUTTI, "generate", "--out", cls.town, "--sensor", "stereo", "--frames", "15", "--width", "480", "--height",
                        "240", "--supersample", "1"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        cls.out = cls.folder / "out"
        cls.sweep = {"tutti": TUTTI, "out": str(cls.out), "starts": [0, 1], "tries": 2, "report": False,
                     "datasets": {"town": {"config": str(cls.town / "config.yaml"), "path": str(cls.town)}},
                     "configurations": {"ensemble": {}, "alone": {"arguments": ["--no-loops"]}, "broken": {"set": ["no_such_key=1"]}}}
        cls.first = cls.snakemake()

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder, ignore_errors=True)

    @classmethod
    def snakemake(cls):
        file = cls.folder / "sweep.json"  # JSON is YAML
        file.write_text(json.dumps(cls.sweep))
        return subprocess.run(["snakemake", "--snakefile", SNAKEFILE, "--configfile", file, "--cores", "2", "--keep-going", "--directory",
                               cls.folder], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def test_1_what_works_is_collected_and_what_fails_is_reported(self):
        self.assertEqual(self.first.returncode, 0, self.first.stdout)
        table = (self.out / "table.md").read_text()
        for text in ("| ensemble", "| alone", "FAILED: town/broken/start_0: status 1 after 2 tries", "FAILED: town/broken/start_1",
                     "no_such_key"):
            self.assertIn(text, table)
        self.assertNotIn("| broken", table)
        collected = json.loads((self.out / "collected.json").read_text())
        self.assertEqual({v["variant"]: [s["start"] for s in v["samples"]] for v in collected["datasets"][0]["variants"]},
                         {"ensemble": [0, 1], "alone": [0, 1]})

    def test_2_a_run_that_failed_was_tried_again(self):
        self.assertEqual(self.first.stdout.count("Trying to restart job"), 2, self.first.stdout)

    def test_3_what_is_finished_is_not_run_again(self):
        summary = self.out / "runs/town/ensemble/start_0/summary.json"
        before = summary.stat().st_mtime_ns
        again = self.snakemake()
        self.assertEqual(again.returncode, 0, again.stdout)
        self.assertIn("Nothing to be done", again.stdout)
        self.sweep["starts"].append(2)
        more = self.snakemake()
        self.assertEqual(more.returncode, 0, more.stdout)
        self.assertEqual(summary.stat().st_mtime_ns, before)
        collected = json.loads((self.out / "collected.json").read_text())
        self.assertEqual([s["start"] for s in collected["datasets"][0]["variants"][0]["samples"]], [0, 1, 2])


if __name__ == "__main__":
    if shutil.which("snakemake") is None:
        print("skipped: no Snakemake (Debian: apt-get install snakemake)")
        sys.exit(77)
    unittest.main(argv=sys.argv[:1], verbosity=2)
