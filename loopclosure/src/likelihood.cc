#include "tutti/loopclosure/likelihood.h"

#include <algorithm>
#include <cmath>

namespace tutti {

void LikelihoodModel::Add(const Signature& signature) {
  const int slot = static_cast<int>(signatures_.size());
  signatures_.push_back(signature);
  present_.push_back(true);
  ++locations_;
  if (signature.empty()) return;
  const std::size_t words = static_cast<std::size_t>(signature.entries().back().word) + 1;
  if (postings_.size() < words) postings_.resize(words);
  for (const Signature::Entry& entry : signature.entries()) {
    postings_[static_cast<std::size_t>(entry.word)].push_back({slot, entry.count});
  }
}

void LikelihoodModel::Remove(int slot) {
  const std::size_t index = static_cast<std::size_t>(slot);
  if (!present_[index]) return;
  present_[index] = false;
  --locations_;
  for (const Signature::Entry& entry : signatures_[index].entries()) {
    std::vector<Posting>& list = postings_[static_cast<std::size_t>(entry.word)];
    list.erase(std::remove_if(list.begin(), list.end(), [slot](const Posting& p) { return p.slot == slot; }),
               list.end());
  }
  signatures_[index] = Signature();
}

std::vector<double> LikelihoodModel::Scores(const Signature& query) const {
  std::vector<double> scores(signatures_.size(), 0.0);
  for (const Signature::Entry& entry : query.entries()) {
    if (static_cast<std::size_t>(entry.word) >= postings_.size()) continue;
    const std::vector<Posting>& list = postings_[static_cast<std::size_t>(entry.word)];
    if (list.empty()) continue;
    if (kind_ == LikelihoodKind::kSimilarity) {
      for (const Posting& posting : list) {
        scores[static_cast<std::size_t>(posting.slot)] += std::min(posting.count, entry.count);
      }
      continue;
    }
    const double inverse_frequency =
        std::log10(static_cast<double>(locations_) / static_cast<double>(list.size()));
    for (const Posting& posting : list) {
      const std::size_t slot = static_cast<std::size_t>(posting.slot);
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

Belief AdjustLikelihood(const std::vector<double>& scores, const std::vector<int>& working_memory) {
  Belief likelihood;
  likelihood.places.assign(scores.size(), 0.0);
  double sum = 0.0;
  int count = 0;
  for (const int slot : working_memory) {
    const double score = scores[static_cast<std::size_t>(slot)];
    if (score > 0.0) {
      sum += score;
      ++count;
    }
  }
  const double mean = count > 0 ? sum / count : 0.0;
  double squares = 0.0;
  for (const int slot : working_memory) {
    const double score = scores[static_cast<std::size_t>(slot)];
    if (score > 0.0) squares += (score - mean) * (score - mean);
  }
  const double sigma = count > 1 ? std::sqrt(squares / (count - 1)) : 0.0;

  bool stands_out = false;
  for (const int slot : working_memory) {
    const std::size_t i = static_cast<std::size_t>(slot);
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
