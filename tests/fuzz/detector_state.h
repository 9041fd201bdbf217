// Saved detectors for fuzzing: small ones, and their files without what random bytes would never get past
// (lengths, checksums, the 6 KB of a random generator's state).
#pragma once

#include <cstdint>
#include <random>
#include <sstream>
#include <string>
#include <string_view>

#include "core/byte_stream.h"
#include "core/section_file.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::fuzz {

constexpr int kKinds = 4;
constexpr std::string_view kHeader("TUTTILC\n\x07\0\0\0\x04\x03\x02\x01", 16);
constexpr std::string_view kGeneratorMark = "<RNG>";
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
  options.vocabulary.trees = 2;
  options.vocabulary.hash_tables = 2;
  options.verification.min_inliers = 8;
  options.verification.min_epipolar_inliers = 8;
  options.verification.max_iterations = 20;
  options.ignore_bad_signatures = kind % 2 == 1;
  if (kind == 1) options.memory = MemoryKind::kPerMember;
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

/// A saved detector's file from sections of one byte tag, two bytes size, content; a last one that is cut off
/// counts with what is there.
inline std::string WrapState(std::string_view sections) {
  static const std::string generator = [] {
    std::ostringstream text;
    text << std::mt19937_64(1);
    internal::ByteWriter out;
    out.PutString(text.str());
    return out.bytes();
  }();
  internal::ByteWriter file;
  file.PutRaw(kHeader.data(), kHeader.size());
  const auto put = [&](std::uint32_t tag, const std::string& content) {
    internal::SectionHeader header = {tag, 0, content.size(), content.size(), 0};
    header.checksum = internal::SectionChecksum(header, content);
    file.Put(header);
    file.PutRaw(content.data(), content.size());
  };
  while (sections.size() >= 3) {
    const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(sections[i]); };
    const std::uint32_t tag = byte(0);
    std::string content(sections.substr(3, byte(1) + 256u * byte(2)));
    sections.remove_prefix(3 + content.size());
    for (std::size_t at = content.find(kGeneratorMark); at != std::string::npos;
         at = content.find(kGeneratorMark, at + generator.size())) {
      content.replace(at, kGeneratorMark.size(), generator);
    }
    put(tag, content);
  }
  put(kEndTag, "");
  put(internal::kEndOfSections, "");
  return file.bytes();
}

}  // namespace tutti::fuzz
