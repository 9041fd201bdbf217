// A binary trie over the bits of descriptors, in a random order of the bits.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <random>
#include <vector>

#include "word_storage.h"

namespace tutti::internal {

/// Rows of a WordStorage by the bits of their descriptors. A subtree is split when it holds more than kLeaf
/// rows and joined when it holds no more again: its shape depends on what is in it, not on how that came
/// about, and no insertion or removal costs more than a walk down.
class BitTrie {
 public:
  static constexpr int kLeaf = 8;

  BitTrie(int bytes, std::mt19937_64& generator) : order_(static_cast<std::size_t>(8 * bytes)) {
    std::iota(order_.begin(), order_.end(), 0);
    for (std::size_t i = order_.size(); i > 1; --i) std::swap(order_[i - 1], order_[generator() % i]);
    nodes_.emplace_back();
  }

  void Insert(int row, const WordStorage& storage) {
    const std::uint8_t* descriptor = storage.At(row);
    int node = 0;
    for (std::size_t depth = 0;; ++depth) {
      const int count = ++At(node).count;
      if (!At(node).split) {
        if (count <= kLeaf) {
          At(node).rows[static_cast<std::size_t>(count - 1)] = row;
          return;
        }
        if (depth == order_.size()) {  // more than kLeaf equal descriptors
          overflow_[node].push_back(row);
          return;
        }
        Split(node, depth, storage);
      }
      node = At(node).child[Bit(descriptor, depth)];
    }
  }

  /// The row must be there.
  void Remove(int row, const WordStorage& storage) {
    const std::uint8_t* descriptor = storage.At(row);
    int node = 0;
    for (std::size_t depth = 0;; ++depth) {
      const int count = --At(node).count;
      if (!At(node).split) {
        RemoveFromLeaf(node, row);
        return;
      }
      if (count <= kLeaf) {
        Join(node, row);
        return;
      }
      node = At(node).child[Bit(descriptor, depth)];
    }
  }

  /// Appends the rows of the leaf that the descriptor falls into, and of those that one other bit leads to.
  void Collect(const std::uint8_t* descriptor, std::vector<int>& rows) const {
    // The first bits in the trie's order, gathered once: the walks below ask for them again and again.
    std::array<std::uint8_t, kGathered> bits;
    const std::size_t gathered = std::min(kGathered, order_.size());
    for (std::size_t d = 0; d < gathered; ++d) bits[d] = static_cast<std::uint8_t>(Bit(descriptor, d));
    const auto bit_at = [&](std::size_t depth) -> std::size_t {
      return depth < kGathered ? bits[depth] : Bit(descriptor, depth);
    };
    int node = 0;
    for (std::size_t depth = 0; At(node).split; ++depth) {
      const std::size_t bit = bit_at(depth);
      int other = At(node).child[1 - bit];
      for (std::size_t below = depth + 1; At(other).split; ++below) other = At(other).child[bit_at(below)];
      AppendRows(other, rows);
      node = At(node).child[bit];
    }
    AppendRows(node, rows);
  }

 private:
  struct Node {
    bool split = false;
    int count = 0;  // rows in the subtree
    union {
      std::array<int, 2> child;
      std::array<int, kLeaf> rows;
    };
    Node() : rows{} {}
  };

  Node& At(int node) { return nodes_[static_cast<std::size_t>(node)]; }
  const Node& At(int node) const { return nodes_[static_cast<std::size_t>(node)]; }

  std::size_t Bit(const std::uint8_t* descriptor, std::size_t depth) const {
    const int bit = order_[depth];
    return (descriptor[bit >> 3] >> (bit & 7)) & 1u;
  }

  int NewNode() {
    if (free_.empty()) {
      nodes_.emplace_back();
      return static_cast<int>(nodes_.size()) - 1;
    }
    const int node = free_.back();
    free_.pop_back();
    At(node) = Node();
    return node;
  }

  void Split(int node, std::size_t depth, const WordStorage& storage) {
    const std::array<int, kLeaf> rows = At(node).rows;
    const std::array<int, 2> child = {NewNode(), NewNode()};
    for (const int row : rows) {
      Node& leaf = At(child[Bit(storage.At(row), depth)]);
      leaf.rows[static_cast<std::size_t>(leaf.count++)] = row;
    }
    At(node).split = true;
    At(node).child = child;
  }

  // The subtree, less one row, becomes a leaf again.
  void Join(int node, int removed) {
    std::vector<int> rows;
    for (const int child : std::array<int, 2>(At(node).child)) TakeApart(child, rows);
    At(node).split = false;
    std::size_t i = 0;
    for (const int row : rows) {
      if (row != removed) At(node).rows[i++] = row;
    }
  }

  void TakeApart(int node, std::vector<int>& rows) {
    if (At(node).split) {
      for (const int child : std::array<int, 2>(At(node).child)) TakeApart(child, rows);
    } else {
      AppendRows(node, rows);
      overflow_.erase(node);
    }
    free_.push_back(node);
  }

  void RemoveFromLeaf(int node, int row) {
    // Its count is one less already.
    std::array<int, kLeaf>& rows = At(node).rows;
    const auto more = overflow_.find(node);
    int* const end = rows.data() + std::min(At(node).count + 1, kLeaf);
    int* const found = std::find(rows.data(), end, row);
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

  void AppendRows(int node, std::vector<int>& rows) const {
    const Node& leaf = At(node);
    rows.insert(rows.end(), leaf.rows.data(), leaf.rows.data() + std::min(leaf.count, kLeaf));
    if (leaf.count <= kLeaf) return;
    const std::vector<int>& more = overflow_.at(node);
    rows.insert(rows.end(), more.begin(), more.end());
  }

  static constexpr std::size_t kGathered = 32;

  std::vector<int> order_;  // of the bits
  std::vector<Node> nodes_;
  std::vector<int> free_;
  std::map<int, std::vector<int>> overflow_;  // rows of leaves at full depth beyond kLeaf
};

}  // namespace tutti::internal
