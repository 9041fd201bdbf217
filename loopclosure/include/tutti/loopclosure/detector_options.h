// Options of the loop-closure detector.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tutti {

/// How the members' posteriors become one (loop-closure.md section 4).
enum class CombinationRule { kMean, kProduct, kMajority, kNaive, kSingle };

/// Options of LoopDetector.
struct LoopDetectorOptions {
  CombinationRule rule = CombinationRule::kMean;                ///< how members are combined
  std::vector<std::string> members = {"surf", "sift", "orb"};   ///< names of the members
  double loop_threshold = 0.11;                                 ///< accept at H >= this, 0..1
  int stm_size = 10;                                            ///< locations in short-term memory
  int threads = 2;                                              ///< most threads that Detect uses at once
  std::uint64_t seed = 1;                                       ///< of kd-forests and RANSAC
};

}  // namespace tutti
