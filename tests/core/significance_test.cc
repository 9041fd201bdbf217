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

}  // namespace
}  // namespace tutti
