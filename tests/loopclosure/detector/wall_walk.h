// A walk along a wall, for members that compare whole images along the way.
#pragma once

#include <cstdlib>
#include <functional>
#include <vector>

#include "tests/loopclosure/features/textured_image.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::testing {

constexpr int kWallPlaces = 40;

/// The image of 160x120 pixels at a place of the wall, a quarter of the width further in each, so that
/// neighbours overlap. Wall 77, or another one.
inline cv::Mat AlongWall(int place, std::uint32_t wall = 77) {
  static const cv::Mat whole = TexturedImage(77, 160 + 40 * kWallPlaces, 120);
  static const cv::Mat another = TexturedImage(78, 160 + 40 * kWallPlaces, 120);
  return (wall == 77 ? whole : another)(cv::Rect(40 * place, 0, 160, 120)).clone();
}

/// The wall by day, and then its first places again, each image as `again` makes it of the number of the
/// place.
inline std::vector<LoopResult> TwoWalks(const LoopDetectorOptions& options, int images_again,
                                        const std::function<cv::Mat(int)>& again) {
  LoopDetector detector(options);
  std::vector<LoopResult> results;
  for (int i = 0; i < kWallPlaces + images_again; ++i)
    results.push_back(detector.Detect(i < kWallPlaces ? AlongWall(i) : again(i - kWallPlaces), i));
  return results;
}

/// Images of the second walk whose place, or one beside it, is believed in.
inline int PlacesFound(const std::vector<LoopResult>& results) {
  int found = 0;
  for (std::size_t i = kWallPlaces; i < results.size(); ++i) {
    const bool near = std::abs(results[i].best - (results[i].query - kWallPlaces)) <= 1;
    if (near && results[i].hypothesis >= 0.5) ++found;
  }
  return found;
}

}  // namespace tutti::testing
