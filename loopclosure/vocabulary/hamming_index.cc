#include <algorithm>
#include <random>

#include "core/byte_stream.h"
#include "core/inner_loops.h"
#include "loopclosure/features/distances.h"
#include "loopclosure/vocabulary/bit_trie.h"
#include "loopclosure/vocabulary/descriptor_index.h"
#include "loopclosure/vocabulary/word_bytes.h"
#include "loopclosure/vocabulary/word_storage.h"

namespace tutti {
namespace {

constexpr int kExactUpTo = 1000;  // below this an exact scan is as fast as the tries

class HammingIndex : public DescriptorIndex {
 public:
  HammingIndex(int bytes, int tables, std::uint64_t seed)
      : bytes_(bytes), storage_(static_cast<std::size_t>(bytes)) {
    std::mt19937_64 generator(seed);
    for (int t = 0; t < tables; ++t) tries_.emplace_back(bytes, generator);
  }

  void Add(const std::vector<int>& words, const cv::Mat& rows) override {
    CV_Assert(rows.type() == CV_8U && rows.cols == bytes_ &&
              static_cast<std::size_t>(rows.rows) == words.size());
    for (int i = 0; i < rows.rows; ++i) {
      const int word = words[static_cast<std::size_t>(i)];
      if (storage_.RowOf(word) >= 0) continue;
      const int row = storage_.Add(word, rows.ptr(i));
      for (internal::BitTrie& trie : tries_) trie.Insert(row, storage_);
    }
  }

  void Remove(int word) override {
    const int row = storage_.RowOf(word);
    if (row < 0) return;
    for (internal::BitTrie& trie : tries_) trie.Remove(row, storage_);
    storage_.Free(row);
  }

  std::vector<TwoNearest> Search(const cv::Mat& descriptors) const override {
    std::vector<TwoNearest> found;
    found.reserve(static_cast<std::size_t>(descriptors.rows));
    std::vector<internal::BitTrie::Walk> walks;
    std::vector<int> rows;
    for (int i = 0; i < descriptors.rows; ++i) {
      found.push_back(size() <= kExactUpTo ? SearchAll(descriptors.ptr(i))
                                           : SearchTries(descriptors.ptr(i), walks, rows));
    }
    return found;
  }

  const std::uint8_t* Find(int word) const override {
    const int row = storage_.RowOf(word);
    return row < 0 ? nullptr : storage_.At(row);
  }

  int size() const override { return storage_.size(); }

  // Which row a word lies in, and the order within a leaf, change no answer: words and descriptors are all.
  void Save(const std::vector<internal::PackedMat>& known, internal::ByteWriter& out) const override {
    internal::SaveWords(storage_, CV_8U, known, out);
  }

  void Load(const std::vector<internal::PackedMat>& known, internal::ByteReader& in) override {
    std::vector<int> rows;
    internal::LoadWords(storage_, CV_8U, known, in, [&](int word, const std::uint8_t* descriptor) {
      rows.push_back(storage_.Add(word, descriptor));
    });
    for (internal::BitTrie& trie : tries_) trie.InsertAll(rows, storage_);
  }

 private:
  TwoNearest SearchAll(const std::uint8_t* descriptor) const {
    constexpr int kBlock = 256;
    static_assert(internal::WordStorage::kRowsPerBlock % kBlock == 0);
    float distances[kBlock];
    TwoNearest nearest;
    for (int begin = 0; begin < storage_.end(); begin += kBlock) {
      const int count = std::min(kBlock, storage_.end() - begin);
      internal::HammingDistances(descriptor, storage_.At(begin), count, bytes_, storage_.row_bytes(),
                                 distances);
      for (int i = 0; i < count; ++i) {
        if (distances[i] > nearest.second_distance) continue;
        const int word = storage_.WordOf(begin + i);
        if (word >= 0) nearest.Offer(word, distances[i]);
      }
    }
    return nearest;
  }

  TUTTI_CLONES("popcnt")
  void Scan(const std::vector<int>& rows, const std::uint8_t* descriptor, TwoNearest& nearest) const;

  TwoNearest SearchTries(const std::uint8_t* descriptor, std::vector<internal::BitTrie::Walk>& walks,
                         std::vector<int>& rows) const {
    TwoNearest nearest;
    rows.clear();
    internal::BitTrie::Collect(tries_, descriptor, walks, rows);
    Scan(rows, descriptor, nearest);
    return nearest;
  }

  int bytes_;
  internal::WordStorage storage_;
  std::vector<internal::BitTrie> tries_;
};

TUTTI_CLONES("popcnt")
void HammingIndex::Scan(const std::vector<int>& rows, const std::uint8_t* descriptor,
                        TwoNearest& nearest) const {
  constexpr std::size_t kAhead = 8;  // words lie anywhere in memory: ask for them before they are needed
  internal::CheckReadable(descriptor, static_cast<std::size_t>(bytes_));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + kAhead < rows.size()) __builtin_prefetch(storage_.At(rows[i + kAhead]));
    const std::uint8_t* const word = storage_.At(rows[i]);
    internal::CheckReadable(word, static_cast<std::size_t>(bytes_));
    const float distance = static_cast<float>(internal::HammingDistance(descriptor, word, bytes_));
    if (distance <= nearest.second_distance) nearest.Offer(storage_.WordOf(rows[i]), distance);
  }
}

}  // namespace

std::unique_ptr<DescriptorIndex> MakeHammingIndex(int bytes, int tables, std::uint64_t seed) {
  return std::make_unique<HammingIndex>(bytes, tables, seed);
}

}  // namespace tutti
