// A binary trie over the bits of descriptors, in a random order of the bits.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <random>
#include <vector>

#include "core/numbers.h"
#include "core/shuffle.h"
#include "loopclosure/vocabulary/word_storage.h"

namespace tutti::internal {

/// Rows of a WordStorage by the bits of their descriptors. A subtree is split when it holds more than kLeaf
/// rows and joined when it holds no more again: its shape depends on what is in it, not on how that came
/// about, and no insertion or removal costs more than a walk down.
class BitTrie {
 public:
  static constexpr int kLeaf = 8;

  BitTrie(int bytes, std::mt19937_64& generator) : order_(Index(8 * bytes)) {
    std::iota(order_.begin(), order_.end(), 0);
    Shuffle(order_, generator);
    root_ = NewLeaf();
  }

  void Insert(int row, const WordStorage& storage) {
    const std::uint8_t* descriptor = storage.At(row);
    int* at = &root_;
    for (std::size_t depth = 0;; ++depth) {
      if (IsLeaf(*at)) {
        Leaf& leaf = LeafAt(*at);
        if (leaf.count < kLeaf) {
          leaf.rows[Index(leaf.count++)] = row;
          return;
        }
        if (depth == order_.size()) {  // more than kLeaf equal descriptors
          ++leaf.count;
          overflow_[*at].push_back(row);
          return;
        }
        *at = Split(*at, depth, storage);
      }
      at = &splits_[Index(*at)][Bit(descriptor, depth)];
    }
  }

  /// Inserts many rows into an empty trie.
  void InsertAll(std::vector<int> rows, const WordStorage& storage) {
    free_leaves_.push_back(root_);
    root_ = Grow(rows.data(), rows.data() + rows.size(), 0, storage);
  }

  /// The row must be there.
  void Remove(int row, const WordStorage& storage) {
    const std::uint8_t* descriptor = storage.At(row);
    std::vector<int*> path = {&root_};
    while (!IsLeaf(*path.back())) {
      path.push_back(&splits_[Index(*path.back())][Bit(descriptor, path.size() - 1)]);
    }
    RemoveFromLeaf(*path.back(), row);
    path.pop_back();
    while (!path.empty() && Join(*path.back())) path.pop_back();
  }

  /// A walk down one trie.
  struct Walk {
    const BitTrie* trie;
    int at;
    std::size_t depth;
  };
  /// Appends, of each trie, the rows of the leaf that the descriptor falls into and of those that one other
  /// bit leads to, in any order. The walks take turns: while one waits for memory, the others go on.
  static void Collect(const std::vector<BitTrie>& tries, const std::uint8_t* descriptor,
                      std::vector<Walk>& walks, std::vector<int>& rows) {
    walks.clear();
    for (const BitTrie& trie : tries) walks.push_back({&trie, trie.root_, 0});
    // Those that follow the descriptor start others, which take one other bit.
    std::size_t straight = walks.size();
    while (straight > 0) {
      for (std::size_t i = 0; i < straight;) {
        Walk& walk = walks[i];
        if (IsLeaf(walk.at)) {
          walk.trie->Prefetch(walk.at);
          std::swap(walk, walks[--straight]);
          continue;
        }
        const std::array<int, 2>& split = walk.trie->splits_[Index(walk.at)];
        const std::size_t bit = walk.trie->Bit(descriptor, walk.depth++);
        const Walk aside = {walk.trie, split[1 - bit], walk.depth};
        walk.at = split[bit];
        walk.trie->Prefetch(walk.at);
        aside.trie->Prefetch(aside.at);
        walks.push_back(aside);
        ++i;
      }
    }
    while (!walks.empty()) {
      for (std::size_t i = 0; i < walks.size();) {
        Walk& walk = walks[i];
        if (IsLeaf(walk.at)) {
          walk.trie->AppendRows(walk.at, rows);
          walk = walks.back();
          walks.pop_back();
          continue;
        }
        walk.at = walk.trie->splits_[Index(walk.at)][walk.trie->Bit(descriptor, walk.depth++)];
        walk.trie->Prefetch(walk.at);
        ++i;
      }
    }
  }

 private:
  // Where a link leads: a split from 0 on, or leaf number -1 - link.
  static bool IsLeaf(int link) { return link < 0; }
  struct Leaf {
    int count = 0;  // beyond kLeaf: the others are in overflow_
    std::array<int, kLeaf> rows{};
  };
  Leaf& LeafAt(int link) { return leaves_[Index(-1 - link)]; }
  const Leaf& LeafAt(int link) const { return leaves_[Index(-1 - link)]; }

  void Prefetch(int link) const {
    if (IsLeaf(link)) {
      const Leaf& leaf = LeafAt(link);
      __builtin_prefetch(&leaf);
      __builtin_prefetch(&leaf.rows.back());
    } else {
      __builtin_prefetch(&splits_[Index(link)]);
    }
  }

  std::size_t Bit(const std::uint8_t* descriptor, std::size_t depth) const {
    const int bit = order_[depth];
    return (descriptor[bit >> 3] >> (bit & 7)) & 1u;
  }

  int NewLeaf() {
    if (free_leaves_.empty()) {
      leaves_.Extend();
      return -static_cast<int>(leaves_.size());
    }
    const int leaf = free_leaves_.back();
    free_leaves_.pop_back();
    LeafAt(leaf) = Leaf();
    return leaf;
  }

  int NewSplit() {
    if (free_splits_.empty()) {
      splits_.Extend();
      return static_cast<int>(splits_.size()) - 1;
    }
    const int split = free_splits_.back();
    free_splits_.pop_back();
    return split;
  }

  // A subtree of these rows, whose order is lost.
  int Grow(int* begin, int* end, std::size_t depth, const WordStorage& storage) {
    const int count = static_cast<int>(end - begin);
    if (count <= kLeaf || depth == order_.size()) {
      const int link = NewLeaf();
      Leaf& leaf = LeafAt(link);
      leaf.count = count;
      int* const others = begin + std::min(count, kLeaf);
      std::copy(begin, others, leaf.rows.begin());
      if (others != end) overflow_[link].assign(others, end);
      return link;
    }
    int* const middle = std::partition(begin, end, [&](int row) { return Bit(storage.At(row), depth) == 0; });
    const int split = NewSplit();
    const int first = Grow(begin, middle, depth + 1, storage);
    const int second = Grow(middle, end, depth + 1, storage);
    splits_[Index(split)] = {first, second};
    return split;
  }

  // A full leaf becomes the first child of a new split, whose number is returned.
  int Split(int link, std::size_t depth, const WordStorage& storage) {
    const Leaf full = LeafAt(link);
    const std::array<int, 2> children = {link, NewLeaf()};
    LeafAt(link).count = 0;
    for (const int row : full.rows) {
      Leaf& leaf = LeafAt(children[Bit(storage.At(row), depth)]);
      leaf.rows[Index(leaf.count++)] = row;
    }
    const int split = NewSplit();
    splits_[Index(split)] = children;
    return split;
  }

  // Makes one leaf of a split whose children are leaves that fit into one.
  bool Join(int& link) {
    const std::array<int, 2> children = splits_[Index(link)];
    if (!IsLeaf(children[0]) || !IsLeaf(children[1])) return false;
    Leaf& kept = LeafAt(children[0]);
    const Leaf& other = LeafAt(children[1]);
    if (kept.count + other.count > kLeaf) return false;
    std::copy_n(other.rows.begin(), other.count, kept.rows.begin() + kept.count);
    kept.count += other.count;
    free_leaves_.push_back(children[1]);
    free_splits_.push_back(link);
    link = children[0];
    return true;
  }

  void RemoveFromLeaf(int link, int row) {
    Leaf& leaf = LeafAt(link);
    const int here = std::min(leaf.count--, kLeaf);
    const auto end = leaf.rows.begin() + here;
    const auto found = std::find(leaf.rows.begin(), end, row);
    const auto more = overflow_.find(link);
    if (more == overflow_.end()) {
      std::copy(found + 1, end, found);
      return;
    }
    std::vector<int>& others = more->second;
    if (found == end) {
      others.erase(std::find(others.begin(), others.end(), row));
    } else {
      *found = others.back();
      others.pop_back();
    }
    if (others.empty()) overflow_.erase(more);
  }

  void AppendRows(int link, std::vector<int>& rows) const {
    const Leaf& leaf = LeafAt(link);
    rows.insert(rows.end(), leaf.rows.data(), leaf.rows.data() + std::min(leaf.count, kLeaf));
    if (leaf.count <= kLeaf) return;
    const std::vector<int>& more = overflow_.at(link);
    rows.insert(rows.end(), more.begin(), more.end());
  }

  std::vector<int> order_;  // of the bits
  int root_ = 0;
  ChunkedVector<std::array<int, 2>> splits_;  // where each value of the bit leads to
  ChunkedVector<Leaf> leaves_;
  std::vector<int> free_splits_;
  std::vector<int> free_leaves_;
  std::map<int, std::vector<int>> overflow_;  // by link: rows of leaves at full depth beyond kLeaf
};

}  // namespace tutti::internal
