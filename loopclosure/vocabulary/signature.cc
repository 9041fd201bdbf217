#include "loopclosure/vocabulary/signature.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "core/numbers.h"
#include "core/state_archive.h"

namespace tutti {

Signature::Signature(std::vector<int> words) {
  words.erase(std::remove_if(words.begin(), words.end(), [](int word) { return word < 0; }), words.end());
  size_ = static_cast<int>(words.size());
  std::sort(words.begin(), words.end());
  for (const int word : words) {
    if (!entries_.empty() && entries_.back().word == word) {
      ++entries_.back().count;
    } else {
      entries_.push_back({word, 1});
    }
  }
}

double Signature::Similarity(const Signature& a, const Signature& b) {
  if (a.empty() || b.empty()) return 0.0;
  int shared = 0;
  auto i = a.entries_.begin();
  auto j = b.entries_.begin();
  while (i != a.entries_.end() && j != b.entries_.end()) {
    if (i->word < j->word) {
      ++i;
    } else if (j->word < i->word) {
      ++j;
    } else {
      shared += std::min(i->count, j->count);
      ++i;
      ++j;
    }
  }
  return static_cast<double>(shared) / std::max(a.size_, b.size_);
}

std::vector<Signature> Signature::Split(int parts) const {
  std::vector<Signature> split(internal::Index(parts));
  for (const Entry& entry : entries_) {
    Signature& part = split[internal::Index(entry.word % parts)];
    part.entries_.push_back({entry.word / parts, entry.count});
    part.size_ += entry.count;
  }
  return split;
}

template <class Archive>
void Signature::State(Archive& archive) {
  std::vector<int> words, counts;
  for (const Entry& entry : entries_) {
    words.push_back(entry.word);
    counts.push_back(entry.count);
  }
  archive(internal::GrowingNumbers{&words}, internal::SmallNumbers{&counts});
  if constexpr (Archive::kReading) {
    if (words.size() != counts.size()) archive.Damaged("words without counts");
    entries_.clear();
    std::int64_t size = 0;
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (counts[i] < 1) archive.Damaged("a word that is not there");
      entries_.push_back({words[i], counts[i]});
      size += counts[i];
    }
    if (size > std::numeric_limits<int>::max()) archive.Damaged("a signature of an impossible size");
    size_ = static_cast<int>(size);
  }
}

template void Signature::State(internal::StateWriter& archive);
template void Signature::State(internal::StateReader& archive);

}  // namespace tutti
