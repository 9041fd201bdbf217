#include "loopclosure/vocabulary/vocabulary.h"

#include <gtest/gtest.h>

#include "core/state_archive.h"
#include "loopclosure/store/packed_mat.h"
#include "loopclosure/vocabulary/signature.h"
#include "tests/loopclosure/vocabulary/random_descriptors.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::RandomBytes;
using testing::RandomFloats;

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

TEST(Vocabulary, AWordLeavesWithItsLastLocationAndComesBackUnderItsId) {
  for (const cv::Mat& descriptors : {RandomFloats(60, 64, 1), RandomBytes(60, 1)}) {
    Vocabulary vocabulary(VocabularyOptions(), 1);
    const std::vector<int> words = vocabulary.Quantise(descriptors);
    const Signature all(words);
    const Signature half(std::vector<int>(words.begin(), words.begin() + 30));
    vocabulary.AddReferences(all);
    vocabulary.AddReferences(half);
    EXPECT_EQ(vocabulary.WordsOnlyIn(all).size(), 30u);
    EXPECT_TRUE(vocabulary.WordsOnlyIn(half).empty());
    std::vector<cv::Mat> kept;
    for (const int word : vocabulary.WordsOnlyIn(all)) kept.push_back(vocabulary.Descriptor(word));
    vocabulary.RemoveReferences(all);
    EXPECT_EQ(vocabulary.size(), 30);
    const std::vector<int> missing = vocabulary.Missing(all);
    ASSERT_EQ(missing.size(), 30u);
    EXPECT_TRUE(vocabulary.Descriptor(missing.front()).empty());
    cv::Mat rows;
    cv::vconcat(kept, rows);
    vocabulary.Restore(missing, rows);
    EXPECT_EQ(vocabulary.size(), 60);
    EXPECT_EQ(vocabulary.Quantise(descriptors), words);
    EXPECT_EQ(vocabulary.created(), 60);
  }
}

// Locations of `per_image` words come and, a while later, go; some words are seen again.
class Churn {
 public:
  explicit Churn(bool binary) : binary_(binary), vocabulary_(VocabularyOptions(), 3) {}
  void Step() {
    const cv::Mat rows = binary_ ? RandomBytes(kPerImage, image_) : RandomFloats(kPerImage, 32, image_);
    const Signature signature(vocabulary_.Quantise(rows));
    vocabulary_.AddReferences(signature);
    images_.emplace_back(rows, signature);
    if (++image_ > kKept) vocabulary_.RemoveReferences(images_[image_ - kKept - 1].second);
  }
  // Share of the words of the last kept image that are found again.
  double Recognised() {
    const auto& [rows, signature] = images_[image_ - kKept];
    int known = 0;
    for (int i = 0; i < rows.rows; ++i) {
      Vocabulary& v = vocabulary_;
      const int before = v.created();
      v.Quantise(rows.row(i));
      known += v.created() == before ? 1 : 0;
    }
    return known / static_cast<double>(rows.rows);
  }
  static constexpr int kPerImage = 100;
  static constexpr std::uint32_t kKept = 20;
  bool binary_;
  std::uint32_t image_ = 0;
  Vocabulary vocabulary_;
  std::vector<std::pair<cv::Mat, Signature>> images_;
};

TEST(Vocabulary, SearchStaysGoodWhileWordsComeAndGo) {
  for (const bool binary : {false, true}) {
    Churn churn(binary);
    for (int i = 0; i < 150; ++i) churn.Step();
    EXPECT_LE(churn.vocabulary_.size(), 101 * static_cast<int>(Churn::kKept));
    EXPECT_GT(churn.Recognised(), 0.95) << (binary ? "binary" : "float");
  }
}

std::string Saved(Vocabulary& vocabulary, const std::vector<internal::PackedMat>& known = {}) {
  return internal::StateBytes(Vocabulary::Beside{&vocabulary, known});
}

void Load(const std::string& bytes, Vocabulary* vocabulary,
          const std::vector<internal::PackedMat>& known = {}) {
  internal::ReadStateBytes(bytes, "saved", Vocabulary::Beside{vocabulary, known});
}

TEST(Vocabulary, ALoadedOneGoesOnAsTheSavedOneWould) {
  for (const bool binary : {false, true}) {
    Churn churn(binary);
    for (int i = 0; i < 77; ++i) churn.Step();
    Vocabulary loaded(VocabularyOptions(), 3);
    Load(Saved(churn.vocabulary_), &loaded);
    for (std::uint32_t seed = 60; seed < 130; ++seed) {
      const cv::Mat rows = binary ? RandomBytes(40, seed) : RandomFloats(40, 32, seed);
      const std::vector<int> words = churn.vocabulary_.Quantise(rows);
      EXPECT_EQ(words, loaded.Quantise(rows)) << seed;
      churn.vocabulary_.AddReferences(Signature(words));
      loaded.AddReferences(Signature(words));
      churn.vocabulary_.RemoveReferences(Signature(words));
      loaded.RemoveReferences(Signature(words));
    }
    EXPECT_TRUE(Saved(churn.vocabulary_) == Saved(loaded));
  }
}

TEST(Vocabulary, WordsThatAreKnownAnywayTakeFewBytes) {
  for (const bool binary : {false, true}) {
    Churn churn(binary);
    for (int i = 0; i < 20; ++i) churn.Step();
    std::vector<internal::PackedMat> known;
    for (const auto& [descriptors, signature] : churn.images_) known.emplace_back(descriptors.clone());
    const std::string alone = Saved(churn.vocabulary_), with = Saved(churn.vocabulary_, known);
    EXPECT_LT(with.size() + 20 * static_cast<std::size_t>(churn.vocabulary_.size()), alone.size());
    Vocabulary loaded(VocabularyOptions(), 3), other(VocabularyOptions(), 3);
    Load(with, &loaded, known);
    EXPECT_TRUE(Saved(loaded) == alone);
    known.pop_back();
    EXPECT_THROW(Load(with, &other, known), InputError);
  }
}

TEST(Vocabulary, DamagedBytesAreRefused) {
  Churn churn(false);
  for (int i = 0; i < 3; ++i) churn.Step();
  const std::string bytes = Saved(churn.vocabulary_);
  for (std::size_t length = 0; length < bytes.size(); length += 1 + bytes.size() / 50) {
    Vocabulary loaded(VocabularyOptions(), 3);
    EXPECT_THROW(Load(bytes.substr(0, length), &loaded), InputError) << length;
  }
}

TEST(Signature, CountsEachWordInAscendingOrder) {
  const Signature s({7, 3, 7, 1});
  ASSERT_EQ(s.entries().size(), 3u);
  EXPECT_EQ(s.entries()[0].word, 1);
  EXPECT_EQ(s.entries()[2].word, 7);
  EXPECT_EQ(s.entries()[2].count, 2);
  EXPECT_EQ(s.size(), 4);
}

TEST(Signature, SimilarityIsSharedMultiplicityOverTheLargerSize) {
  const Signature a({1, 1, 2, 3});
  const Signature b({1, 1, 1, 2, 9});
  EXPECT_DOUBLE_EQ(Signature::Similarity(a, b), 3.0 / 5.0);
  EXPECT_DOUBLE_EQ(Signature::Similarity(b, a), 3.0 / 5.0);
  EXPECT_DOUBLE_EQ(Signature::Similarity(a, a), 1.0);
}

TEST(Signature, AnEmptySignatureIsLikeNothing) {
  EXPECT_EQ(Signature::Similarity(Signature(), Signature({1})), 0.0);
  EXPECT_EQ(Signature::Similarity(Signature(), Signature()), 0.0);
}

}  // namespace
}  // namespace tutti
