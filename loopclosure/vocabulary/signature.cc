#include "loopclosure/vocabulary/signature.h"

#include <algorithm>
#include <limits>

#include "core/byte_stream.h"

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

void Signature::Save(internal::ByteWriter& out) const {
  out.PutVarint(entries_.size());
  int before = -1;
  for (const Entry& entry : entries_) {
    out.PutVarint(static_cast<std::uint64_t>(entry.word - before - 1));
    out.PutVarint(static_cast<std::uint64_t>(entry.count));
    before = entry.word;
  }
}

Signature Signature::Load(internal::ByteReader& in) {
  Signature signature;
  constexpr int kMost = std::numeric_limits<int>::max();
  const std::uint64_t count = in.GetVarint();
  if (count > in.Left() / 2) in.Damaged("more words than bytes");
  signature.entries_.reserve(static_cast<std::size_t>(count));
  std::int64_t size = 0;
  int before = -1;
  for (std::uint64_t i = 0; i < count; ++i) {
    before += 1 + in.GetVarintIndex(kMost - 1 - before);
    const int times = in.GetVarintIndex(kMost);
    if (times < 1) in.Damaged("a signature out of order");
    signature.entries_.push_back({before, times});
    size += times;
  }
  if (size > std::numeric_limits<int>::max()) in.Damaged("a signature of an impossible size");
  signature.size_ = static_cast<int>(size);
  return signature;
}

}  // namespace tutti
