// Is one detector really better than another? Paired tests for loop-closure results
// (loop-closure.md section 7).
#pragma once

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

/// McNemar's test from outcomes, one per image (true: found). Throws InputError if the lengths differ.
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

}  // namespace tutti
#pragma GCC visibility pop
