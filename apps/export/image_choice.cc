#include "apps/export/image_choice.h"

#include <algorithm>
#include <iterator>
#include <limits>

#include "core/numbers.h"

namespace tutti {
namespace {

// How far the camera has come at each keyframe: the sum of its steps, as shares of the whole way that it
// moved and of the whole angle that it turned.
std::vector<double> Ways(const std::vector<ModelKeyframe>& keyframes) {
  std::vector<double> moved(keyframes.size(), 0), turned(keyframes.size(), 0);
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    const Pose step = keyframes[i - 1].T_world_camera.Inverse() * keyframes[i].T_world_camera;
    moved[i] = moved[i - 1] + step.translation.norm();
    turned[i] = turned[i - 1] + step.Angle();
  }
  std::vector<double> ways(keyframes.size(), 0);
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    if (moved.back() > 0) ways[i] += moved[i] / moved.back();
    if (turned.back() > 0) ways[i] += turned[i] / turned.back();
  }
  return ways;
}

// Sharpness compared with the median of the neighbours, 1 for an image like them.
std::vector<double> RelativeSharpness(const std::vector<std::size_t>& candidates,
                                      const std::vector<std::optional<double>>& sharpness) {
  constexpr std::size_t kAround = 5;
  std::vector<double> relative;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    std::vector<double> around;
    for (std::size_t j = i - std::min(i, kAround); j < std::min(candidates.size(), i + kAround + 1); ++j)
      around.push_back(*sharpness[candidates[j]]);
    const double median = internal::Median(around);
    relative.push_back(median > 0 ? *sharpness[candidates[i]] / median : 1);
  }
  return relative;
}

}  // namespace

std::vector<std::size_t> ChooseImages(const std::vector<ModelKeyframe>& keyframes,
                                      const std::vector<std::optional<double>>& sharpness, std::size_t most) {
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    if (sharpness[i]) chosen.push_back(i);
  }
  if (chosen.size() <= most) return chosen;
  const std::vector<double> ways = Ways(keyframes);
  std::vector<double> sharp = RelativeSharpness(chosen, sharpness);
  if (most == 1) {
    const auto best = std::max_element(sharp.begin(), sharp.end());
    return {chosen[static_cast<std::size_t>(best - sharp.begin())]};
  }
  while (chosen.size() > most) {
    std::size_t least = 0;
    double least_missed = std::numeric_limits<double>::infinity();
    for (std::size_t i = 1; i + 1 < chosen.size(); ++i) {
      const double missed = (ways[chosen[i + 1]] - ways[chosen[i - 1]]) * sharp[i];
      if (missed < least_missed) {
        least = i;
        least_missed = missed;
      }
    }
    chosen.erase(std::next(chosen.begin(), static_cast<std::ptrdiff_t>(least)));
    sharp.erase(std::next(sharp.begin(), static_cast<std::ptrdiff_t>(least)));
  }
  return chosen;
}

}  // namespace tutti
