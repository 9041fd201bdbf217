#include "loopclosure/features/polar.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tutti {
namespace {

TEST(Polar, LengthAndDirectionOfEveryDirection) {
  constexpr std::size_t kCount = 3601;
  std::vector<float> dx(internal::RoomForPolar(kCount)), dy(dx.size()), length(dx.size()), angle(dx.size());
  for (std::size_t i = 0; i < kCount; ++i) {
    const double direction = static_cast<double>(i) / 10.0 * M_PI / 180.0;
    const double r = 0.01 + static_cast<double>(i % 300);
    dx[i] = static_cast<float>(r * std::cos(direction));
    dy[i] = static_cast<float>(r * std::sin(direction));
  }
  internal::Polar(dx.data(), dy.data(), kCount, length.data(), angle.data());
  for (std::size_t i = 0; i < kCount; ++i) {
    const float r = 0.01f + static_cast<float>(i % 300);
    EXPECT_NEAR(length[i], r, 1e-5f * r);
    EXPECT_NEAR(std::remainder(angle[i] - static_cast<float>(i) / 10.0f, 360.0f), 0, 0.02f) << i;
    EXPECT_GE(angle[i], 0);
    EXPECT_LE(angle[i], 360);
  }
}

TEST(Polar, NoGradientHasNoLengthAndAFiniteDirection) {
  const std::vector<float> zero(4);
  std::vector<float> length(4, 1), angle(4, 1);
  internal::Polar(zero.data(), zero.data(), 1, length.data(), angle.data());
  EXPECT_EQ(length[0], 0);
  EXPECT_EQ(angle[0], 0);
}

}  // namespace
}  // namespace tutti
