#include "tutti/loopclosure/likelihood.h"

#include <algorithm>
#include <cmath>

#include "byte_stream.h"

namespace tutti {

void LikelihoodModel::Add(const Signature& signature) {
  signatures_.emplace_back();
  present_.push_back(false);
  Restore(static_cast<int>(signatures_.size()) - 1, signature);
}

void LikelihoodModel::Restore(int slot, const Signature& signature) {
  const std::size_t index = static_cast<std::size_t>(slot);
  if (present_[index]) return;
  present_[index] = true;
  ++locations_;
  signatures_[index] = signature;
  Insert(slot);
}

void LikelihoodModel::Insert(int slot) {
  for (const Signature::Entry& entry : signature(slot).entries()) {
    postings_[entry.word].push_back({slot, entry.count});
  }
}

void LikelihoodModel::Remove(int slot) {
  const std::size_t index = static_cast<std::size_t>(slot);
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

void LikelihoodModel::Save(internal::ByteWriter& out) const {
  out.Put<std::uint64_t>(signatures_.size());
  for (std::size_t i = 0; i < signatures_.size(); ++i) {
    out.Put<char>(present_[i] ? 1 : 0);
    signatures_[i].Save(out);
  }
}

void LikelihoodModel::Load(internal::ByteReader& in) {
  const std::size_t count = in.GetCount(1 + sizeof(std::uint64_t));
  for (std::size_t i = 0; i < count; ++i) {
    const bool present = in.Get<char>() != 0;
    signatures_.push_back(Signature::Load(in));
    present_.push_back(present);
    if (!present && !signatures_.back().empty()) in.Damaged("words of a location that is not in memory");
    if (!present) continue;
    ++locations_;
    Insert(static_cast<int>(i));
  }
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
