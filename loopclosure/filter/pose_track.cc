#include "loopclosure/filter/pose_track.h"

#include <algorithm>
#include <cmath>

namespace tutti::internal {

void PoseTrack::Add(int slot, const std::optional<PosePrior>& prior) {
  if (prior) {
    if (last_ && last_->frame == prior->frame) way_m_ += (prior->position_m - last_->position_m).norm();
    last_ = prior;
  }
  stations_.resize(static_cast<std::size_t>(slot));
  stations_.push_back({prior, way_m_});
}

std::vector<double> PoseTrack::Gains(const std::vector<int>& working_memory) const {
  if (stations_.empty() || !stations_.back().prior) return {};
  const Station& here = stations_.back();
  std::vector<double> gains(stations_.size(), 1.0);
  std::vector<std::size_t> known;
  double sum = 0;
  for (const int slot : working_memory) {
    const auto i = static_cast<std::size_t>(slot);
    const std::optional<PosePrior>& there = stations_[i].prior;
    if (!there || there->frame != here.prior->frame) continue;
    const double sigma = here.prior->sigma_m + here.prior->drift * (here.way_m - stations_[i].way_m);
    const double off = (here.prior->position_m - there->position_m).norm() / sigma;
    gains[i] = std::exp(std::max(kLogLeast, -0.5 * off * off));
    sum += gains[i];
    known.push_back(i);
  }
  if (known.empty()) return {};
  const double scale = static_cast<double>(known.size()) / sum;
  for (const std::size_t i : known) gains[i] = std::min(kMostGain, gains[i] * scale);
  return gains;
}

void ApplyGains(const std::vector<double>& gains, const std::vector<int>& working_memory,
                Belief& likelihood) {
  if (gains.empty()) return;
  for (const int slot : working_memory) {
    const auto i = static_cast<std::size_t>(slot);
    if (i >= likelihood.places.size()) continue;
    double& value = likelihood.places[i];
    value = gains[i] <= 1 ? gains[i] * value : value + (gains[i] - 1) * std::max(0.0, value - 1);
  }
}

}  // namespace tutti::internal
