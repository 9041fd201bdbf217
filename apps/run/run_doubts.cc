#include "apps/run/run_doubts.h"

#include <algorithm>

namespace tutti {
namespace {

constexpr double kLeastPosed = 0.95;        // of the frames that could be read
constexpr std::ptrdiff_t kMostRefused = 2;  // verified loops that did not enter the map

std::string Of(std::ptrdiff_t part, std::ptrdiff_t whole) {
  return std::to_string(part) + " of " + std::to_string(whole);
}

}  // namespace

std::vector<std::string> DoubtsAbout(const RunResult& r) {
  std::vector<std::string> doubts;
  if (r.appearance_only || r.Void()) return doubts;
  if (r.camera_guessed)
    doubts.push_back("the camera is not calibrated (" + r.camera_source +
                     "): turns and lengths can be wrong by tens of percent");
  const auto read = static_cast<std::ptrdiff_t>(r.frames_total - r.bad.size() - r.frames_dropped);
  const auto posed = static_cast<std::ptrdiff_t>(r.frames_tracked);
  if (static_cast<double>(posed) < kLeastPosed * static_cast<double>(read)) {
    doubts.push_back(
        "only " + Of(posed, read) +
        " frames have a pose in trajectory.txt; lost when they came: " + std::to_string(r.frames_lost) +
        ", pieces of the map that were not joined to it: " + std::to_string(r.other_pieces.size()));
  }
  // What is younger is in the local map, and was never to enter.
  const auto recognised = [&](const LoopRecord& loop) {
    return loop.verified && !loop.injected &&
           loop.query_stamp_s - loop.candidate_stamp_s >= r.config.run.loop_min_age_s;
  };
  const auto all = std::count_if(r.loops.begin(), r.loops.end(), recognised);
  const auto refused = std::count_if(r.loops.begin(), r.loops.end(), [&](const LoopRecord& loop) {
    return recognised(loop) && !loop.accepted;
  });
  if (refused > kMostRefused && 2 * refused > all) {
    doubts.push_back("the map contradicts " + Of(refused, all) +
                     " loops that were recognised (loops.csv says why): its shape or scale may be wrong");
  }
  return doubts;
}

}  // namespace tutti
