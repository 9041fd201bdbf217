#include <algorithm>
#include <cmath>

#include "core/index.h"
#include "core/shuffle.h"
#include "core/state_archive.h"
#include "loopclosure/vocabulary/descriptor_index.h"
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

class KdForestIndex : public DescriptorIndex {
 public:
  KdForestIndex(int dimensions, int trees, int checks, std::uint64_t seed)
      : dimensions_(dimensions),
        checks_per_tree_(std::max(1, checks / trees)),
        storage_(internal::Index(dimensions) * sizeof(float)) {
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

  const std::uint8_t* Find(int word) const override {
    const int row = storage_.RowOf(word);
    return row < 0 ? nullptr : storage_.At(row);
  }

  int size() const override { return storage_.size(); }

  void State(internal::StateWriter& archive, const std::vector<internal::PackedMat>& known) override {
    StateOf(archive, known);
  }
  void State(internal::StateReader& archive, const std::vector<internal::PackedMat>& known) override {
    StateOf(archive, known);
  }

 private:
  template <class Archive>
  void StateOf(Archive& archive, const std::vector<internal::PackedMat>& known) {
    storage_.State(archive, CV_32F, known);
    const std::vector<int> ranks = storage_.Ranks();
    for (GrownTree& tree : trees_) {
      archive(tree.shuffler);
      tree.tree.State(archive, ranks);
    }
  }

  // Each tree takes new words in an order of its own.
  struct GrownTree {
    internal::KdTree tree;
    internal::Shuffler shuffler;
  };

  int dimensions_;
  int checks_per_tree_;
  internal::WordStorage storage_;
  std::vector<GrownTree> trees_;
};

}  // namespace

std::unique_ptr<DescriptorIndex> MakeKdForestIndex(int dimensions, int trees, int checks,
                                                   std::uint64_t seed) {
  return std::make_unique<KdForestIndex>(dimensions, trees, checks, seed);
}

}  // namespace tutti
