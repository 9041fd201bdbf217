#include "loopclosure/memory/likelihood.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "core/numbers.h"
#include "core/state_archive.h"
#include "loopclosure/memory/dense_model.h"

namespace tutti {

void LikelihoodModel::Add(const Signature& signature) {
  signatures_.emplace_back();
  present_.push_back(false);
  Restore(static_cast<int>(signatures_.size()) - 1, signature);
}

void LikelihoodModel::Restore(int slot, const Signature& signature) {
  const std::size_t index = internal::Index(slot);
  if (present_[index]) return;
  present_[index] = true;
  ++locations_;
  signatures_[index] = signature;
  Insert(slot);
}

void LikelihoodModel::Insert(int slot) {
  for (const Signature::Entry& entry : signature(slot).entries()) {
    std::vector<Posting>& list = postings_[entry.word];
    const auto later = std::upper_bound(list.begin(), list.end(), slot,
                                        [](int own, const Posting& other) { return own < other.slot; });
    list.insert(later, {slot, entry.count});
  }
}

void LikelihoodModel::Remove(int slot) {
  const std::size_t index = internal::Index(slot);
  if (!present_[index]) return;
  present_[index] = false;
  --locations_;
  for (const Signature::Entry& entry : signatures_[index].entries()) {
    std::vector<Posting>& list = *postings_.Find(entry.word);
    list.erase(std::remove_if(list.begin(), list.end(), [slot](const Posting& p) { return p.slot == slot; }),
               list.end());
    if (list.empty()) postings_.Erase(entry.word);
  }
  signatures_[index] = Signature();
}

std::vector<double> LikelihoodModel::Scores(const Signature& query) const {
  std::vector<double> scores(signatures_.size(), 0.0);
  for (const Signature::Entry& entry : query.entries()) {
    const std::vector<Posting>* found = postings_.Find(entry.word);
    if (found == nullptr) continue;
    const std::vector<Posting>& list = *found;
    if (kind_ == LikelihoodKind::kSimilarity) {
      for (const Posting& posting : list) {
        scores[internal::Index(posting.slot)] += std::min(posting.count, entry.count);
      }
      continue;
    }
    const double inverse_frequency =
        std::log10(static_cast<double>(locations_) / static_cast<double>(list.size()));
    for (const Posting& posting : list) {
      const std::size_t slot = internal::Index(posting.slot);
      scores[slot] += static_cast<double>(posting.count) / signatures_[slot].size() * inverse_frequency;
    }
  }
  if (kind_ == LikelihoodKind::kSimilarity) {
    for (std::size_t i = 0; i < scores.size(); ++i) {
      if (scores[i] > 0.0) scores[i] /= std::max(query.size(), signatures_[i].size());
    }
  }
  return scores;
}

int SeenWords::Cell(const cv::Point2f& pixel, const cv::Size& size) {
  const float side = static_cast<float>(std::max({size.width, size.height, 1})) / kColumns;
  const auto along = [side](float x, int length) {
    const int last = std::max(0, static_cast<int>(std::ceil(static_cast<float>(length) / side)) - 1);
    return std::clamp(static_cast<int>(x / side), 0, last);
  };
  return along(pixel.y, size.height) * kColumns + along(pixel.x, size.width);
}

int SeenWords::size() const {
  return static_cast<int>(std::count_if(words.begin(), words.end(), [](int word) { return word >= 0; }));
}

double SeenWords::Amount() const { return descriptor.empty() ? size() : DenseModel::kWords; }

namespace {

// Sums by slot that are few among many slots.
class SparseSums {
 public:
  explicit SparseSums(std::size_t slots) : sums_(slots, 0.0) {}
  void Add(std::size_t slot, double value) {
    if (sums_[slot] == 0.0) touched_.push_back(slot);
    sums_[slot] += value;
  }
  // Calls call(slot, sum) for each that is not 0, and forgets them.
  template <typename Call>
  void Drain(const Call& call) {
    for (const std::size_t slot : touched_) call(slot, std::exchange(sums_[slot], 0.0));
    touched_.clear();
  }

 private:
  std::vector<double> sums_;
  std::vector<std::size_t> touched_;
};

// A feature's word with its place in the image, in the order in which Counts adds up.
struct PlacedWord {
  int strip, cell, word;
  bool operator<(const PlacedWord& other) const {
    return std::tie(strip, cell, word) < std::tie(other.strip, other.cell, other.word);
  }
};

}  // namespace

std::vector<double> LikelihoodModel::Counts(const SeenWords& query, const Sight& sight) const {
  std::vector<double> counts(signatures_.size(), 0.0);
  if (locations_ < 2) return counts;
  std::vector<PlacedWord> placed;
  std::vector<int> sorted;
  for (std::size_t i = 0; i < query.words.size(); ++i) {
    if (query.words[i] < 0) continue;
    placed.push_back(
        {query.cells[i] % SeenWords::kColumns / SeenWords::kStripColumns, query.cells[i], query.words[i]});
    sorted.push_back(query.words[i]);
  }
  std::sort(placed.begin(), placed.end());
  std::sort(sorted.begin(), sorted.end());
  const double all = std::log10(static_cast<double>(locations_));
  SparseSums in_cell(signatures_.size());
  SparseSums in_strip(signatures_.size());
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const auto& [strip, cell, word] = placed[i];
    if (const std::vector<Posting>* list = postings_.Find(word)) {
      const auto same = std::equal_range(sorted.begin(), sorted.end(), word);
      const double value = std::log10(static_cast<double>(locations_) / static_cast<double>(list->size())) /
                           (all * static_cast<double>(same.second - same.first));
      if (value > 0.0) {
        sight.ForEachReturn(*list, size() - 1, [&](const Posting& posting) {
          in_cell.Add(internal::Index(posting.slot), posting.count * value);
        });
      }
    }
    const bool last = i + 1 == placed.size();
    if (!last && placed[i + 1].cell == cell) continue;
    in_cell.Drain([&](std::size_t slot, double sum) { in_strip.Add(slot, std::log1p(sum)); });
    if (!last && placed[i + 1].strip == strip) continue;
    in_strip.Drain([&](std::size_t slot, double sum) {
      const double root = std::sqrt(sum);
      counts[slot] += root * std::sqrt(root);
    });
  }
  return counts;
}

template <class Archive>
void LikelihoodModel::State(Archive& archive) {
  std::uint64_t count = signatures_.size();
  archive(count);
  for (std::size_t i = 0; i < count; ++i) {
    if constexpr (Archive::kReading) signatures_.emplace_back();
    bool present = !Archive::kReading && present_[i];
    archive(present, signatures_[i]);
    if constexpr (Archive::kReading) {
      present_.push_back(present);
      if (!present && !signatures_[i].empty()) archive.Damaged("words of a location that is not in memory");
      if (!present) continue;
      ++locations_;
      Insert(static_cast<int>(i));
    }
  }
}

template void LikelihoodModel::State(internal::StateWriter& archive);
template void LikelihoodModel::State(internal::StateReader& archive);

Belief AdjustLikelihood(const std::vector<double>& scores, const std::vector<int>& working_memory) {
  Belief likelihood;
  likelihood.places.assign(scores.size(), 0.0);
  double sum = 0.0;
  int count = 0;
  for (const int slot : working_memory) {
    const double score = scores[internal::Index(slot)];
    if (score > 0.0) {
      sum += score;
      ++count;
    }
  }
  const double mean = count > 0 ? sum / count : 0.0;
  double squares = 0.0;
  for (const int slot : working_memory) {
    const double score = scores[internal::Index(slot)];
    if (score > 0.0) squares += (score - mean) * (score - mean);
  }
  const double sigma = count > 1 ? std::sqrt(squares / (count - 1)) : 0.0;

  bool stands_out = false;
  for (const int slot : working_memory) {
    const std::size_t i = internal::Index(slot);
    likelihood.places[i] = 1.0;
    if (scores[i] > 0.0 && scores[i] > mean + sigma) {
      likelihood.places[i] = (scores[i] - (sigma - 1e-4)) / mean;
      stands_out = true;
    }
  }
  likelihood.new_place = sigma > 1e-4 && stands_out ? mean / sigma + 1.0 : 2.0;
  return likelihood;
}

}  // namespace tutti
