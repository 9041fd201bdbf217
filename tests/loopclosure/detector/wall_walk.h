// A walk along a wall, for members that compare whole images along the way.
#pragma once

#include "tests/loopclosure/features/textured_image.h"

namespace tutti::testing {

constexpr int kWallPlaces = 40;

/// The image of 160x120 pixels at a place of the wall, a quarter of the width further in each, so that
/// neighbours overlap. Wall 77, or another one.
inline cv::Mat AlongWall(int place, std::uint32_t wall = 77) {
  static const cv::Mat whole = TexturedImage(77, 160 + 40 * kWallPlaces, 120);
  static const cv::Mat another = TexturedImage(78, 160 + 40 * kWallPlaces, 120);
  return (wall == 77 ? whole : another)(cv::Rect(40 * place, 0, 160, 120)).clone();
}

}  // namespace tutti::testing
