#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_index.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "tutti/loopclosure/descriptor_index.h"

namespace tutti {

void TwoNearest::Offer(int index, float distance) {
  if (index == first || index == second) return;
  if (distance < first_distance || (distance == first_distance && index < first)) {
    second = first;
    second_distance = first_distance;
    first = index;
    first_distance = distance;
  } else if (distance < second_distance || (distance == second_distance && index < second)) {
    second = index;
    second_distance = distance;
  }
}

namespace {

using Distance = flann::L2<float>;
using Tree = flann::KDTreeIndex<Distance>;

// Collects the two nearest over all trees, by squared distance and row number.
class TopTwo : public flann::ResultSet<float> {
 public:
  void SetTree(const std::vector<int>* rows) { rows_ = rows; }
  bool full() const override { return nearest_.second >= 0; }
  void addPoint(float distance, size_t index) override { nearest_.Offer((*rows_)[index], distance); }
  float worstDist() const override { return nearest_.second_distance; }
  const TwoNearest& nearest() const { return nearest_; }

 private:
  const std::vector<int>* rows_ = nullptr;
  TwoNearest nearest_;
};

class KdForestIndex : public DescriptorIndex {
 public:
  KdForestIndex(int dimensions, int trees, int checks, std::uint64_t seed)
      : dimensions_(static_cast<std::size_t>(dimensions)), checks_per_tree_(std::max(1, checks / trees)) {
    for (int t = 0; t < trees; ++t) {
      trees_.push_back(
          {nullptr, {}, std::mt19937_64(seed + 0x9e3779b97f4a7c15ull * static_cast<std::uint64_t>(t))});
    }
  }

  void Add(const cv::Mat& rows) override {
    CV_Assert(rows.type() == CV_32F && static_cast<std::size_t>(rows.cols) == dimensions_);
    kept_.push_back(rows);
    for (GrownTree& tree : trees_) AddToTree(rows, tree);
    size_ += rows.rows;
  }

  TwoNearest Search(const std::uint8_t* descriptor) const override {
    TopTwo result;
    const float* vector = reinterpret_cast<const float*>(descriptor);
    const flann::SearchParams parameters(checks_per_tree_);
    for (const GrownTree& tree : trees_) {
      if (!tree.index) break;
      result.SetTree(&tree.rows);
      tree.index->findNeighbors(result, vector, parameters);
    }
    TwoNearest nearest = result.nearest();
    // FLANN's L2 is squared; the vocabulary decides on true distance.
    nearest.first_distance = std::sqrt(nearest.first_distance);
    nearest.second_distance = std::sqrt(nearest.second_distance);
    return nearest;
  }

  int size() const override { return size_; }

 private:
  struct GrownTree {
    std::unique_ptr<Tree> index;
    std::vector<int> rows;  // row number of the tree's own point number
    std::mt19937_64 generator;
  };

  void AddToTree(const cv::Mat& rows, GrownTree& tree) const {
    std::vector<int> order(static_cast<std::size_t>(rows.rows));
    std::iota(order.begin(), order.end(), 0);
    // A shuffle of our own: std::shuffle may differ between standard libraries.
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[tree.generator() % i]);
    for (const int row : order) {
      float* point =
          const_cast<float*>(rows.ptr<float>(row));  // FLANN's matrices are not const; it only reads
      const flann::Matrix<float> one(point, 1, dimensions_);
      if (!tree.index) {
        tree.index = std::make_unique<Tree>(one, flann::KDTreeIndexParams(1));
        tree.index->buildIndex();  // of a single point: nothing to choose at random
      } else {
        tree.index->addPoints(one, 0.0f);  // 0: never rebuild
      }
      tree.rows.push_back(size_ + row);
    }
  }

  std::size_t dimensions_;
  int checks_per_tree_;
  int size_ = 0;
  std::vector<GrownTree> trees_;
  std::vector<cv::Mat> kept_;  // the trees point into these rows
};

}  // namespace

std::unique_ptr<DescriptorIndex> MakeKdForestIndex(int dimensions, int trees, int checks,
                                                   std::uint64_t seed) {
  return std::make_unique<KdForestIndex>(dimensions, trees, checks, seed);
}

}  // namespace tutti
