#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_index.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <sstream>

#include "byte_stream.h"
#include "tutti/loopclosure/descriptor_index.h"
#include "word_storage.h"

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

using Distance = flann::L2<float>;
using Tree = flann::KDTreeIndex<Distance>;
using Mask = std::uint64_t;

constexpr int kShadowBit = 63;         // of the tree that is being grown anew
constexpr int kSpareDeadWords = 1024;  // a tree is not grown anew for fewer
constexpr int kGrowPerImage = 2048;    // words that a tree in the making takes in per Maintain

std::size_t Index(int i) { return static_cast<std::size_t>(i); }
Mask Bit(std::size_t i) { return Mask{1} << i; }

struct GrownTree {
  std::unique_ptr<Tree> index;
  std::vector<int> rows;  // row number in the storage, by the tree's own point number
  std::mt19937_64 generator;
};

// A shuffle of our own: std::shuffle may differ between standard libraries.
void Shuffle(std::vector<int>& order, std::mt19937_64& generator) {
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[generator() % i]);
}

// Collects the two nearest living words over all trees, by squared distance and word id.
class TopTwo : public flann::ResultSet<float> {
 public:
  TopTwo(const internal::WordStorage& storage, const std::vector<char>& alive)
      : storage_(storage), alive_(alive) {}
  void SetTree(const std::vector<int>* rows) { rows_ = rows; }
  bool full() const override { return nearest_.second >= 0; }
  void addPoint(float distance, size_t index) override {
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

class KdForestIndex : public DescriptorIndex {
 public:
  KdForestIndex(int dimensions, int trees, int checks, std::uint64_t seed)
      : dimensions_(Index(dimensions)),
        checks_per_tree_(std::max(1, checks / trees)),
        storage_(Index(dimensions) * sizeof(float)) {
    for (int t = 0; t < trees; ++t) {
      trees_.push_back(
          {nullptr, {}, std::mt19937_64(seed + 0x9e3779b97f4a7c15ull * static_cast<std::uint64_t>(t))});
    }
  }

  void Add(const std::vector<int>& words, const cv::Mat& rows) override {
    CV_Assert(rows.type() == CV_32F && Index(rows.cols) == dimensions_ && Index(rows.rows) == words.size());
    std::vector<int> added;
    for (std::size_t i = 0; i < words.size(); ++i) {
      int row = storage_.RowOf(words[i]);
      if (row < 0) {
        row = storage_.Add(words[i], rows.ptr(static_cast<int>(i)));
        if (Index(row) >= alive_.size()) {
          alive_.resize(Index(row) + 1, 0);
          held_by_.resize(Index(row) + 1, 0);
        }
        held_by_[Index(row)] = 0;
      } else if (alive_[Index(row)] != 0) {
        continue;
      }
      alive_[Index(row)] = 1;
      added.push_back(row);
      ++size_;
    }
    for (std::size_t t = 0; t < trees_.size(); ++t) AddToTree(added, Bit(t), trees_[t]);
    if (growing_ >= 0) AddToTree(added, Bit(kShadowBit), shadow_);
  }

  void Remove(int word) override {
    const int row = storage_.RowOf(word);
    if (row < 0 || alive_[Index(row)] == 0) return;
    alive_[Index(row)] = 0;
    --size_;
    FreeIfUnused(row);
  }

  TwoNearest Search(const std::uint8_t* descriptor) const override {
    TopTwo result(storage_, alive_);
    const float* vector = reinterpret_cast<const float*>(descriptor);
    const flann::SearchParams parameters(checks_per_tree_);
    for (const GrownTree& tree : trees_) {
      if (!tree.index) continue;
      result.SetTree(&tree.rows);
      tree.index->findNeighbors(result, vector, parameters);
    }
    TwoNearest nearest = result.nearest();
    // FLANN's L2 is squared; the vocabulary decides on true distance.
    nearest.first_distance = std::sqrt(nearest.first_distance);
    nearest.second_distance = std::sqrt(nearest.second_distance);
    return nearest;
  }

  void Maintain() override {
    if (growing_ < 0) StartGrowing();
    if (growing_ < 0) return;
    std::vector<int> taken;
    while (!pending_.empty() && static_cast<int>(taken.size()) < kGrowPerImage) {
      const int row = pending_.back();
      pending_.pop_back();
      // Freed, dead, or taken in already because it came back.
      if (alive_[Index(row)] != 0 && (held_by_[Index(row)] & Bit(kShadowBit)) == 0) taken.push_back(row);
    }
    InsertInOrder(taken, Bit(kShadowBit), shadow_);
    if (pending_.empty()) Replace();
  }

  const std::uint8_t* Find(int word) const override {
    const int row = storage_.RowOf(word);
    return row < 0 || alive_[Index(row)] == 0 ? nullptr : storage_.At(row);
  }

  int size() const override { return size_; }

  void Save(internal::ByteWriter& out) const override {
    out.Put<std::int32_t>(storage_.end());
    for (int row = 0; row < storage_.end(); ++row) {
      out.Put<std::int32_t>(storage_.WordOf(row));
      if (storage_.WordOf(row) < 0) continue;
      out.Put<char>(alive_[Index(row)]);
      out.PutRaw(storage_.At(row), storage_.row_bytes());
    }
    out.Put<std::uint64_t>(trees_.size());
    for (const GrownTree& tree : trees_) SaveTree(tree, out);
    out.Put<std::int32_t>(growing_);
    SaveTree(shadow_, out);
    out.PutVector(pending_);
    out.PutVector(storage_.FreeRows());
  }

  void Load(internal::ByteReader& in) override {
    const int rows = in.Get<std::int32_t>();
    std::vector<std::uint8_t> descriptor(storage_.row_bytes());
    for (int row = 0; row < rows; ++row) {
      const int word = in.Get<std::int32_t>();
      if (word < 0) {
        storage_.AddFree();
        alive_.push_back(0);
      } else {
        if (word >= internal::WordStorage::kMostWords || storage_.RowOf(word) >= 0) {
          in.Damaged("an impossible word, or one that is there twice");
        }
        alive_.push_back(in.Get<char>() != 0 ? 1 : 0);
        in.GetRaw(descriptor.data(), descriptor.size());
        storage_.Add(word, descriptor.data());
      }
      size_ += alive_.back();
      held_by_.push_back(0);
    }
    if (in.Get<std::uint64_t>() != trees_.size()) in.Damaged("another number of kd-trees");
    for (std::size_t t = 0; t < trees_.size(); ++t) LoadTree(in, Bit(t), trees_[t]);
    growing_ = in.Get<std::int32_t>();
    if (growing_ < -1 || growing_ >= static_cast<int>(trees_.size())) in.Damaged("no such kd-tree");
    LoadTree(in, Bit(kShadowBit), shadow_);
    pending_ = in.GetVector<int>();
    for (const int row : pending_) {
      if (row < 0 || row >= storage_.end()) in.Damaged("a word that is not there");
    }
    if (growing_ < 0 && !(shadow_.rows.empty() && pending_.empty())) in.Damaged("a kd-tree out of place");
    if (!storage_.SetFreeRows(in.GetVector<int>())) in.Damaged("free rows that are in use");
  }

 private:
  // Each tree takes new words in an order of its own.
  void AddToTree(const std::vector<int>& rows, Mask bit, GrownTree& tree) {
    std::vector<int> order = rows;
    Shuffle(order, tree.generator);
    order.erase(std::remove_if(order.begin(), order.end(),
                               [&](int row) { return (held_by_[Index(row)] & bit) != 0; }),
                order.end());
    InsertInOrder(order, bit, tree);
  }

  void InsertInOrder(const std::vector<int>& rows, Mask bit, GrownTree& tree) {
    for (const int row : rows) {
      // FLANN's matrices are not const; it only reads.
      float* point = reinterpret_cast<float*>(storage_.At(row));
      const flann::Matrix<float> one(point, 1, dimensions_);
      if (!tree.index) {
        tree.index = std::make_unique<Tree>(one, flann::KDTreeIndexParams(1));
        tree.index->buildIndex();  // of a single point: nothing to choose at random
      } else {
        tree.index->addPoints(one, 0.0f);  // 0: never rebuild
      }
      tree.rows.push_back(row);
      held_by_[Index(row)] |= bit;
    }
  }

  void FreeIfUnused(int row) {
    if (alive_[Index(row)] == 0 && held_by_[Index(row)] == 0) storage_.Free(row);
  }

  void StartGrowing() {
    for (std::size_t t = 0; t < trees_.size(); ++t) {
      if (static_cast<int>(trees_[t].rows.size()) <= 2 * size_ + kSpareDeadWords) continue;
      growing_ = static_cast<int>(t);
      shadow_ = {nullptr, {}, trees_[t].generator};
      for (int row = 0; row < storage_.end(); ++row) {
        if (storage_.WordOf(row) >= 0 && alive_[Index(row)] != 0) pending_.push_back(row);
      }
      Shuffle(pending_, shadow_.generator);
      return;
    }
  }

  // The tree in the making takes its place.
  void Replace() {
    GrownTree& old = trees_[Index(growing_)];
    for (const int row : old.rows) held_by_[Index(row)] &= ~Bit(Index(growing_));
    for (const int row : shadow_.rows) {
      held_by_[Index(row)] &= ~Bit(kShadowBit);
      held_by_[Index(row)] |= Bit(Index(growing_));
    }
    for (const int row : old.rows) {
      if (storage_.WordOf(row) >= 0) FreeIfUnused(row);
    }
    old = std::move(shadow_);
    shadow_ = GrownTree();
    growing_ = -1;
  }

  static void SaveTree(const GrownTree& tree, internal::ByteWriter& out) {
    std::ostringstream generator;
    generator << tree.generator;
    out.PutString(generator.str());
    out.PutVector(tree.rows);
  }

  // A tree is what the order of its insertions made of it.
  void LoadTree(internal::ByteReader& in, Mask bit, GrownTree& tree) {
    std::istringstream generator(in.GetString());
    generator >> tree.generator;
    if (!generator) in.Damaged("the state of a random generator");
    const std::vector<int> rows = in.GetVector<int>();
    for (const int row : rows) {
      if (row < 0 || row >= storage_.end() || storage_.WordOf(row) < 0 || (held_by_[Index(row)] & bit) != 0) {
        in.Damaged("a kd-tree with a word that is not there");
      }
      InsertInOrder({row}, bit, tree);
    }
  }

  std::size_t dimensions_;
  int checks_per_tree_;
  int size_ = 0;
  internal::WordStorage storage_;
  std::vector<char> alive_;    // by row number: found by searches
  std::vector<Mask> held_by_;  // by row number: which trees have it as a leaf; they read its descriptor
  std::vector<GrownTree> trees_;
  int growing_ = -1;  // number of the tree that is grown anew, -1: none
  GrownTree shadow_;
  std::vector<int> pending_;  // row numbers that shadow_ has still to take in, the next one last
};

}  // namespace

std::unique_ptr<DescriptorIndex> MakeKdForestIndex(int dimensions, int trees, int checks,
                                                   std::uint64_t seed) {
  return std::make_unique<KdForestIndex>(dimensions, trees, checks, seed);
}

}  // namespace tutti
