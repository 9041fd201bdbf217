// One kd-tree over the words of a vocabulary.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/numbers.h"
#include "core/state_archive.h"
#include "loopclosure/features/distances.h"
#include "loopclosure/vocabulary/descriptor_index.h"
#include "loopclosure/vocabulary/word_storage.h"

namespace tutti::internal {

/// A kd-tree with one row of a WordStorage in each leaf, grown and searched by the rules of FLANN's
/// KDTreeIndex (Muja & Lowe 2009): a leaf that a new row falls into is split half-way along the dimension in
/// which the two differ most; a search goes down to the nearest leaf and then from the branch not taken that
/// is nearest, best bin first.
///
/// What FLANN's has not: a removed row leaves nothing behind (its sibling takes their parent's place), and a
/// search costs what it looks at, not a bitset and a heap of the size of the index.
class KdTree {
 public:
  explicit KdTree(int dimensions) : dimensions_(dimensions) {}

  /// A row on its way down to where it will be inserted.
  struct Descent {
    int row = -1;
    int node = -1;         // -1: it is in
    bool at_leaf = false;  // whose descriptor was asked for
  };
  /// The row must not be in the tree, and keep its descriptor while it is. The tree must not change but by
  /// GoOn until the row is in.
  Descent Begin(int row) {
    while (leaf_of_row_.size() <= Index(row)) leaf_of_row_.Extend();
    if (size_++ > 0) return {row, kRoot, false};
    if (nodes_.size() == 0) NewPair(-1);
    SetLeaf(kRoot, row);
    return {row, -1, false};
  }
  /// One step down; false once the row is in. Several trees take turns: while one waits for memory, others go
  /// on.
  bool GoOn(const WordStorage& storage, Descent& descent) {
    if (descent.node < 0) return false;
    const Node& node = At(descent.node);
    if (!IsLeaf(node)) {
      descent.node = NextTo(node, Point(descent.row, storage));
      __builtin_prefetch(&At(descent.node));
    } else if (!descent.at_leaf) {
      descent.at_leaf = true;
      PrefetchRow(node.link, storage);
    } else {
      Split(descent.node, descent.row, storage);
      descent.node = -1;
    }
    return descent.node >= 0;
  }

  /// The row must be in the tree.
  void Remove(int row) {
    const int leaf = leaf_of_row_[Index(row)];
    if (--size_ == 0) return;
    const int pair = leaf / 2;
    Place(parent_[Index(pair)], At(leaf ^ 1));
    free_pairs_.push_back(pair);
  }

  /// Offers the words of up to `checks` leaves to each query's `nearest`, by squared distance; of more until
  /// it is full. The queries take turns: while one waits for memory, others go on. What each finds does not
  /// depend on the others.
  void Search(const std::vector<const float*>& queries, int checks, const WordStorage& storage,
              std::vector<TwoNearest>& nearest) const {
    if (size_ == 0) return;
    std::vector<Walk> walks(queries.size());
    std::vector<Walk*> active;
    for (std::size_t i = 0; i < queries.size(); ++i) {
      walks[i].query = queries[i];
      walks[i].nearest = &nearest[i];
      walks[i].branches.reserve(Index(MostBranches(checks)) + 1);
      active.push_back(&walks[i]);
    }
    while (!active.empty()) {
      for (std::size_t i = 0; i < active.size();) {
        if (Step(checks, storage, *active[i])) {
          ++i;
        } else {
          active[i] = active.back();
          active.pop_back();
        }
      }
    }
  }

  /// The shape, with each row by its number in `ranks` (WordStorage::Ranks). It is read into an empty tree,
  /// and must have all rows, each once.
  template <class Archive>
  void State(Archive& archive, const std::vector<int>& ranks) {
    std::vector<int> nodes;  // from the root on, the first child first: the dimension, or of a leaf -1 - rank
    std::vector<float> values;  // of the splits
    if constexpr (!Archive::kReading) List(ranks, nodes, values);
    archive(SmallNumbers{&nodes}, Planes{&values});
    if constexpr (Archive::kReading) {
      if (!Grow(static_cast<int>(ranks.size()), nodes, values)) archive.Damaged("an impossible kd-tree");
    }
  }

 private:
  // Two children lie side by side, at an even number: their pair is half of it.
  struct Node {
    int link = 0;        // its first child; of a leaf: its row
    int dimension = -1;  // -1: a leaf
    float value = 0.0f;  // below it: the first child
  };
  struct Branch {
    float distance;
    int node;
  };
  static constexpr int kRoot = 0;
  // A search on its way.
  struct Walk {
    const float* query = nullptr;
    TwoNearest* nearest = nullptr;
    int node = kRoot;
    float distance = 0.0f;  // least that a leaf below the node can have
    bool at_leaf = false;   // its descriptor was asked for
    int checked = 0;
    std::vector<Branch> branches;  // not taken; the nearest last, and no more than may still be taken
  };

  static bool IsLeaf(const Node& node) { return node.dimension < 0; }
  Node& At(int node) { return nodes_[Index(node)]; }
  const Node& At(int node) const { return nodes_[Index(node)]; }
  static int NextTo(const Node& node, const float* point) {
    return node.link + (point[node.dimension] < node.value ? 0 : 1);
  }
  static const float* Point(int row, const WordStorage& storage) {
    return reinterpret_cast<const float*>(storage.At(row));
  }

  static void PrefetchRow(int row, const WordStorage& storage) {
    const char* descriptor = reinterpret_cast<const char*>(storage.At(row));
    for (std::size_t byte = 0; byte < storage.row_bytes(); byte += 64) __builtin_prefetch(descriptor + byte);
  }

  // Returns its first node.
  int NewPair(int parent) {
    int pair = static_cast<int>(parent_.size());
    if (free_pairs_.empty()) {
      parent_.Extend();
      nodes_.Extend();
      nodes_.Extend();
    } else {
      pair = free_pairs_.back();
      free_pairs_.pop_back();
    }
    parent_[Index(pair)] = parent;
    return 2 * pair;
  }

  void SetLeaf(int node, int row) {
    At(node) = {row, -1, 0.0f};
    leaf_of_row_[Index(row)] = node;
  }

  void List(const std::vector<int>& ranks, std::vector<int>& nodes, std::vector<float>& values) const {
    std::vector<int> ahead;
    if (size_ > 0) ahead.push_back(kRoot);
    while (!ahead.empty()) {
      const Node& node = At(ahead.back());
      ahead.pop_back();
      nodes.push_back(IsLeaf(node) ? -1 - ranks[Index(node.link)] : node.dimension);
      if (IsLeaf(node)) continue;
      values.push_back(node.value);
      ahead.insert(ahead.end(), {node.link + 1, node.link});
    }
  }

  // The tree that List described, of `rows` rows; false if there is no such tree.
  bool Grow(int rows, const std::vector<int>& nodes, const std::vector<float>& values) {
    for (int row = 0; row < rows; ++row) {
      leaf_of_row_.Extend();
      leaf_of_row_[Index(row)] = -1;
    }
    std::vector<int> ahead;
    if (rows > 0) ahead.push_back(NewPair(-1));
    auto value = values.begin();
    for (const int listed : nodes) {
      if (ahead.empty()) return false;
      const int node = ahead.back();
      ahead.pop_back();
      const int row = -1 - listed;
      if (row >= 0) {
        if (row >= rows || leaf_of_row_[Index(row)] >= 0) return false;
        SetLeaf(node, row);
        ++size_;
        continue;
      }
      if (listed >= dimensions_ || value == values.end()) return false;
      const int child = NewPair(node);
      At(node) = {child, listed, *value++};
      ahead.insert(ahead.end(), {child + 1, child});
    }
    return ahead.empty() && value == values.end() && size_ == rows;
  }

  // What was elsewhere is here now.
  void Place(int node, const Node& content) {
    At(node) = content;
    if (IsLeaf(content)) {
      leaf_of_row_[Index(content.link)] = node;
    } else {
      parent_[Index(content.link / 2)] = node;
    }
  }

  void Split(int node, int row, const WordStorage& storage) {
    const int old_row = At(node).link;
    const float* point = Point(row, storage);
    const float* old_point = Point(old_row, storage);
    int dimension = 0;
    float widest = 0.0f;
    for (int d = 0; d < dimensions_; ++d) {
      const float span = std::abs(point[d] - old_point[d]);
      if (span > widest) {
        widest = span;
        dimension = d;
      }
    }
    const int child = NewPair(node);
    const int side = point[dimension] < old_point[dimension] ? 0 : 1;
    SetLeaf(child + side, row);
    SetLeaf(child + 1 - side, old_row);
    At(node) = {child, dimension, (point[dimension] + old_point[dimension]) / 2};
  }

  // One node further; false when there is nothing left to do.
  bool Step(int checks, const WordStorage& storage, Walk& walk) const {
    const Node& node = At(walk.node);
    if (!IsLeaf(node)) {
      Descend(node, checks, walk);
      return true;
    }
    if (!walk.at_leaf) {
      walk.at_leaf = true;
      PrefetchRow(node.link, storage);
      return true;
    }
    Check(node.link, storage, walk);
    return walk.checked < checks || walk.nearest->second < 0 ? TakeNearestBranch(walk) : false;
  }

  static int MostBranches(int checks) { return std::max(1, checks - 1); }

  void Descend(const Node& node, int checks, Walk& walk) const {
    const float difference = walk.query[node.dimension] - node.value;
    const int side = difference < 0 ? 0 : 1;
    const float distance = walk.distance + difference * difference;
    if (distance < walk.nearest->second_distance) {
      KeepBranch({distance, node.link + 1 - side}, MostBranches(checks), walk.branches);
    }
    walk.node = node.link + side;
    __builtin_prefetch(&At(walk.node));
  }

  static void KeepBranch(const Branch& branch, int most, std::vector<Branch>& branches) {
    const float distance = branch.distance;
    if (static_cast<int>(branches.size()) < most) {
      branches.push_back(branch);
      std::size_t at = branches.size() - 1;
      for (; at > 0 && branches[at - 1].distance <= distance; --at) branches[at] = branches[at - 1];
      branches[at] = branch;
      return;
    }
    if (distance >= branches.front().distance) return;  // else the farthest goes
    std::size_t at = 0;
    for (; at + 1 < branches.size() && branches[at + 1].distance > distance; ++at)
      branches[at] = branches[at + 1];
    branches[at] = branch;
  }

  bool TakeNearestBranch(Walk& walk) const {
    if (walk.branches.empty()) return false;
    walk.node = walk.branches.back().node;
    walk.distance = walk.branches.back().distance;
    walk.branches.pop_back();
    walk.at_leaf = false;
    __builtin_prefetch(&At(walk.node));
    return walk.distance <= walk.nearest->second_distance;  // else the others are no nearer
  }

  void Check(int row, const WordStorage& storage, Walk& walk) const {
    float distance = 0.0f;
    SquaredDistances(walk.query, Point(row, storage), 1, dimensions_, 0, &distance);
    if (distance <= walk.nearest->second_distance) walk.nearest->Offer(storage.WordOf(row), distance);
    ++walk.checked;
  }

  int dimensions_;
  int size_ = 0;  // rows
  ChunkedVector<Node> nodes_;
  ChunkedVector<int> parent_;       // by pair: the node whose children they are
  ChunkedVector<int> leaf_of_row_;  // by row in the tree
  std::vector<int> free_pairs_;
};

}  // namespace tutti::internal
