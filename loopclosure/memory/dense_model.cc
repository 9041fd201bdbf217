#include "loopclosure/memory/dense_model.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/numbers.h"
#include "core/state_archive.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr std::size_t kTooFewToStandOut = 12;  // in so few, nothing can stand out
constexpr double kDeviation = 1.4826;          // standard deviations of a normal law in a median deviation
constexpr double kLeastDeviation = 0.002;      // of scores: cosines differ by so much without a reason
constexpr double kPlain = 2.0;                 // standard deviations that say nothing
constexpr double kMost = 20.0;                 // counts of one place
constexpr double kHalfWay = 4.0;               // standard deviations beyond kPlain that make half of them

using internal::Index;

float Cosine(const cv::Mat& a, const cv::Mat& b) {
  if (a.empty() || b.empty()) return 0.0f;
  using Vector = Eigen::Map<const Eigen::VectorXf>;
  return Vector(a.ptr<float>(), a.cols).dot(Vector(b.ptr<float>(), b.cols));
}

}  // namespace

std::string DescriptorProblem(const cv::Mat& descriptor, int width) {
  if (descriptor.empty()) return {};
  if (descriptor.rows != 1 || descriptor.type() != CV_32F) {
    return "a dense member has one row of CV_32F (or none, and sits the image out)";
  }
  if (!cv::checkRange(descriptor)) return "a value of the descriptor is not a finite number";
  if (width > 0 && descriptor.cols != width) {
    return "the descriptor has " + std::to_string(descriptor.cols) + " values, but those before had " +
           std::to_string(width) + "; give every image the same kind";
  }
  return {};
}

void DenseModel::Add(const cv::Mat& descriptor) {
  const std::string problem = Problem(descriptor);
  if (!problem.empty()) throw InputError(problem);
  // What was merged away counted for its own image alone.
  if (!recent_.empty() && presence_[Index(recent_.back().slot)] == Presence::kMerged) recent_.pop_back();
  descriptors_.push_back(descriptor);
  presence_.push_back(Presence::kPresent);
  if (!descriptor.empty()) width_ = descriptor.cols;
  if (static_cast<int>(recent_.size()) < kSequence - 1) {
    MakeRecent();
  } else {
    recent_.push_back(MakeRow(size() - 1));
  }
  if (static_cast<int>(recent_.size()) > kSequence) recent_.erase(recent_.begin());
  // The older rows have the new one's cosines from the new row.
  const Row& now = recent_.back();
  for (Row& row : recent_) {
    if (row.cosines.empty()) continue;
    row.cosines.resize(descriptors_.size(), 0.0f);
    row.cosines.back() = now.cosines.empty() ? 0.0f : now.cosines[Index(row.slot)];
  }
}

DenseModel::Row DenseModel::MakeRow(int slot) const {
  Row row;
  row.slot = slot;
  const cv::Mat& own = descriptors_[Index(slot)];
  if (own.empty()) return row;
  row.cosines = Cosines(own);
  return row;
}

std::vector<float> DenseModel::Cosines(const cv::Mat& descriptor) const {
  std::vector<float> cosines;
  cosines.reserve(descriptors_.size() + 1);  // a row gets one more with the next image
  for (const cv::Mat& other : descriptors_) cosines.push_back(Cosine(descriptor, other));
  return cosines;
}

void DenseModel::MakeRecent() {
  recent_.clear();
  for (int slot = size() - 1; slot >= 0 && static_cast<int>(recent_.size()) < kSequence; --slot) {
    if (presence_[Index(slot)] != Presence::kMerged) recent_.push_back(MakeRow(slot));
  }
  std::reverse(recent_.begin(), recent_.end());
}

void DenseModel::Drop(int slot) {
  presence_[Index(slot)] = Presence::kMerged;
  // Its row stays for the present image.
  descriptors_[Index(slot)] = cv::Mat();
}

void DenseModel::Remove(int slot) {
  if (presence_[Index(slot)] != Presence::kPresent) return;
  presence_[Index(slot)] = Presence::kAbsent;
  descriptors_[Index(slot)] = cv::Mat();
  for (Row& row : recent_) {
    if (row.slot == slot) row.cosines.clear();
    if (!row.cosines.empty()) row.cosines[Index(slot)] = 0.0f;
  }
}

void DenseModel::Restore(int slot, const cv::Mat& descriptor) {
  if (presence_[Index(slot)] == Presence::kPresent) return;
  presence_[Index(slot)] = Presence::kPresent;
  descriptors_[Index(slot)] = descriptor;
  if (!descriptor.empty()) width_ = descriptor.cols;
  for (Row& row : recent_) {
    if (row.slot == slot) {
      row = MakeRow(slot);
    } else if (!row.cosines.empty()) {
      row.cosines[Index(slot)] = Cosine(descriptors_[Index(row.slot)], descriptor);
    }
  }
}

void DenseModel::AddAbsent(bool merged) {
  descriptors_.emplace_back();
  presence_.push_back(merged ? Presence::kMerged : Presence::kAbsent);
}

void DenseModel::FinishLoading() { MakeRecent(); }

std::vector<int> DenseModel::Path() const {
  std::vector<int> path;
  path.reserve(descriptors_.size());
  const int newest = recent_.empty() ? -1 : recent_.back().slot;
  for (int slot = 0; slot < size(); ++slot) {
    if (presence_[Index(slot)] != Presence::kMerged || slot == newest) path.push_back(slot);
  }
  return path;
}

double DenseModel::MeanOver(const std::vector<int>& places, const Row& row) const {
  double mean = 0;
  int known = 0;
  for (const int slot : places) {
    if (descriptors_[Index(slot)].empty()) continue;
    mean += static_cast<double>(row.cosines[Index(slot)]);
    ++known;
  }
  return known > 0 ? mean / known : mean;
}

// Pairs each of the last images with what lies as far before each place of the path:
// call(place, cosine - level_of(row of the image)).
template <typename LevelOf, typename Call>
void DenseModel::ForEachPair(LevelOf level_of, Call call) const {
  const std::vector<int> path = Path();
  std::size_t back = 0;
  for (auto row = recent_.rbegin(); row != recent_.rend(); ++row, ++back) {
    if (row->cosines.empty()) continue;
    const double level = level_of(*row);
    for (std::size_t p = back; p < path.size(); ++p) {
      const int before = path[p - back];
      if (descriptors_[Index(before)].empty()) continue;
      call(Index(path[p]), static_cast<double>(row->cosines[Index(before)]) - level);
    }
  }
}

std::vector<double> DenseModel::Counts(const std::vector<int>& places) const {
  std::vector<double> sums(descriptors_.size(), 0.0);
  if (recent_.empty() || places.size() < kTooFewToStandOut) return sums;
  ForEachPair([&](const Row& row) { return MeanOver(places, row); },
              [&](std::size_t place, double above_mean) { sums[place] += above_mean / kSequence; });
  return Contrast(std::move(sums), places);
}

std::vector<double> DenseModel::Contrast(std::vector<double> scores, const std::vector<int>& places) {
  std::vector<double> counts(scores.size(), 0.0);
  if (places.size() < kTooFewToStandOut) return counts;
  std::vector<double> values;
  values.reserve(places.size());
  for (const int slot : places) values.push_back(scores[Index(slot)]);
  const double median = internal::Median(values);
  for (double& value : values) value = std::abs(value - median);
  const double deviation = std::max(kLeastDeviation, kDeviation * internal::Median(std::move(values)));
  for (std::size_t i = 0; i < scores.size(); ++i) {
    const double beyond = std::max(0.0, (scores[i] - median) / deviation - kPlain);
    counts[i] = kMost * beyond / (beyond + kHalfWay);
  }
  return counts;
}

std::vector<double> DenseModel::CountsOf(const cv::Mat& descriptor, const std::vector<int>& places) const {
  const std::vector<float> cosines = Cosines(descriptor);
  return Contrast({cosines.begin(), cosines.end()}, places);
}

std::vector<double> DenseModel::Scores() const {
  std::vector<double> sums(descriptors_.size(), 0.0);
  if (recent_.empty()) return sums;
  std::vector<int> terms(descriptors_.size(), 0);
  ForEachPair([](const Row&) { return 0.0; },
              [&](std::size_t place, double cosine) {
                sums[place] += cosine;
                ++terms[place];
              });
  for (std::size_t i = 0; i < sums.size(); ++i) {
    sums[i] = descriptors_[i].empty() ? 0.0 : std::max(0.0, sums[i] / std::max(1, terms[i]));
  }
  return sums;
}

std::vector<double> DenseModel::ScoresOf(const cv::Mat& descriptor) const {
  const std::vector<float> cosines = Cosines(descriptor);
  std::vector<double> scores(cosines.begin(), cosines.end());
  for (double& score : scores) score = std::max(0.0, score);
  return scores;
}

template <class Archive>
void DenseModel::State(Archive& archive) {
  archive(presence_);
  for (std::size_t i = 0; i < presence_.size(); ++i) {
    if constexpr (Archive::kReading) descriptors_.emplace_back();
    cv::Mat& descriptor = descriptors_[i];
    StateOfDescriptor(archive, descriptor);
    if constexpr (Archive::kReading) {
      archive.Check(static_cast<int>(presence_[i]), 0, static_cast<int>(Presence::kMerged) + 1,
                    "a location of an unknown state");
      if (descriptor.empty()) continue;
      if (presence_[i] != Presence::kPresent)
        archive.Damaged("a descriptor of a location that is not in memory");
      if (width_ > 0 && descriptor.cols != width_) archive.Damaged("descriptors of several widths");
      width_ = descriptor.cols;
    }
  }
  if constexpr (Archive::kReading) MakeRecent();
}

template void DenseModel::State(internal::StateWriter& archive);
template void DenseModel::State(internal::StateReader& archive);

}  // namespace tutti
