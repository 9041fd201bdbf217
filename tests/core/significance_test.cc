#include "tutti/core/significance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tutti/core/error.h"

namespace tutti {
namespace {

// Agresti, Categorical Data Analysis (1990), p. 350, approval ratings: 150 and 86 changed their mind. R's
// mcnemar.test prints: McNemar's chi-squared = 16.818, df = 1, p-value = 4.115e-05.
TEST(McNemar, ManyDiscordantPairsTakeChiSquareWithContinuityCorrection) {
  const McNemarResult result = McNemarTest(150, 86);
  EXPECT_FALSE(result.exact);
  EXPECT_NEAR(result.chi_square, 16.818, 5e-4);
  EXPECT_NEAR(result.p, 4.115e-5, 5e-9);
}

// Fagerland, Lydersen, Laake, BMC Medical Research Methodology 13:91 (2013), table 2 (Bentur et al.): 1 and 7
// discordant pairs, exact conditional p = 0.0703.
TEST(McNemar, FewDiscordantPairsTakeTheExactBinomial) {
  const McNemarResult result = McNemarTest(1, 7);
  EXPECT_TRUE(result.exact);
  EXPECT_NEAR(result.p, 0.0703125, 1e-12);  // 2 (1 + 8) / 2^8
  EXPECT_NEAR(McNemarTest(12, 5).p, 0.143463, 1e-6);
  EXPECT_DOUBLE_EQ(McNemarTest(7, 1).p, result.p);
}

TEST(McNemar, TheLimitBetweenBothIs25DiscordantPairs) {
  EXPECT_TRUE(McNemarTest(20, 4).exact);
  EXPECT_FALSE(McNemarTest(20, 5).exact);
  EXPECT_NEAR(McNemarTest(20, 5).chi_square, 14.0 * 14.0 / 25.0, 1e-12);
}

TEST(McNemar, NoDifferenceIsNoEvidence) {
  EXPECT_DOUBLE_EQ(McNemarTest(0, 0).p, 1.0);
  EXPECT_DOUBLE_EQ(McNemarTest(4, 4).p, 1.0);
  EXPECT_DOUBLE_EQ(McNemarTest(500, 500).p, 1.0);
  EXPECT_DOUBLE_EQ(McNemarTest(1, 0).p, 1.0);
  EXPECT_DOUBLE_EQ(McNemarTest(-3, 0).p, 1.0);
}

TEST(McNemar, CountsTheDiscordantPairsOfOutcomes) {
  const McNemarResult result =
      McNemarTest({true, true, false, true, false, true}, {true, false, true, false, false, false});
  EXPECT_EQ(result.only_a, 3);
  EXPECT_EQ(result.only_b, 1);
  EXPECT_NEAR(result.p, 2.0 * (1 + 4) / 16.0, 1e-12);
  EXPECT_THROW(McNemarTest({true}, {true, false}), InputError);
  EXPECT_DOUBLE_EQ(McNemarTest(std::vector<bool>(), std::vector<bool>()).p, 1.0);
}

// Student, "The probable error of a mean", Biometrika 6 (1908): additional hours of sleep gained by ten
// patients with two drugs. R's t.test(paired = TRUE) of its data set `sleep` prints: t = -4.0621, df = 9,
// p-value = 0.002833, mean difference -1.58.
TEST(PairedTTest, StudentsSleepData) {
  const std::vector<double> first = {0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0};
  const std::vector<double> second = {1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4};
  const PairedTTestResult result = PairedTTest(first, second);
  EXPECT_EQ(result.pairs, 10);
  EXPECT_NEAR(result.mean_difference, -1.58, 1e-12);
  EXPECT_NEAR(result.t, -4.0621, 5e-5);
  EXPECT_NEAR(result.p, 0.002833, 5e-7);
  EXPECT_NEAR(PairedTTest(second, first).t, 4.0621, 5e-5);
}

// Critical values of the two-sided test, Abramowitz and Stegun, Handbook of Mathematical Functions (1964),
// table 26.10.
TEST(StudentTwoSided, CriticalValuesOfTheTable) {
  EXPECT_NEAR(StudentTwoSided(12.706, 1), 0.05, 1e-5);
  EXPECT_NEAR(StudentTwoSided(63.657, 1), 0.01, 1e-5);
  EXPECT_NEAR(StudentTwoSided(4.303, 2), 0.05, 1e-5);
  EXPECT_NEAR(StudentTwoSided(-2.228, 10), 0.05, 1e-4);
  EXPECT_NEAR(StudentTwoSided(2.660, 60), 0.01, 1e-4);
  EXPECT_NEAR(StudentTwoSided(1, 1), 0.5, 1e-12);  // Cauchy
  EXPECT_NEAR(StudentTwoSided(1.959964, 1e7), 0.05, 1e-6);
  EXPECT_DOUBLE_EQ(StudentTwoSided(0, 5), 1.0);
  EXPECT_DOUBLE_EQ(StudentTwoSided(std::numeric_limits<double>::infinity(), 5), 0.0);
  EXPECT_THROW(StudentTwoSided(1, 0), InputError);
  EXPECT_THROW(StudentTwoSided(std::numeric_limits<double>::quiet_NaN(), 3), InputError);
}

TEST(PairedTTest, DegenerateInputHasAPlainAnswer) {
  EXPECT_DOUBLE_EQ(PairedTTest({}, {}).p, 1.0);
  EXPECT_DOUBLE_EQ(PairedTTest({0.5}, {0.1}).p, 1.0);
  EXPECT_DOUBLE_EQ(PairedTTest({0.5, 0.7}, {0.5, 0.7}).p, 1.0);
  const PairedTTestResult constant = PairedTTest({0.3, 0.5, 0.7}, {0.2, 0.4, 0.6});
  EXPECT_TRUE(std::isinf(constant.t));
  EXPECT_GT(constant.t, 0);
  EXPECT_DOUBLE_EQ(constant.p, 0.0);
  EXPECT_THROW(PairedTTest({1}, {1, 2}), InputError);
  EXPECT_THROW(PairedTTest({1, std::nan("")}, {1, 2}), InputError);
}

// Zar, Biostatistical Analysis (1999), example 24.11: the hind leg of 8 of 10 deer is longer than the
// foreleg, of 2 shorter; two-sided p = 0.109375, one-sided (45 + 10 + 1) / 2^10.
TEST(SignTest, ZarsDeer) {
  const std::vector<double> hind = {142, 140, 144, 144, 142, 146, 149, 150, 142, 148};
  const std::vector<double> fore = {138, 136, 147, 139, 143, 141, 143, 145, 136, 146};
  const SignTestResult result = SignTest(hind, fore);
  EXPECT_EQ(result.greater, 8);
  EXPECT_EQ(result.less, 2);
  EXPECT_EQ(result.ties, 0);
  EXPECT_NEAR(result.p, 56.0 / 1024.0, 1e-12);
  EXPECT_NEAR(SignTest(fore, hind).p, 1013.0 / 1024.0, 1e-12);  // the other side
}

TEST(SignTest, CountsByHand) {
  EXPECT_NEAR(SignTest(5, 0).p, 1.0 / 32.0, 1e-14);
  EXPECT_NEAR(SignTest(0, 5).p, 1.0, 1e-14);
  EXPECT_NEAR(SignTest(9, 1).p, 11.0 / 1024.0, 1e-14);
  EXPECT_NEAR(SignTest(2, 2).p, 11.0 / 16.0, 1e-14);
  EXPECT_NEAR(SignTest(20, 0).p, std::pow(0.5, 20), 1e-18);
  // Far too many for 2^n: P(X >= 5100) for B(10000, 1/2) is that of a normal beyond 1.99 deviations.
  EXPECT_NEAR(SignTest(5100, 4900).p, 0.5 * std::erfc(1.99 / std::sqrt(2.0)), 1e-5);
}

TEST(SignTest, TiesAreLeftOut) {
  const SignTestResult result = SignTest({1, 2, 3, 4}, {0, 2, 2, 4});
  EXPECT_EQ(result.ties, 2);
  EXPECT_NEAR(result.p, 0.25, 1e-14);
  EXPECT_DOUBLE_EQ(SignTest({1, 2}, {1, 2}).p, 1.0);
  EXPECT_DOUBLE_EQ(SignTest(std::vector<double>(), std::vector<double>()).p, 1.0);
  EXPECT_DOUBLE_EQ(SignTest(-1, -1).p, 1.0);
  EXPECT_THROW(SignTest({1}, {1, 2}), InputError);
  EXPECT_THROW(SignTest(std::vector<double>{std::nan("")}, std::vector<double>{1}), InputError);
}

// Of groups that are 0 or 1 the resampled ratio is B(n, p) / n. For B(20, 1/2): P(X <= 5) = 0.0207, P(X <= 6)
// = 0.0577, so its 2.5 % quantile is 6 and its 97.5 % quantile 14 (P(X <= 3) = 0.0013, P(X <= 4) = 0.0059:
// 4 and 16 at 99 %).
TEST(BootstrapRatio, TheQuantilesOfABinomial) {
  std::vector<RatioPart> groups(20, {0.0, 1.0});
  std::fill_n(groups.begin(), 10, RatioPart{1.0, 1.0});
  const BootstrapInterval interval = BootstrapRatio(groups);
  EXPECT_DOUBLE_EQ(interval.ratio, 0.5);
  EXPECT_DOUBLE_EQ(interval.low, 0.3);
  EXPECT_DOUBLE_EQ(interval.high, 0.7);
  EXPECT_EQ(interval.resamples, 10000);
  const BootstrapInterval wide = BootstrapRatio(groups, 0.99);
  EXPECT_DOUBLE_EQ(wide.low, 0.2);
  EXPECT_DOUBLE_EQ(wide.high, 0.8);
}

// Two worlds, 9 of 10 and 0 of 90: pooled 0.09. Resamples: 0.9 and 0 with 1/4 each, 0.09 with 1/2.
TEST(BootstrapRatio, PoolsBeforeItDivides) {
  const std::vector<RatioPart> groups = {{9, 10}, {0, 90}};
  EXPECT_DOUBLE_EQ(BootstrapRatio(groups).ratio, 0.09);
  EXPECT_DOUBLE_EQ(BootstrapRatio(groups).low, 0.0);
  EXPECT_DOUBLE_EQ(BootstrapRatio(groups).high, 0.9);
  EXPECT_DOUBLE_EQ(BootstrapRatio(groups, 0.4).low, 0.09);
  EXPECT_DOUBLE_EQ(BootstrapRatio(groups, 0.4).high, 0.09);
}

TEST(BootstrapRatio, TheSeedDecidesAll) {
  std::vector<RatioPart> groups;
  for (int i = 1; i < 30; ++i) groups.push_back({1.0 / i, 1.0 + i % 7});
  const BootstrapInterval a = BootstrapRatio(groups, 0.95, 500, 7), b = BootstrapRatio(groups, 0.95, 500, 7);
  EXPECT_EQ(a.low, b.low);
  EXPECT_EQ(a.high, b.high);
  EXPECT_NE(a.low, BootstrapRatio(groups, 0.95, 500, 8).low);
  EXPECT_LT(a.low, a.ratio);
  EXPECT_GT(a.high, a.ratio);
}

TEST(BootstrapRatio, DegenerateGroupsHaveAPlainAnswer) {
  const BootstrapInterval one = BootstrapRatio({{3, 4}}, 0.95, 10);
  EXPECT_DOUBLE_EQ(one.low, 0.75);
  EXPECT_DOUBLE_EQ(one.high, 0.75);
  const BootstrapInterval none = BootstrapRatio({{0, 0}, {0, 0}}, 0.95, 10);
  EXPECT_TRUE(std::isnan(none.ratio));
  EXPECT_TRUE(std::isnan(none.low));
  EXPECT_TRUE(std::isnan(none.high));
  EXPECT_EQ(none.resamples, 0);
  // A quarter of the resamples draws only the world where nothing was said.
  const BootstrapInterval silent = BootstrapRatio({{1, 2}, {0, 0}}, 0.95, 1000);
  EXPECT_DOUBLE_EQ(silent.low, 0.5);
  EXPECT_DOUBLE_EQ(silent.high, 0.5);
  EXPECT_NEAR(silent.resamples, 750, 60);
  EXPECT_THROW(BootstrapRatio({}), InputError);
  EXPECT_THROW(BootstrapRatio({{1, -1}}), InputError);
  EXPECT_THROW(BootstrapRatio({{std::nan(""), 1}}), InputError);
  EXPECT_THROW(BootstrapRatio({{1, 1}}, 1.0), InputError);
  EXPECT_THROW(BootstrapRatio({{1, 1}}, 0.95, 0), InputError);
}

}  // namespace
}  // namespace tutti
