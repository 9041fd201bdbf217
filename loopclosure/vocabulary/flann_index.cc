#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_index.h>

#include <algorithm>
#include <cmath>

#include "core/numbers.h"
#include "core/shuffle.h"
#include "core/state_archive.h"
#include "loopclosure/vocabulary/descriptor_index.h"
#include "loopclosure/vocabulary/word_storage.h"

namespace tutti {
namespace {

using Tree = flann::KDTreeIndex<flann::L2<float>>;

constexpr int kSpareDeadWords = 1024;  // the trees are not grown anew for fewer

using internal::Index;

struct GrownTree {
  std::unique_ptr<Tree> index;
  std::vector<int> rows;  // row number in the storage, by the tree's own point number
  internal::Shuffler shuffler;
};

// Collects the two nearest living words over all trees, by squared distance and word id.
class TopTwo : public flann::ResultSet<float> {
 public:
  TopTwo(const internal::WordStorage& storage, const std::vector<char>& alive)
      : storage_(storage), alive_(alive) {}
  void SetTree(const std::vector<int>* rows) { rows_ = rows; }
  bool full() const override { return nearest_.second >= 0; }
  void addPoint(float distance, std::size_t index) override {
    if (distance > nearest_.second_distance) return;  // most of them: before memory is touched
    const int row = (*rows_)[index];
    if (alive_[Index(row)] != 0) nearest_.Offer(storage_.WordOf(row), distance);
  }
  float worstDist() const override { return nearest_.second_distance; }
  const TwoNearest& nearest() const { return nearest_; }

 private:
  const internal::WordStorage& storage_;
  const std::vector<char>& alive_;
  const std::vector<int>* rows_ = nullptr;
  TwoNearest nearest_;
};

class FlannIndex : public internal::StoredIndex<FlannIndex> {
 public:
  FlannIndex(int dimensions, int trees, int checks, std::uint64_t seed)
      : StoredIndex(Index(dimensions) * sizeof(float)),
        dimensions_(Index(dimensions)),
        checks_per_tree_(std::max(1, checks / trees)) {
    for (int t = 0; t < trees; ++t) trees_.push_back({nullptr, {}, internal::Shuffler(seed, t)});
  }

  void Add(const std::vector<int>& words, const cv::Mat& rows) override {
    CV_Assert(rows.type() == CV_32F && Index(rows.cols) == dimensions_ && Index(rows.rows) == words.size());
    std::vector<int> added;
    for (std::size_t i = 0; i < words.size(); ++i) {
      int row = storage_.RowOf(words[i]);
      if (row < 0) {
        row = storage_.Add(words[i], rows.ptr(static_cast<int>(i)));
        alive_.resize(std::max(alive_.size(), Index(row) + 1), 0);
        added.push_back(row);
      }
      size_ += alive_[Index(row)] != 0 ? 0 : 1;
      alive_[Index(row)] = 1;  // one that came back is in the trees still
    }
    for (GrownTree& tree : trees_) Insert(added, tree);
  }

  void Remove(int word) override {
    const int row = storage_.RowOf(word);
    if (row < 0 || alive_[Index(row)] == 0) return;
    alive_[Index(row)] = 0;
    --size_;
    if (storage_.size() > 2 * size_ + kSpareDeadWords) GrowAnew();
  }

  std::vector<TwoNearest> Search(const cv::Mat& descriptors) const override {
    const flann::SearchParams parameters(checks_per_tree_);
    std::vector<TwoNearest> found;
    for (int i = 0; i < descriptors.rows; ++i) {
      TopTwo result(storage_, alive_);
      for (const GrownTree& tree : trees_) {
        if (!tree.index) continue;
        result.SetTree(&tree.rows);
        tree.index->findNeighbors(result, descriptors.ptr<float>(i), parameters);
      }
      found.push_back(result.nearest());
      // FLANN's L2 is squared; the vocabulary decides on true distance.
      found.back().first_distance = std::sqrt(found.back().first_distance);
      found.back().second_distance = std::sqrt(found.back().second_distance);
    }
    return found;
  }

  const std::uint8_t* Find(int word) const override {
    const int row = storage_.RowOf(word);
    return row < 0 || alive_[Index(row)] == 0 ? nullptr : storage_.At(row);
  }

  int size() const override { return size_; }

  template <class Archive>
  void StateOf(Archive& archive, const std::vector<internal::PackedMat>& known) {
    storage_.State(archive, CV_32F, known);
    const std::vector<int> ranks = storage_.Ranks();
    std::vector<char> alive;  // by rank
    if constexpr (!Archive::kReading)
      storage_.ForEach([&](int, int row) { alive.push_back(alive_[Index(row)]); });
    archive(alive);
    if constexpr (Archive::kReading) {
      if (alive.size() != ranks.size()) archive.Damaged("words that may be there or not");
      for (const char word : alive) alive_.push_back(word != 0 ? 1 : 0);
      size_ = static_cast<int>(std::count(alive_.begin(), alive_.end(), 1));
    }
    for (GrownTree& tree : trees_) {
      std::vector<int> rows;
      for (const int row : tree.rows) rows.push_back(ranks[Index(row)]);
      archive(tree.shuffler, rows);
      if constexpr (Archive::kReading) {
        std::vector<int> sorted = rows;
        std::sort(sorted.begin(), sorted.end());
        if (sorted != ranks) archive.Damaged("a kd-tree without some of the words");
        for (const int row : rows) InsertOne(row, tree);
      }
    }
  }

 private:
  // Each tree takes new words in an order of its own.
  void Insert(std::vector<int> rows, GrownTree& tree) {
    tree.shuffler.Shuffle(rows);
    for (const int row : rows) InsertOne(row, tree);
  }

  // A tree is what the order of its insertions made of it.
  void InsertOne(int row, GrownTree& tree) {
    // FLANN's matrices are not const; it only reads.
    const flann::Matrix<float> one(reinterpret_cast<float*>(storage_.At(row)), 1, dimensions_);
    if (!tree.index) {
      tree.index = std::make_unique<Tree>(one, flann::KDTreeIndexParams(1));
      tree.index->buildIndex();  // of a single point: nothing to choose at random
    } else {
      tree.index->addPoints(one, 0.0f);  // 0: never rebuild
    }
    tree.rows.push_back(row);
  }

  // FLANN's trees can't let go of a word: without the dead ones all are grown anew.
  void GrowAnew() {
    std::vector<int> living;
    std::vector<int> dead;
    storage_.ForEach([&](int, int row) { (alive_[Index(row)] != 0 ? living : dead).push_back(row); });
    for (GrownTree& tree : trees_) {
      tree.index.reset();
      tree.rows.clear();
      Insert(living, tree);
    }
    for (const int row : dead) storage_.Free(row);
  }

  std::size_t dimensions_;
  int checks_per_tree_;
  int size_ = 0;             // living words
  std::vector<char> alive_;  // by row number: found by searches; the dead ones stay in the trees
  std::vector<GrownTree> trees_;
};

}  // namespace

std::unique_ptr<DescriptorIndex> MakeFlannIndex(int dimensions, int trees, int checks, std::uint64_t seed) {
  return std::make_unique<FlannIndex>(dimensions, trees, checks, seed);
}

}  // namespace tutti
