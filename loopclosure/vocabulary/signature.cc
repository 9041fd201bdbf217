#include "loopclosure/vocabulary/signature.h"

#include <algorithm>
#include <limits>

#include "loopclosure/store/byte_stream.h"

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
  std::vector<Signature> split(static_cast<std::size_t>(parts));
  for (const Entry& entry : entries_) {
    Signature& part = split[static_cast<std::size_t>(entry.word % parts)];
    part.entries_.push_back({entry.word / parts, entry.count});
    part.size_ += entry.count;
  }
  return split;
}

void Signature::Save(internal::ByteWriter& out) const { out.PutVector(entries_); }

Signature Signature::Load(internal::ByteReader& in) {
  Signature signature;
  signature.entries_ = in.GetVector<Entry>();
  std::int64_t size = 0;
  int before = -1;
  for (const Entry& entry : signature.entries_) {
    if (entry.word <= before || entry.count < 1) in.Damaged("a signature out of order");
    before = entry.word;
    size += entry.count;
  }
  if (size > std::numeric_limits<int>::max()) in.Damaged("a signature of an impossible size");
  signature.size_ = static_cast<int>(size);
  return signature;
}

}  // namespace tutti
