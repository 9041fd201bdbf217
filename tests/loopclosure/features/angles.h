// Orientations of features in tests.
#pragma once

#include <cmath>

namespace tutti::testing {

/// How far two directions are apart [deg], 0 to 180.
inline double AnglesApart(double a_deg, double b_deg) {
  return std::abs(std::remainder(a_deg - b_deg, 360.0));
}

}  // namespace tutti::testing
