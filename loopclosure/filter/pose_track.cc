#include "loopclosure/filter/pose_track.h"

#include <algorithm>
#include <cmath>

#include "core/numbers.h"
#include "core/state_archive.h"

namespace tutti {

template <class Archive>
void State(Archive& archive, PosePrior& prior) {
  archive(prior.position_m, prior.frame, prior.sigma_m, prior.drift);
}

namespace internal {

void PoseTrack::Add(int slot, const std::optional<PosePrior>& prior) {
  if (prior) {
    if (last_ && last_->frame == prior->frame) way_m_ += (prior->position_m - last_->position_m).norm();
    last_ = prior;
  }
  stations_.resize(internal::Index(slot));
  stations_.push_back({prior, way_m_});
}

void PoseTrack::Forget() {
  for (Station& station : stations_) station.prior.reset();
  last_.reset();
}

std::vector<double> PoseTrack::Gains(const std::vector<int>& working_memory) const {
  if (stations_.empty() || !stations_.back().prior) return {};
  const Station& here = stations_.back();
  std::vector<double> gains(stations_.size(), 1.0);
  std::vector<std::size_t> known;
  double sum = 0;
  for (const int slot : working_memory) {
    const auto i = internal::Index(slot);
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

template <class Archive>
void PoseTrack::State(Archive& archive) {
  archive(stations_, way_m_, last_);
  if constexpr (Archive::kReading) {
    const auto check = [&archive](const std::optional<PosePrior>& prior) {
      if (prior && (!prior->position_m.allFinite() || !(prior->sigma_m > 0) || !(prior->drift >= 0)))
        archive.Damaged("a position that is none");
    };
    for (const Station& station : stations_) check(station.prior);
    check(last_);
  }
}

template void PoseTrack::State(StateWriter& archive);
template void PoseTrack::State(StateReader& archive);

void ApplyGains(const std::vector<double>& gains, const std::vector<int>& working_memory,
                Belief& likelihood) {
  if (gains.empty()) return;
  for (const int slot : working_memory) {
    const auto i = internal::Index(slot);
    if (i >= likelihood.places.size()) continue;
    double& value = likelihood.places[i];
    value = gains[i] <= 1 ? gains[i] * value : value + (gains[i] - 1) * std::max(0.0, value - 1);
  }
}

}  // namespace internal
}  // namespace tutti
