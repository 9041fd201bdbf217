#include "loopclosure/vocabulary/descriptor_index.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "core/state_archive.h"
#include "loopclosure/store/packed_mat.h"
#include "tests/loopclosure/vocabulary/random_descriptors.h"

namespace tutti {
namespace {

using testing::RandomBytes;
using testing::RandomFloats;

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

// Equal distances go to the smaller id.
TEST(TwoNearest, AreTheSameInWhateverOrderCandidatesCome) {
  std::vector<std::pair<float, int>> candidates = {{1, 7}, {2, 3}, {2, 5}, {2, 9}, {4, 1}, {4, 8}};
  for (const float nearest : {1.0f, 2.0f, 4.0f}) {  // alone, one of four alike, one of three
    candidates[0].first = nearest;
    std::vector<std::pair<float, int>> order = candidates;
    std::sort(order.begin(), order.end());
    const std::vector<std::pair<float, int>> expected = order;
    do {
      TwoNearest found;
      for (const auto& [distance, word] : order) found.Offer(word, distance);
      for (const auto& [distance, word] : order) found.Offer(word, distance);  // none counts twice
      ASSERT_EQ(found.first, expected[0].second);
      ASSERT_EQ(found.second, expected[1].second);
      ASSERT_EQ(found.first_distance, expected[0].first);
      ASSERT_EQ(found.second_distance, expected[1].first);
    } while (std::next_permutation(order.begin(), order.end()));
  }
}

TEST(TwoNearest, OfOneCandidateHaveNoSecond) {
  TwoNearest found;
  found.Offer(4, 2.5f);
  EXPECT_EQ(found.first, 4);
  EXPECT_EQ(found.second, -1);
  EXPECT_EQ(found.second_distance, std::numeric_limits<float>::infinity());
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

TEST(DescriptorIndex, KdForestAnswersAsFlannsTreesDo) {
  // One word at a time: then every tree has the same order of insertion.
  const cv::Mat rows = RandomFloats(3000, 32, 11);
  const std::unique_ptr<DescriptorIndex> index = MakeKdForestIndex(32, 2, 32, 1);
  const std::unique_ptr<DescriptorIndex> flann = MakeFlannIndex(32, 2, 32, 1);
  for (int i = 0; i < rows.rows; ++i) {
    index->Add({i}, rows.row(i));
    flann->Add({i}, rows.row(i));
  }
  const cv::Mat queries = RandomFloats(500, 32, 12);
  const std::vector<TwoNearest> found = index->Search(queries);
  const std::vector<TwoNearest> expected_of = flann->Search(queries);
  for (int i = 0; i < queries.rows; ++i) {
    const TwoNearest& expected = expected_of[static_cast<std::size_t>(i)];
    EXPECT_EQ(found[static_cast<std::size_t>(i)].first, expected.first) << i;
    EXPECT_EQ(found[static_cast<std::size_t>(i)].second, expected.second) << i;
    EXPECT_NEAR(found[static_cast<std::size_t>(i)].first_distance, expected.first_distance, 1e-5);
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
  std::vector<std::pair<std::unique_ptr<DescriptorIndex>, cv::Mat>> all;
  all.emplace_back(MakeKdForestIndex(16, 4, 32, 1), floats);
  all.emplace_back(MakeFlannIndex(16, 4, 32, 1), floats);
  all.emplace_back(MakeHammingIndex(32, 8, 1), bytes);
  for (const auto& [index, rows] : all) {
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
  std::vector<std::pair<std::unique_ptr<DescriptorIndex>, cv::Mat>> all;
  all.emplace_back(MakeKdForestIndex(8, 2, 8, 1), floats);
  all.emplace_back(MakeFlannIndex(8, 2, 8, 1), floats);
  all.emplace_back(MakeHammingIndex(32, 2, 1), bytes);
  for (const auto& [index, rows] : all) {
    index->Add(Ids(0, rows.rows), rows);
    EXPECT_EQ(index->Search(rows.row(0))[0].second_distance, 0.0f);
    for (int i = 0; i < rows.rows - 1; ++i) index->Remove(i);
    EXPECT_EQ(index->Search(rows.row(0))[0].first, rows.rows - 1);
    EXPECT_EQ(index->Search(rows.row(0))[0].second, -1);
  }
}

// With more equal ones than fit into a leaf.
TEST(DescriptorIndex, SavedOnesAnswerAndForgetAsBefore) {
  cv::Mat floats = RandomFloats(3000, 16, 3), bytes = RandomBytes(3000, 3);
  floats.push_back(cv::Mat::ones(40, 16, CV_32F));
  bytes.push_back(cv::Mat::ones(40, 32, CV_8U));
  for (const cv::Mat& rows : {floats, bytes}) {
    const auto make = [&] {
      return rows.type() == CV_8U ? MakeHammingIndex(32, 8, 1) : MakeKdForestIndex(16, 4, 32, 1);
    };
    const std::unique_ptr<DescriptorIndex> index = make(), again = make();
    index->Add(Ids(0, rows.rows), rows);
    internal::SharedObjectsOut no_objects;
    internal::StateWriter out(&no_objects);
    index->State(out, {rows});
    const std::string bytes_of_index = out.Take();
    internal::SharedObjectsIn none;
    internal::StateReader in(bytes_of_index, "test", &none);
    again->State(in, {rows});
    in.ExpectEnd();
    const auto expect_the_same = [&] {
      const std::vector<TwoNearest> expected = index->Search(rows), found = again->Search(rows);
      for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].first, expected[i].first) << i;
        EXPECT_EQ(found[i].second, expected[i].second) << i;
        EXPECT_EQ(found[i].second_distance, expected[i].second_distance) << i;
      }
    };
    expect_the_same();
    for (int i = 0; i < rows.rows; i += i < 3000 ? 3 : 1) {
      index->Remove(i);
      again->Remove(i);
    }
    EXPECT_EQ(again->size(), index->size());
    expect_the_same();
  }
}

}  // namespace
}  // namespace tutti
