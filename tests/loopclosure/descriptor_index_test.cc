#include "tutti/loopclosure/descriptor_index.h"

#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_index.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

namespace tutti {
namespace {

cv::Mat RandomFloats(int rows, int columns, std::uint32_t seed) {
  std::mt19937 generator(seed);
  cv::Mat m(rows, columns, CV_32F);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) m.at<float>(i, j) = static_cast<float>(generator() % 10000u) / 10000.0f;
  }
  return m;
}

cv::Mat RandomBytes(int rows, std::uint32_t seed) {
  std::mt19937 generator(seed);
  cv::Mat m(rows, 32, CV_8U);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < 32; ++j) m.at<std::uint8_t>(i, j) = static_cast<std::uint8_t>(generator() % 256u);
  }
  return m;
}

std::vector<int> Ids(int begin, int end) {
  std::vector<int> ids(static_cast<std::size_t>(end - begin));
  std::iota(ids.begin(), ids.end(), begin);
  return ids;
}

// Share of queries (stored rows with noise) whose true nearest row the index finds.
template <typename Noise>
double Recall(DescriptorIndex& index, const cv::Mat& rows, const Noise& noise) {
  int found = 0;
  for (int i = 0; i < rows.rows; i += 10) {
    cv::Mat query = rows.row(i).clone();
    noise(query);
    found += index.Search(query)[0].first == i ? 1 : 0;
  }
  return found / (rows.rows / 10.0);
}

TEST(DescriptorIndex, KdForestFindsMostNearestNeighbours) {
  const cv::Mat rows = RandomFloats(5000, 64, 7);
  const std::unique_ptr<DescriptorIndex> index = MakeKdForestIndex(64, 4, 32, 1);
  for (int i = 0; i < 5000; i += 100) index->Add(Ids(i, i + 100), rows.rowRange(i, i + 100));
  std::mt19937 generator(3);
  EXPECT_GT(Recall(*index, rows,
                   [&](cv::Mat& q) {
                     for (int j = 0; j < 64; ++j)
                       q.at<float>(0, j) += static_cast<float>(generator() % 100u) / 1000.0f - 0.05f;
                   }),
            0.9);
}

TEST(DescriptorIndex, HammingTablesFindMostNearestNeighbours) {
  const cv::Mat rows = RandomBytes(12000, 7);
  const std::unique_ptr<DescriptorIndex> index = MakeHammingIndex(32, 8, 1);
  index->Add(Ids(0, rows.rows), rows);
  std::mt19937 generator(3);
  EXPECT_GT(Recall(*index, rows,
                   [&](cv::Mat& q) {
                     for (int flips = 0; flips < 35; ++flips) {
                       const unsigned bit = generator() % 256u;
                       q.data[bit / 8] = static_cast<std::uint8_t>(q.data[bit / 8] ^ (1u << (bit % 8)));
                     }
                   }),
            0.95);
}

// FLANN's own answer: a tree per order of insertion, `checks` leaves of each.
class FlannForest {
 public:
  FlannForest(const cv::Mat& rows, const std::vector<std::vector<int>>& orders, int checks)
      : rows_(rows.clone()), orders_(orders), checks_(checks) {
    for (const std::vector<int>& order : orders_) {
      for (const int row : order) {
        const flann::Matrix<float> point(rows_.ptr<float>(row), 1, static_cast<std::size_t>(rows_.cols));
        if (row == order.front()) {
          trees_.push_back(std::make_unique<Tree>(point, flann::KDTreeIndexParams(1)));
          trees_.back()->buildIndex();
        } else {
          trees_.back()->addPoints(point, 0.0f);
        }
      }
    }
  }
  TwoNearest Search(const cv::Mat& query) const {
    Nearest nearest;
    for (std::size_t t = 0; t < trees_.size(); ++t) {
      nearest.order = &orders_[t];
      trees_[t]->findNeighbors(nearest, query.ptr<float>(), flann::SearchParams(checks_));
    }
    return nearest.two;
  }

 private:
  using Tree = flann::KDTreeIndex<flann::L2<float>>;
  struct Nearest : flann::ResultSet<float> {
    bool full() const override { return two.second >= 0; }
    void addPoint(float distance, std::size_t index) override { two.Offer((*order)[index], distance); }
    float worstDist() const override { return two.second_distance; }
    const std::vector<int>* order = nullptr;
    TwoNearest two;
  };
  cv::Mat rows_;
  std::vector<std::vector<int>> orders_;
  int checks_;
  std::vector<std::unique_ptr<Tree>> trees_;
};

TEST(DescriptorIndex, KdForestAnswersAsFlannsTreesDo) {
  // One word at a time: then every tree has the same order of insertion.
  const cv::Mat rows = RandomFloats(3000, 32, 11);
  const std::unique_ptr<DescriptorIndex> index = MakeKdForestIndex(32, 2, 32, 1);
  for (int i = 0; i < rows.rows; ++i) index->Add({i}, rows.row(i));
  const std::vector<int> order = Ids(0, rows.rows);
  const FlannForest flann(rows, {order, order}, 16);
  const cv::Mat queries = RandomFloats(500, 32, 12);
  const std::vector<TwoNearest> found = index->Search(queries);
  for (int i = 0; i < queries.rows; ++i) {
    const TwoNearest expected = flann.Search(queries.row(i));
    EXPECT_EQ(found[static_cast<std::size_t>(i)].first, expected.first) << i;
    EXPECT_EQ(found[static_cast<std::size_t>(i)].second, expected.second) << i;
    EXPECT_NEAR(found[static_cast<std::size_t>(i)].first_distance, std::sqrt(expected.first_distance), 1e-5);
  }
}

TEST(DescriptorIndex, WhatIsFoundForOneDoesNotDependOnTheOthers) {
  const cv::Mat floats = RandomFloats(2000, 16, 1);
  const cv::Mat bytes = RandomBytes(2000, 1);
  const std::unique_ptr<DescriptorIndex> forest = MakeKdForestIndex(16, 4, 32, 1);
  const std::unique_ptr<DescriptorIndex> tries = MakeHammingIndex(32, 8, 1);
  forest->Add(Ids(0, 2000), floats);
  tries->Add(Ids(0, 2000), bytes);
  for (const auto& [index, queries] : {std::make_pair(forest.get(), RandomFloats(40, 16, 2)),
                                       std::make_pair(tries.get(), RandomBytes(40, 2))}) {
    const std::vector<TwoNearest> together = index->Search(queries);
    for (int i = 0; i < queries.rows; ++i) {
      const TwoNearest alone = index->Search(queries.row(i))[0];
      EXPECT_EQ(together[static_cast<std::size_t>(i)].first, alone.first);
      EXPECT_EQ(together[static_cast<std::size_t>(i)].second, alone.second);
    }
  }
}

// Words come and go; what is left must be found, and nothing else.
TEST(DescriptorIndex, RemovedWordsLeaveNothingBehind) {
  const cv::Mat floats = RandomFloats(3000, 16, 3);
  const cv::Mat bytes = RandomBytes(3000, 3);
  for (const bool binary : {false, true}) {
    const cv::Mat& rows = binary ? bytes : floats;
    const std::unique_ptr<DescriptorIndex> index =
        binary ? MakeHammingIndex(32, 8, 1) : MakeKdForestIndex(16, 4, 32, 1);
    for (int i = 0; i < rows.rows; ++i) {
      index->Add({i}, rows.row(i));
      if (i % 3 != 0) index->Remove(i / 2);
    }
    for (int i = 0; i < rows.rows; ++i) {
      const TwoNearest found = index->Search(rows.row(i))[0];
      if (index->Find(i) != nullptr) {
        EXPECT_EQ(found.first, i);
        EXPECT_EQ(found.first_distance, 0.0f);
      } else {
        EXPECT_NE(found.first, i);
        EXPECT_NE(found.second, i);
      }
    }
    for (int i = 0; i < rows.rows; ++i) index->Remove(i);
    EXPECT_EQ(index->size(), 0);
    EXPECT_EQ(index->Search(rows.row(0))[0].first, -1);
    index->Add(Ids(0, 2), rows.rowRange(0, 2));
    EXPECT_EQ(index->Search(rows.row(1))[0].first, 1);
  }
}

// Equal words, more than fit into a leaf, and in a chain of splits.
TEST(DescriptorIndex, EqualDescriptorsComeAndGo) {
  const cv::Mat floats = cv::Mat::ones(40, 8, CV_32F);
  const cv::Mat bytes = cv::Mat::ones(1200, 32, CV_8U);
  for (const cv::Mat& rows : {floats, bytes}) {
    const std::unique_ptr<DescriptorIndex> index =
        rows.type() == CV_8U ? MakeHammingIndex(32, 2, 1) : MakeKdForestIndex(8, 2, 8, 1);
    index->Add(Ids(0, rows.rows), rows);
    EXPECT_EQ(index->Search(rows.row(0))[0].second_distance, 0.0f);
    for (int i = 0; i < rows.rows - 1; ++i) index->Remove(i);
    EXPECT_EQ(index->Search(rows.row(0))[0].first, rows.rows - 1);
    EXPECT_EQ(index->Search(rows.row(0))[0].second, -1);
  }
}

}  // namespace
}  // namespace tutti
