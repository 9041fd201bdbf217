// Is one detector really better than another? Paired tests and intervals for loop-closure results
// (loop-closure.md section 7).
#pragma once

#include <cstdint>
#include <vector>

#pragma GCC visibility push(default)
namespace tutti {

/// Outcome of McNemar's test: only the pairs on which the two detectors differ count.
struct McNemarResult {
  int only_a = 0;         ///< images that a found and b did not
  int only_b = 0;         ///< images that b found and a did not
  bool exact = true;      ///< exact binomial p; else from chi-square
  double chi_square = 0;  ///< (|only_a - only_b| - 1)^2 / (only_a + only_b); 0 if exact
  double p = 1;           ///< two-sided
};

/// McNemar's test (McNemar, Psychometrika 12, 1947) that both find equally many. Fewer than 25 discordant
/// pairs: exact binomial, p = 2 P(X <= min) for X ~ B(only_a + only_b, 1/2), at most 1. Else chi-square with
/// one degree of freedom and Edwards' continuity correction (Edwards, Psychometrika 13, 1948). Counts below 0
/// are taken as 0.
McNemarResult McNemarTest(int only_a, int only_b);

/// The same from outcomes, one per image (true: found). Throws InputError if the lengths differ.
McNemarResult McNemarTest(const std::vector<bool>& a, const std::vector<bool>& b);

/// Pairs from which on a p-value is worth reporting: with fewer, one lucky run decides.
inline constexpr int kLeastPairs = 5;

/// Outcome of the paired t-test.
struct PairedTTestResult {
  int pairs = 0;               ///< values that were compared
  double mean_difference = 0;  ///< mean of a - b
  double t = 0;  ///< mean / (s / sqrt(pairs)), pairs - 1 degrees of freedom; infinite if all differences are
                 ///< the same but not 0
  double p = 1;  ///< two-sided; 1 for fewer than 2 pairs or no difference at all, 0 where t is infinite
};

/// Student's paired t-test (Student, Biometrika 6, 1908) that a - b has mean 0; the paper's test between
/// rules, over recalls per data set, or over outcomes (0 or 1) per image. Throws InputError if the lengths
/// differ or a value is not finite.
PairedTTestResult PairedTTest(const std::vector<double>& a, const std::vector<double>& b);

/// P(|T| >= |t|) for Student's t with `degrees` > 0 degrees of freedom: the regularised incomplete beta
/// function I_x(degrees / 2, 1 / 2) at x = degrees / (degrees + t^2) (Abramowitz and Stegun 26.7.1 and
/// 26.5.27).
double StudentTwoSided(double t, double degrees);

/// Outcome of the sign test.
struct SignTestResult {
  int greater = 0;  ///< pairs with a > b
  int less = 0;     ///< pairs with a < b
  int ties = 0;     ///< pairs with a = b; they are left out
  double p = 1;     ///< one-sided: P(X >= greater) for X ~ B(greater + less, 1/2); 1 without a difference
};

/// One-sided sign test that a is greater than b no more often than less (Dixon and Mood, Journal of the
/// American Statistical Association 41, 1946): needs neither a distribution nor a scale that is the same for
/// all pairs, as for figures of different worlds. Exact. Throws InputError if the lengths differ or a value
/// is no number.
SignTestResult SignTest(const std::vector<double>& a, const std::vector<double>& b);

/// The same from counts; those below 0 are taken as 0.
SignTestResult SignTest(int greater, int less);

/// One group's part in a pooled ratio: of a world, its true positives out of all that was accepted.
struct RatioPart {
  double numerator = 0;    ///< such as TP
  double denominator = 0;  ///< such as TP + FP, at least 0
};

/// Outcome of BootstrapRatio.
struct BootstrapInterval {
  double ratio = 0;   ///< sum of numerators / sum of denominators; NaN if that is 0
  double low = 0;     ///< lower end; NaN if no resample has a ratio
  double high = 0;    ///< upper end; NaN if no resample has a ratio
  int resamples = 0;  ///< that had a ratio: the sum of their denominators is not 0
};

/// Percentile bootstrap interval (Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13)
/// for a pooled ratio, sum of numerators / sum of denominators. Whole groups are drawn with replacement, as
/// many as there are: images of one world are not independent of each other (cluster bootstrap, Davison and
/// Hinkley, Bootstrap Methods, 1997, section 3.8). The ends are the (1 - confidence) / 2 and
/// (1 + confidence) / 2 quantiles of the resampled ratios, interpolated between order statistics. Where all
/// groups agree, both ends are the ratio itself: with few groups the interval is too short. Resamples whose
/// denominators sum to 0 are left out. The same for a seed on every machine. Throws InputError for no
/// groups, a value that is not finite, a denominator below 0, fewer than 1 resample, or a confidence outside
/// of 0..1, both excluded.
BootstrapInterval BootstrapRatio(const std::vector<RatioPart>& groups, double confidence = 0.95,
                                 int resamples = 10000, std::uint64_t seed = 1);

}  // namespace tutti
#pragma GCC visibility pop
