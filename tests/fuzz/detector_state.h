// Saved detectors for fuzzing: small ones.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <string_view>

#include "loopclosure/detector/detector_file.h"
#include "tests/fuzz/sections.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::fuzz {

constexpr int kKinds = 4;
constexpr std::uint32_t kEndTag = 8;

/// Two external members, so that no time goes into extraction; a kind for each sort of memory and rule.
inline LoopDetectorOptions StateOptions(int kind) {
  LoopDetectorOptions options;
  options.members = {"floats", "bits"};
  options.external_members = options.members;
  options.threads = 1;
  options.stm_size = 1;
  options.wm_limit = 2;
  options.recent_share = 0.0;
  options.loop_threshold = 0.01;
  options.verification.min_inliers = 8;
  options.verification.min_epipolar_inliers = 8;
  options.ignore_bad_signatures = kind % 2 == 1;
  if (kind == 1) options.memory = MemoryKind::kPerMember;
  if (kind == 1) options.rule = CombinationRule::kMean;  // the default needs a memory that all share
  if (kind == 1) options.rehearsal = true;
  if (kind == 2) options.rule = CombinationRule::kNaive;
  if (kind == 3) options.rule = CombinationRule::kMajority;
  if (kind == 3) options.likelihood = LikelihoodKind::kSimilarity;
  return options;
}

/// Ten features of a place; with a camera and depth, or without.
inline LoopQuery StateQuery(std::int64_t id, std::uint32_t place, bool calibrated) {
  constexpr int kFeatures = 10;
  LoopQuery query;
  query.id = id;
  query.image = cv::Mat(24, 32, CV_8UC1, cv::Scalar(128));
  query.metric = calibrated;
  if (calibrated) {
    query.camera = PinholeCamera();
    query.camera->width = 32;
    query.camera->height = 24;
    query.camera->fx = query.camera->fy = 30.0;
    query.camera->cx = 16.0;
    query.camera->cy = 12.0;
    query.depth_m = cv::Mat(24, 32, CV_32FC1, cv::Scalar(2.0));
  }
  std::mt19937 generator(place);
  Features floats;
  floats.descriptors.create(kFeatures, 4, CV_32F);
  Features bits;
  bits.descriptors.create(kFeatures, 4, CV_8U);
  for (int i = 0; i < kFeatures; ++i) {
    const float x = static_cast<float>(3 + 6 * (i % 5)) + static_cast<float>(generator() % 3);
    const float y = static_cast<float>(4 + 11 * (i / 5)) + static_cast<float>(generator() % 5);
    floats.keypoints.emplace_back(cv::Point2f(x, y), 3.0f);
    for (int c = 0; c < 4; ++c) {
      floats.descriptors.at<float>(i, c) = static_cast<float>(generator() % 1000) * 0.25f;
      bits.descriptors.at<std::uint8_t>(i, c) = static_cast<std::uint8_t>(generator() & 255u);
    }
  }
  bits.keypoints = floats.keypoints;
  query.features.keypoints = floats.keypoints;
  query.features.descriptors = bits.descriptors.clone();
  query.member_features = {{"floats", floats}, {"bits", bits}};
  return query;
}

/// A saved detector's file from what PutSections takes.
inline std::string WrapState(std::string_view sections) {
  return FileOf(internal::kDetectorFile, sections, {kEndTag, internal::kEndOfSections});
}

}  // namespace tutti::fuzz
