// How much each member counts, and who says the same as another.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <random>
#include <string>

#include "core/state_archive.h"
#include "loopclosure/filter/alias_evidence.h"
#include "tests/loopclosure/filter/image_counts.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::Places;
using testing::Resemblances;

TEST(MemberWeight, IsTheMeanOfWhatRepeatsOverTheMeanSquareOfWhatIsWrong) {
  MemberWeight weight;
  EXPECT_NEAR(weight.Value(), 0.1, 1e-12) << "knows nothing yet";
  for (const double repeated : {2.0, 6.0, 7.0}) weight.Repeat(repeated);
  for (const double wrong : {1.0, 3.0}) {
    std::vector<double> counts(40, 0.0);
    counts[8] = wrong;
    weight.Learn(counts, Places(40), {});
    weight.Learn(std::vector<double>(20, 9.0), Places(20), {});  // too few places to say anything
  }
  EXPECT_NEAR(weight.Value(), (5.0 + 0.1) / (5.0 + 1.0), 1e-12);
}

TEST(MemberWeight, LearnsNothingFromWhereTheImageWasTaken) {
  MemberWeight weight;
  std::vector<double> counts(40, 0.0);
  counts[4] = 100;
  weight.Repeat(20);
  weight.Learn(counts, Places(40), {3, 4, 5});
  EXPECT_NEAR(weight.Value(), 20.1, 1e-9);
}

// Counts of a member that looks at the same images as another: partly alike, or the same but for chance.
std::vector<double> Alike(const std::vector<double>& counts, double noise, std::mt19937& random) {
  std::normal_distribution<double> normal(0.0, noise);
  std::vector<double> alike;
  alike.reserve(counts.size());
  for (const double count : counts) alike.push_back(std::max(0.0, count + normal(random)));
  return alike;
}

// Over the places where the image was not taken, and over all images.
double CorrelationOf(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b) {
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t image = 0; image < a.size(); ++image) {
    const double places = static_cast<double>(a[image].size());
    const double mean_a = std::accumulate(a[image].begin(), a[image].end(), 0.0) / places;
    const double mean_b = std::accumulate(b[image].begin(), b[image].end(), 0.0) / places;
    for (std::size_t i = 0; i < a[image].size(); ++i) {
      ab += (a[image][i] - mean_a) * (b[image][i] - mean_b);
      aa += std::pow(a[image][i] - mean_a, 2);
      bb += std::pow(b[image][i] - mean_b, 2);
    }
  }
  return ab / std::sqrt(aa * bb);
}

TEST(MemberOverlap, IsTheEighthPowerOfTheCorrelationOfCounts) {
  MemberOverlap overlap;
  EXPECT_EQ(overlap.Copies(7), 1.0) << "before anything is known";
  std::mt19937 random(5);
  std::vector<std::vector<double>> first, second;
  for (int i = 0; i < 6; ++i) {
    first.push_back(Resemblances(30, 10, random));
    second.push_back(Alike(first.back(), 2.0, random));
    overlap.Learn({&first.back(), &second.back()}, Places(30), {});
  }
  const double expected = 1 + std::pow(CorrelationOf(first, second), 8);
  EXPECT_GT(expected, 1.2);
  EXPECT_NEAR(overlap.Copies(0), expected, 1e-9);
  EXPECT_NEAR(overlap.Copies(1), expected, 1e-9);
}

TEST(MemberOverlap, LearnsNothingFromWhereTheImageWasTakenNorFromWhoSatOut) {
  MemberOverlap overlap;
  std::mt19937 random(2);
  for (int i = 0; i < 50; ++i) {
    std::vector<double> first = Resemblances(100, 10, random);
    std::vector<double> second = Resemblances(100, 10, random);
    for (std::size_t slot = 40; slot < 45; ++slot) first[slot] = second[slot] = 500;  // both know the place
    overlap.Learn({&first, &second, nullptr}, Places(100), {40, 41, 42, 43, 44});
  }
  EXPECT_LT(overlap.Copies(0), 1.05);
  EXPECT_EQ(overlap.Copies(2), 1.0);
}

TEST(MemberOverlap, GoesOnWhereItWasSavedAndRefusesDamage) {
  MemberOverlap overlap;
  std::mt19937 random(3);
  const std::vector<double> first = Resemblances(100, 10, random);
  overlap.Learn({&first, &first}, Places(100), {});
  const std::string bytes = internal::StateBytes(overlap);
  MemberOverlap again;
  internal::ReadStateBytes(bytes, "memory", again);
  EXPECT_EQ(again.Copies(1), overlap.Copies(1));
  std::string damaged = bytes;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::memcpy(damaged.data() + damaged.size() - sizeof nan, &nan, sizeof nan);
  EXPECT_THROW(internal::ReadStateBytes(damaged, "memory", again), InputError);
  const std::string three = internal::StateBytes(std::vector<double>(3, 1.0));  // of two members or more?
  EXPECT_THROW(internal::ReadStateBytes(three, "memory", again), InputError);
}

}  // namespace
}  // namespace tutti
