// A walk past textured places, and past the same places again.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "tests/loopclosure/features/textured_image.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::testing {

/// Few features and a short-term memory that a short walk leaves.
inline LoopDetectorOptions SmallOptions() {
  LoopDetectorOptions options;
  options.stm_size = 3;
  options.extraction.features = 150;
  return options;
}

/// Image number i of a walk of `places` places that starts again and again.
inline cv::Mat WalkImage(int i, int places) {
  const cv::Mat place = TexturedImage(static_cast<std::uint32_t>(i % places), 240, 180);
  return i < places ? place : SeenAgain(place);
}

/// An image whose number is its time stamp, too.
inline LoopQuery Query(std::int64_t id, const cv::Mat& image) {
  LoopQuery query;
  query.id = id;
  query.stamp_s = static_cast<double>(id);
  query.image = image;
  return query;
}

/// What the detector says of so many places, in larger images, and of the first ones again.
inline std::vector<LoopResult> TwoLaps(const LoopDetectorOptions& options, int places = 18, int again = 8) {
  LoopDetector detector(options);
  std::vector<LoopResult> results;
  for (int i = 0; i < places + again; ++i) {
    const cv::Mat place = TexturedImage(static_cast<std::uint32_t>(i % places));
    results.push_back(detector.Detect(Query(i, i < places ? place : SeenAgain(place))));
  }
  return results;
}

/// Shows the images begin .. end - 1 of the walk.
inline std::vector<LoopResult> Walk(LoopDetector& detector, int begin, int end, int places) {
  std::vector<LoopResult> results;
  for (int i = begin; i < end; ++i) results.push_back(detector.Detect(WalkImage(i, places), i));
  return results;
}

/// Images whose loop was closed with the right place.
inline int CountTrue(const std::vector<LoopResult>& results, int places) {
  int found = 0;
  for (const LoopResult& result : results) {
    if (result.accepted && result.candidate % places == result.query % places) ++found;
  }
  return found;
}

inline int CountFalse(const std::vector<LoopResult>& results, int places) {
  int wrong = 0;
  for (const LoopResult& result : results) {
    if (result.accepted && result.candidate % places != result.query % places) ++wrong;
  }
  return wrong;
}

/// Bit by bit the same.
inline void ExpectEqual(const std::vector<LoopResult>& a, const std::vector<LoopResult>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].query, b[i].query) << i;
    EXPECT_EQ(a[i].hypothesis, b[i].hypothesis) << i;
    EXPECT_EQ(a[i].candidate, b[i].candidate) << i;
    EXPECT_EQ(a[i].best, b[i].best) << i;
    EXPECT_EQ(a[i].posterior, b[i].posterior) << i;
    EXPECT_EQ(a[i].verification.candidate, b[i].verification.candidate) << i;
    EXPECT_EQ(a[i].verification.inliers, b[i].verification.inliers) << i;
    EXPECT_EQ(a[i].reason, b[i].reason) << i;
    EXPECT_EQ(a[i].retrieved, b[i].retrieved) << i;
    EXPECT_EQ(a[i].transferred, b[i].transferred) << i;
  }
}

}  // namespace tutti::testing
