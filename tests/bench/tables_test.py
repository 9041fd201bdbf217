"""./dev bench: every table has a script that explains itself, and nothing that git tracks is rewritten without --write."""
import argparse
import contextlib
import io
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(sys.argv.pop(1))
sys.path.insert(0, str(ROOT / "bench"))
sys.dont_write_bytecode = True
import benchmark  # noqa: E402
import ensemble_bounds  # noqa: E402
import ensemble_figures  # noqa: E402
import run_table  # noqa: E402
import table  # noqa: E402


def call(*arguments):
    return subprocess.run([sys.executable, "-B", ROOT / "bench" / "tables", *arguments], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True)


def run(**figures):
    return {"total": 500, "lost": 0, "true": 3, "false": 0, "path_m": 10, "wall_s": 8, "cpu_ms": 20, "odometry_ate": 0.05,
            "slam_ate": 0.04, "end_closed": 1, **figures}


def loops(outcomes):
    """One row of the ensemble's protocol, by a letter an image."""
    found = {c: outcomes.count(c) for c in "TFXnm"}
    return {"outcomes": outcomes, "true": found["T"], "false": found["F"] + found["X"], "near": found["n"], "images": len(outcomes),
            "rows_with_loop": sum(found[c] for c in "TXnm"), "r100_posterior": 1.0, "reliability": [[0, 0, 0]] * 10}


class Protocol(unittest.TestCase):
    def test_blocks_hold_what_the_whole_set_has(self):
        row = loops("T" * 15 + "m" * 10 + "." * 10 + "XFn")
        self.assertEqual(ensemble_figures.blocks(row), [(15, 0, 20), (0, 2, 7)])
        self.assertAlmostEqual(ensemble_figures.f1_of((15, 2, 27)), ensemble_figures.Pool([{"rows": {"joint": row}}], "joint").f1(), 2)

    def test_an_interval_holds_the_figure_and_is_a_point_where_all_is_equal(self):
        sets = [{"rows": {"joint": loops("T" * 60), "orb": loops("T" * 20 + "m" * 20 + "F" * 20)}} for _ in range(3)]
        low, high = ensemble_figures.interval(ensemble_figures.resampled(sets, ["joint"], ensemble_figures.precision_of, 200))
        self.assertEqual((low, high), (1.0, 1.0))
        low, high = ensemble_figures.interval(ensemble_figures.resampled(sets, ["orb"], ensemble_figures.precision_of, 200))
        self.assertTrue(low < 0.5 < high)

    def test_bounds_hold_and_fail(self):
        def verdicts(free, dusk):
            done = {f"world/loop-free-6/{i}": {"rows": {"joint": loops(free)}} for i in range(2)}
            done["world/indoor-dusk/0"] = {"rows": {m: loops(dusk) for m in ["joint", "surf", "sift", "orb"]}}
            lines = ensemble_bounds.judge(done, {}).lines
            return [line.split(" | ")[-1] for line in lines if "loop-free drives" in line or "at dusk" in line]
        self.assertEqual(verdicts("." * 50 + "F", "T" * 20 + "m" * 20), ["holds |", "holds |"])
        self.assertEqual(verdicts("." * 50 + "FF", "T" * 15 + "m" * 25), ["**fails** |", "**fails** |"])


class Tables(unittest.TestCase):
    def test_every_table_has_a_script_that_explains_itself(self):
        listed = re.findall(r"^  (\S+) +.*min\)$", call().stdout, re.MULTILINE)
        self.assertIn("readme", listed)
        for name in listed:
            done = call(name, "--help")
            self.assertEqual(done.returncode, 0, done.stdout)
            self.assertIn("--write", done.stdout)

    def test_what_there_is_not_is_refused_with_what_there_is(self):
        unknown = call("redme")
        self.assertEqual(unknown.returncode, 2)
        self.assertIn("readme ensemble", unknown.stdout)
        self.assertIn("unknown row 'kity'; rows are redkitchen kitti", call("readme", "kity").stdout)

    def test_tracked_files_are_rewritten_with_write_alone(self):
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder)
            document = out / "page.md"
            document.write_text("a\n<!-- t:begin -->\nold\n<!-- t:end -->\nb\n")
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                table.put_between(argparse.Namespace(write=False, out=out), document, "t", "new")
                self.assertIn("old", document.read_text())
                table.put_between(argparse.Namespace(write=True, out=out), document, "t", "new")
                self.assertEqual(document.read_text(), "a\n<!-- t:begin -->\nnew\n<!-- t:end -->\nb\n")
                table.put(argparse.Namespace(write=False, out=out), document, "whole")
                self.assertIn("new", document.read_text())

    def test_a_row_shows_median_and_worst_and_one_false_loop_is_too_many(self):
        runs = [run(odometry_ate=0.04 + 0.001 * k) for k in range(5)]
        self.assertEqual(run_table.missed(run_table.ROWS["redkitchen"], runs), [])
        self.assertIn("| all of 500 | 0.0420 m (0.0440 m) | 0.0400 m (0.0400 m) | 3 / 0 | 8 s, 20 CPU-ms", run_table.line("redkitchen", runs))
        runs[4]["false"], runs[3]["lost"] = 1, 6
        self.assertEqual(run_table.missed(run_table.ROWS["redkitchen"], runs),
                         ["frames not tracked: 6 where 5 is wanted", "1 false loops"])
        runs = [run(slam_ate=0.06), run(slam_ate=0.06), run(slam_ate=0.02)]
        self.assertEqual(run_table.missed(run_table.ROWS["redkitchen"], runs), ["ATE: 0.06 where 0.048 is wanted"])

    def test_the_verdict_says_where_the_ensemble_did_not_help(self):
        def of(ate, p=None):
            return {"n": 5, "failed": 0, "ate_mean_m": ate, "ate_half_width_m": 0.1, "ate_worst_m": ate + 0.2, "p": p,
                    "proposed": 1, "accepted": 1, "false": 0}
        whole = {"town": {"varies": "the data set (5)", "variants": {"odometry": of(2, 0.0001), "orb": of(1), "ensemble": of(0.5)}},
                 "room": {"varies": "the data set (5)", "variants": {"odometry": of(1, 0.5), "orb": of(0.3), "ensemble": of(1.5)}}}
        text = benchmark.verdict(whole)
        self.assertIn("| town | 2.0000 m | 0.5000 m | ensemble (0.5000 m) | 0.0 | yes, none is better (p < 0.001 against the odometry) |", text)
        self.assertIn("no: not better than the odometry alone", text)
        self.assertIn("n = 5; what varies: the data set (5).", benchmark.section("town", whole["town"]))


if __name__ == "__main__":
    unittest.main()
