#include "loopclosure/filter/transition_model.h"

#include <algorithm>
#include <cmath>

#include "core/numbers.h"

namespace tutti {
namespace {

constexpr int kInner = 2 * TransitionModel::kLevels + 1;  // values of a column in the middle of a path

}  // namespace

const std::array<double, TransitionModel::kLevels + 1>& TransitionModel::LevelValues() {
  // The published row: a Gaussian of sigma 1.6 over graph levels, as RTAB-Map's default and the paper print
  // it.
  static const std::array<double, kLevels + 1> values = {0.36,     0.30,    0.16,    0.062,   0.0151, 0.00255,
                                                         0.000324, 2.5e-5,  1.3e-6,  4.8e-8,  1.2e-9, 1.9e-11,
                                                         2.2e-13,  1.7e-15, 8.5e-18, 2.9e-20, 6.9e-23};
  return values;
}

void TransitionModel::Update(const LocationMemory& memory, const std::vector<int>& changed_slots) {
  columns_.resize(internal::Index(memory.size()));
  std::vector<int> dirty;
  for (const int slot : changed_slots) {
    if (memory.state(slot) != LocationState::kWorking) {
      if (columns_[internal::Index(slot)].Empty()) continue;  // no path led through it
      columns_[internal::Index(slot)] = Runs();
      // Paths that led through it are cut: all within reach of those that it was linked to.
      for (const LocationMemory::Link& link : memory.links(slot)) {
        for (const auto& [near, level, loops] : memory.Neighbours(link.slot, kLevels)) dirty.push_back(near);
      }
      continue;
    }
    for (const auto& [near, level, loops] : memory.Neighbours(slot, kLevels)) dirty.push_back(near);
  }
  std::sort(dirty.begin(), dirty.end());
  dirty.erase(std::unique(dirty.begin(), dirty.end()), dirty.end());
  for (const int j : dirty) {
    Runs& column = columns_[internal::Index(j)];
    column = ComputeColumn(memory, j);
    ShareInner(column);
  }
}

void TransitionModel::ShareInner(Runs& column) {
  if (column.runs.size() != 1 || column.runs[0].count != kInner) return;
  if (inner_.empty()) inner_ = column.values;
  if (column.values != inner_) return;
  const int first = column.runs[0].first;
  column = Runs();
  column.inner_first = first;
}

TransitionModel::Runs TransitionModel::ComputeColumn(const LocationMemory& memory, int slot) {
  std::vector<std::pair<int, double>> column;
  double sum = 0.0;
  for (const auto& [neighbour, level, loops] : memory.Neighbours(slot, kLevels)) {
    const double value = LevelValues()[internal::Index(level)] * std::pow(kLoopShare, loops);
    column.emplace_back(neighbour, value);
    sum += value;
  }
  std::sort(column.begin(), column.end());
  constexpr double kReal = 1.0 - kToNewPlace;
  const double deficit = std::max(0.0, kReal - sum);  // chain ends and transferred neighbours
  const double scale = kReal / (sum + deficit);
  Runs result;
  result.values.reserve(column.size());
  for (const auto& [neighbour, value] : column) {
    if (result.runs.empty() || result.runs.back().first + result.runs.back().count != neighbour) {
      result.runs.push_back({neighbour, 0});
    }
    ++result.runs.back().count;
    result.values.push_back((neighbour == slot ? value + deficit : value) * scale);
  }
  return result;
}

// Calls call(first slot, count, their values) for each stretch of a column.
template <typename Call>
void TransitionModel::ForEachRun(const Runs& column, const Call& call) const {
  if (column.inner_first >= 0) {
    call(column.inner_first, kInner, inner_.data());
    return;
  }
  const double* values = column.values.data();
  for (const auto& [first, count] : column.runs) {
    call(first, count, values);
    values += count;
  }
}

Belief TransitionModel::Predict(const Belief& posterior, const std::vector<int>& working_memory) const {
  Belief predicted;
  predicted.places.assign(posterior.places.size(), 0.0);
  double real = 0.0;
  for (const int j : working_memory) {
    const double p = posterior.places[internal::Index(j)];
    if (p <= 0.0) continue;
    real += p;
    ForEachRun(columns_[internal::Index(j)], [&](int first, int count, const double* values) {
      double* const to = predicted.places.data() + first;
      for (int i = 0; i < count; ++i) to[i] += values[i] * p;
    });
  }
  if (working_memory.empty()) {
    predicted.new_place = 1.0;
    return predicted;
  }
  predicted.new_place = kStaysNew * posterior.new_place + kToNewPlace * real;
  const double from_virtual =
      (1.0 - kStaysNew) * posterior.new_place / static_cast<double>(working_memory.size());
  for (const int i : working_memory) predicted.places[internal::Index(i)] += from_virtual;
  return predicted;
}

Belief TransitionModel::Backward(const Belief& value, const std::vector<int>& working_memory) const {
  Belief before;
  before.places.assign(value.places.size(), 0.0);
  double all = 0.0;
  for (const int j : working_memory) {
    all += value.places[internal::Index(j)];
    double sum = kToNewPlace * value.new_place;
    ForEachRun(columns_[internal::Index(j)], [&](int first, int count, const double* values) {
      const double* const of = value.places.data() + first;
      for (int i = 0; i < count; ++i) sum += values[i] * of[i];
    });
    before.places[internal::Index(j)] = sum;
  }
  if (working_memory.empty()) return before;
  before.new_place =
      kStaysNew * value.new_place + (1.0 - kStaysNew) * all / static_cast<double>(working_memory.size());
  return before;
}

std::vector<std::pair<int, double>> TransitionModel::Column(int slot) const {
  std::vector<std::pair<int, double>> column;
  ForEachRun(columns_[internal::Index(slot)], [&](int first, int count, const double* values) {
    for (int i = 0; i < count; ++i) column.emplace_back(first + i, values[i]);
  });
  return column;
}

}  // namespace tutti
