#include "loopclosure/vocabulary/descriptor_index.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "core/inner_loops.h"
#include "core/numbers.h"
#include "core/shuffle.h"
#include "core/state_archive.h"
#include "loopclosure/features/distances.h"
#include "loopclosure/vocabulary/bit_trie.h"
#include "loopclosure/vocabulary/kd_tree.h"
#include "loopclosure/vocabulary/word_storage.h"

namespace tutti {

void TwoNearest::Offer(int word, float distance) {
  if (word == first || word == second) return;
  if (distance < first_distance || (distance == first_distance && word < first)) {
    second = first;
    second_distance = first_distance;
    first = word;
    first_distance = distance;
  } else if (distance < second_distance || (distance == second_distance && word < second)) {
    second = word;
    second_distance = distance;
  }
}

namespace {

constexpr int kTogether = 12;  // searches that take turns: enough to hide memory, few enough for the cache

class KdForestIndex : public internal::StoredIndex<KdForestIndex> {
 public:
  KdForestIndex(int dimensions, int trees, int checks, std::uint64_t seed)
      : StoredIndex(internal::Index(dimensions) * sizeof(float)),
        dimensions_(dimensions),
        checks_per_tree_(std::max(1, checks / trees)) {
    for (int t = 0; t < trees; ++t) {
      trees_.push_back({internal::KdTree(dimensions), internal::Shuffler(seed, t)});
    }
  }

  void Add(const std::vector<int>& words, const cv::Mat& rows) override {
    CV_Assert(rows.type() == CV_32F && rows.cols == dimensions_ &&
              internal::Index(rows.rows) == words.size());
    std::vector<int> added;
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (storage_.RowOf(words[i]) >= 0) continue;
      added.push_back(storage_.Add(words[i], rows.ptr(static_cast<int>(i))));
    }
    std::vector<std::vector<int>> orders;
    for (GrownTree& tree : trees_) {
      orders.push_back(added);
      tree.shuffler.Shuffle(orders.back());
    }
    std::vector<internal::KdTree::Descent> descents(trees_.size());
    for (std::size_t i = 0; i < added.size(); ++i) {
      for (std::size_t t = 0; t < trees_.size(); ++t) descents[t] = trees_[t].tree.Begin(orders[t][i]);
      for (bool more = true; more;) {
        more = false;
        for (std::size_t t = 0; t < trees_.size(); ++t) more |= trees_[t].tree.GoOn(storage_, descents[t]);
      }
    }
  }

  void Remove(int word) override {
    const int row = storage_.RowOf(word);
    if (row < 0) return;
    for (GrownTree& tree : trees_) tree.tree.Remove(row);
    storage_.Free(row);
  }

  std::vector<TwoNearest> Search(const cv::Mat& descriptors) const override {
    std::vector<TwoNearest> found;
    for (int begin = 0; begin < descriptors.rows; begin += kTogether) {
      std::vector<const float*> queries;
      for (int i = begin; i < std::min(descriptors.rows, begin + kTogether); ++i) {
        queries.push_back(descriptors.ptr<float>(i));
      }
      std::vector<TwoNearest> nearest(queries.size());
      for (const GrownTree& tree : trees_) tree.tree.Search(queries, checks_per_tree_, storage_, nearest);
      found.insert(found.end(), nearest.begin(), nearest.end());
    }
    // The trees compare squares; the vocabulary decides on true distance.
    for (TwoNearest& nearest : found) {
      nearest.first_distance = std::sqrt(nearest.first_distance);
      nearest.second_distance = std::sqrt(nearest.second_distance);
    }
    return found;
  }

  template <class Archive>
  void StateOf(Archive& archive, const std::vector<internal::PackedMat>& known) {
    storage_.State(archive, CV_32F, known);
    const std::vector<int> ranks = storage_.Ranks();
    for (GrownTree& tree : trees_) {
      archive(tree.shuffler);
      tree.tree.State(archive, ranks);
    }
  }

 private:
  // Each tree takes new words in an order of its own.
  struct GrownTree {
    internal::KdTree tree;
    internal::Shuffler shuffler;
  };

  int dimensions_;
  int checks_per_tree_;
  std::vector<GrownTree> trees_;
};

}  // namespace

std::unique_ptr<DescriptorIndex> MakeKdForestIndex(int dimensions, int trees, int checks,
                                                   std::uint64_t seed) {
  return std::make_unique<KdForestIndex>(dimensions, trees, checks, seed);
}

namespace {

constexpr int kExactUpTo = 1000;  // below this an exact scan is as fast as the tries

class HammingIndex : public internal::StoredIndex<HammingIndex> {
 public:
  HammingIndex(int bytes, int tables, std::uint64_t seed)
      : StoredIndex(internal::Index(bytes)), bytes_(bytes) {
    std::mt19937_64 generator(seed);
    for (int t = 0; t < tables; ++t) tries_.emplace_back(bytes, generator);
  }

  void Add(const std::vector<int>& words, const cv::Mat& rows) override {
    CV_Assert(rows.type() == CV_8U && rows.cols == bytes_ && internal::Index(rows.rows) == words.size());
    for (int i = 0; i < rows.rows; ++i) {
      const int word = words[internal::Index(i)];
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
    found.reserve(internal::Index(descriptors.rows));
    std::vector<internal::BitTrie::Walk> walks;
    std::vector<int> rows;
    for (int i = 0; i < descriptors.rows; ++i) {
      found.push_back(size() <= kExactUpTo ? SearchAll(descriptors.ptr(i))
                                           : SearchTries(descriptors.ptr(i), walks, rows));
    }
    return found;
  }

  // The order within a leaf changes no answer: words and descriptors are all.
  template <class Archive>
  void StateOf(Archive& archive, const std::vector<internal::PackedMat>& known) {
    storage_.State(archive, CV_8U, known);
    if constexpr (Archive::kReading) {
      std::vector<int> rows(internal::Index(storage_.end()));
      std::iota(rows.begin(), rows.end(), 0);
      for (internal::BitTrie& trie : tries_) trie.InsertAll(rows, storage_);
    }
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
  std::vector<internal::BitTrie> tries_;
};

TUTTI_CLONES("popcnt")
void HammingIndex::Scan(const std::vector<int>& rows, const std::uint8_t* descriptor,
                        TwoNearest& nearest) const {
  constexpr std::size_t kAhead = 8;  // words lie anywhere in memory: ask for them before they are needed
  internal::CheckReadable(descriptor, internal::Index(bytes_));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + kAhead < rows.size()) __builtin_prefetch(storage_.At(rows[i + kAhead]));
    const std::uint8_t* const word = storage_.At(rows[i]);
    internal::CheckReadable(word, internal::Index(bytes_));
    const float distance = static_cast<float>(internal::HammingDistance(descriptor, word, bytes_));
    if (distance <= nearest.second_distance) nearest.Offer(storage_.WordOf(rows[i]), distance);
  }
}

}  // namespace

std::unique_ptr<DescriptorIndex> MakeHammingIndex(int bytes, int tables, std::uint64_t seed) {
  return std::make_unique<HammingIndex>(bytes, tables, seed);
}

}  // namespace tutti
