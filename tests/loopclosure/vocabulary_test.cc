#include "tutti/loopclosure/vocabulary.h"

#include <gtest/gtest.h>

#include <random>

#include "tutti/core/error.h"

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

TEST(Vocabulary, UnlikeDescriptorsAreNewWordsAndTheSameOnesAreRecognised) {
  for (const cv::Mat& descriptors : {RandomFloats(200, 64, 1), RandomBytes(200, 1)}) {
    Vocabulary vocabulary(VocabularyOptions(), 1);
    const std::vector<int> first = vocabulary.Quantise(descriptors);
    EXPECT_EQ(vocabulary.size(), 200);
    const std::vector<int> second = vocabulary.Quantise(descriptors);
    EXPECT_EQ(vocabulary.size(), 200);
    EXPECT_EQ(first, second);
  }
}

TEST(Vocabulary, WordsOfTheSameImageAreFoundExactly) {
  cv::Mat twice;
  const cv::Mat once = RandomFloats(50, 64, 3);
  cv::vconcat(once, once, twice);
  Vocabulary alone(VocabularyOptions(), 1);
  alone.Quantise(once);
  Vocabulary vocabulary(VocabularyOptions(), 1);
  const std::vector<int> words = vocabulary.Quantise(twice);
  EXPECT_EQ(vocabulary.size(), alone.size());  // the second half made no word
  EXPECT_GE(vocabulary.size(), 45);
  for (std::size_t i = 0; i < 50; ++i) EXPECT_EQ(words[i], words[i + 50]);
}

TEST(Vocabulary, TheRatioIsOfTrueDistanceNotOfSquared) {
  // Words at 0 and 10 on a line (and nothing else); the query at 4.2 has d1 / d2 = 4.2 / 5.8 = 0.72, squared
  // 0.52; at 4.6: 0.85, squared 0.73.
  const auto at = [](float x) {
    cv::Mat m = cv::Mat::zeros(1, 8, CV_32F);
    m.at<float>(0, 0) = x;
    return m;
  };
  Vocabulary vocabulary(VocabularyOptions(), 1);
  vocabulary.Quantise(at(0));
  vocabulary.Quantise(at(10));
  ASSERT_EQ(vocabulary.size(), 2);
  EXPECT_EQ(vocabulary.Quantise(at(4.2f))[0], 0);
  EXPECT_EQ(vocabulary.Quantise(at(4.6f))[0], 2);
}

TEST(Vocabulary, FewerThanTwoNeighboursMakeANewWord) {
  Vocabulary vocabulary(VocabularyOptions(), 1);
  const cv::Mat one = RandomFloats(1, 64, 5);
  EXPECT_EQ(vocabulary.Quantise(one)[0], 0);
  EXPECT_EQ(vocabulary.Quantise(one)[0], 1);  // a single neighbour says nothing about the ratio
  EXPECT_EQ(vocabulary.Quantise(cv::Mat()).size(), 0u);
}

TEST(Vocabulary, TheSameForAnyNumberOfThreadsAndBesideAnother) {
  Vocabulary one(VocabularyOptions(), 1);
  Vocabulary two(VocabularyOptions(), 1);
  Vocabulary other(VocabularyOptions(), 99);
  for (std::uint32_t image = 0; image < 12; ++image) {
    const cv::Mat descriptors = RandomFloats(150, 16, image / 2);
    other.Quantise(RandomFloats(80, 16, 100 + image));
    EXPECT_EQ(one.Quantise(descriptors, 1), two.Quantise(descriptors, 2));
  }
  EXPECT_EQ(one.size(), two.size());
}

TEST(Vocabulary, AnotherTypeOrWidthIsRefused) {
  Vocabulary vocabulary(VocabularyOptions(), 1);
  vocabulary.Quantise(RandomFloats(5, 64, 1));
  EXPECT_THROW(vocabulary.Quantise(RandomFloats(5, 128, 1)), InputError);
  EXPECT_THROW(vocabulary.Quantise(RandomBytes(5, 1)), InputError);
  EXPECT_THROW(Vocabulary(VocabularyOptions(), 1).Quantise(cv::Mat::zeros(3, 8, CV_64F)), InputError);
}

// Share of queries (stored rows with noise) whose true nearest row the index finds.
template <typename Noise>
double Recall(DescriptorIndex& index, const cv::Mat& rows, const Noise& noise) {
  int found = 0;
  for (int i = 0; i < rows.rows; i += 10) {
    cv::Mat query = rows.row(i).clone();
    noise(query);
    found += index.Search(query.ptr()).first == i ? 1 : 0;
  }
  return found / (rows.rows / 10.0);
}

TEST(DescriptorIndex, KdForestFindsMostNearestNeighbours) {
  const cv::Mat rows = RandomFloats(5000, 64, 7);
  const std::unique_ptr<DescriptorIndex> index = MakeKdForestIndex(64, 4, 32, 1);
  for (int i = 0; i < 5000; i += 100) index->Add(rows.rowRange(i, i + 100).clone());
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
  index->Add(rows);
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

}  // namespace
}  // namespace tutti
