#include "tutti/loopclosure/signature.h"

#include <algorithm>

namespace tutti {

Signature::Signature(std::vector<int> words) : size_(static_cast<int>(words.size())) {
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

}  // namespace tutti
