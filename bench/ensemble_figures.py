"""Counts of the ensemble's protocol over several sets, and their intervals."""
import random
from math import comb


class Pool:
    """Counts over several sets."""

    def __init__(self, results, row):
        self.rows = [r["rows"][row] for r in results]
        self.tp, self.fp, self.all = (sum(r[k] for r in self.rows) for k in ("true", "false", "rows_with_loop"))

    def precision(self):
        return self.tp / (self.tp + self.fp) if self.tp + self.fp else 1.0

    def recall(self):
        return self.tp / self.all if self.all else 0.0

    def f1(self):
        p, r = self.precision(), self.recall()
        return 2 * p * r / (p + r) if p + r else 0.0

    def near(self):
        return sum(r["near"] for r in self.rows)

    def images(self):
        return sum(r["images"] for r in self.rows)

    def overlap(self, least):
        """(found, images) of those whose best view overlaps by so much."""
        parts = [p for r in self.rows for p in r["overlap"] if abs(p[0] - least) < 1e-9]
        return sum(p[3] for p in parts), sum(p[2] for p in parts)

    def mean(self, key):
        return sum(r[key] for r in self.rows) / len(self.rows)

    def calibration(self):
        """(ECE, images) of the accepted."""
        bins = [[0, 0.0, 0.0] for _ in range(10)]
        for r in self.rows:
            for b, (n, mean, accuracy) in zip(bins, r["reliability"]):
                b[0] += n
                b[1] += n * mean
                b[2] += n * accuracy
        total = sum(b[0] for b in bins)
        return (sum(abs(b[1] - b[2]) for b in bins) / total if total else 0.0), total


BLOCK = 20  # images in a row, which are alike


def blocks(row):
    """(true, false, images with a loop) of every few images of a set."""
    letters = row["outcomes"]
    parts = [letters[i:i + BLOCK] for i in range(0, len(letters), BLOCK)]
    return [(p.count("T"), p.count("F") + p.count("X"), sum(p.count(c) for c in "TXnm")) for p in parts]


def resampled(results, rows, figure, draws=1000):
    """Sorted values of figure([(true, false, with a loop) of each row]): sets are drawn, and blocks of images in each."""
    source = random.Random(1)
    sets = [list(zip(*[blocks(r["rows"][row]) for row in rows])) for r in results]
    values = []
    for _ in range(draws):
        sums = [[0, 0, 0] for _ in rows]
        for chosen in source.choices(sets, k=len(sets)):
            for block in source.choices(chosen, k=len(chosen)):
                for total, counts in zip(sums, block):
                    total[0] += counts[0]
                    total[1] += counts[1]
                    total[2] += counts[2]
        values.append(figure(sums))
    return sorted(values)


def precision_of(sums):
    tp, fp, _ = sums[0]
    return tp / (tp + fp) if tp + fp else 1.0


def f1_of(counts):
    tp, fp, rows = counts
    return 2 * tp / (tp + fp + rows) if tp + fp + rows else 1.0


def interval(values):
    """95 %."""
    return values[int(0.025 * len(values))], values[int(0.975 * len(values)) - 1]


def sign_test(wins, losses):
    """One-sided p of at least so many wins, ties left out."""
    n = wins + losses
    return sum(comb(n, k) for k in range(wins, n + 1)) / 2 ** n if n else 1.0


def pc(x):
    return f"{100 * x:.1f}"
