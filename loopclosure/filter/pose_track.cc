#include "loopclosure/filter/pose_track.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tutti::internal {
namespace {

void SavePrior(const std::optional<PosePrior>& prior, ByteWriter& out) {
  out.Put<std::uint8_t>(prior ? 1 : 0);
  if (!prior) return;
  for (const double value : prior->position_m) out.Put(value);
  out.Put(prior->frame);
  out.Put(prior->sigma_m);
  out.Put(prior->drift);
}

std::optional<PosePrior> LoadPrior(ByteReader& in) {
  if (in.Get<std::uint8_t>() == 0) return std::nullopt;
  PosePrior prior;
  for (double& value : prior.position_m) value = in.Get<double>();
  prior.frame = in.Get<std::int64_t>();
  prior.sigma_m = in.Get<double>();
  prior.drift = in.Get<double>();
  if (!prior.position_m.allFinite() || !(prior.sigma_m > 0) || !(prior.drift >= 0))
    in.Damaged("a position that is none");
  return prior;
}

}  // namespace

void PoseTrack::Add(int slot, const std::optional<PosePrior>& prior) {
  if (prior) {
    if (last_ && last_->frame == prior->frame) way_m_ += (prior->position_m - last_->position_m).norm();
    last_ = prior;
  }
  stations_.resize(static_cast<std::size_t>(slot));
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

void PoseTrack::Save(ByteWriter& out) const {
  out.Put<std::uint64_t>(stations_.size());
  for (const Station& station : stations_) {
    SavePrior(station.prior, out);
    out.Put(station.way_m);
  }
  out.Put(way_m_);
  SavePrior(last_, out);
}

void PoseTrack::Load(ByteReader& in) {
  stations_.clear();
  const std::size_t count = in.GetCount(1 + sizeof(double));
  for (std::size_t i = 0; i < count; ++i) {
    std::optional<PosePrior> prior = LoadPrior(in);
    stations_.push_back({std::move(prior), in.Get<double>()});
  }
  way_m_ = in.Get<double>();
  last_ = LoadPrior(in);
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
