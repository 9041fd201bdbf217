// Words as bytes and back.
#include "loopclosure/vocabulary/word_storage.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "core/state_archive.h"
#include "loopclosure/store/packed_mat.h"
#include "loopclosure/vocabulary/word_map.h"
#include "tests/loopclosure/vocabulary/random_descriptors.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

constexpr std::size_t kRowBytes = 32;

std::string RowText(const std::uint8_t* row) { return {row, row + kRowBytes}; }

std::string SavedWords(WordStorage& storage, const std::vector<PackedMat>& known) {
  SharedObjectsOut none;
  StateWriter out(&none);
  storage.State(out, CV_8U, known);
  return out.Take();
}

void LoadWords(const std::string& bytes, const std::vector<PackedMat>& known, WordStorage* storage) {
  SharedObjectsIn none;
  StateReader in(bytes, "test", &none);
  storage->State(in, CV_8U, known);
  in.ExpectEnd();
}

TEST(WordStorage, EverythingComesBack) {
  const cv::Mat first = testing::RandomBytes(5, 1), third = testing::RandomBytes(4, 3);
  const std::vector<PackedMat> known = {first, testing::RandomFloats(3, 32, 2), third};
  const cv::Mat others = testing::RandomBytes(2, 4);
  WordStorage storage(kRowBytes);
  storage.Add(3, third.ptr(3));
  storage.Add(4, others.ptr(0));
  storage.Add(40, first.ptr(0));
  storage.Add(700, third.ptr(0));
  storage.Add(90000, others.ptr(1));
  storage.Add(90001, third.ptr(0));  // a second word with the descriptor
  WordStorage loaded(kRowBytes);
  LoadWords(SavedWords(storage, known), known, &loaded);
  ASSERT_EQ(loaded.size(), 6);
  storage.ForEach([&](int word, int row) {
    EXPECT_EQ(RowText(loaded.At(loaded.RowOf(word))), RowText(storage.At(row))) << word;
  });
}

// A file that names rows one after the other: the first `step` from -1, the next from there.
TEST(WordStorage, RowsThatAreNowhereAreRefused) {
  const std::vector<PackedMat> known = {testing::RandomBytes(3, 1)};
  const auto refused = [&](std::vector<int> steps) {
    std::vector<int> words(steps.size());
    std::iota(words.begin(), words.end(), 0);
    WordStorage storage(kRowBytes);
    try {
      LoadWords(StateBytes(GrowingNumbers{&words}, SmallNumbers{&steps}, PackedMat()), known, &storage);
    } catch (const InputError&) {
      return true;
    }
    return false;
  };
  EXPECT_FALSE(refused({1}));
  EXPECT_FALSE(refused({3}));
  EXPECT_FALSE(refused({3, -2, 2}));
  EXPECT_TRUE(refused({0})) << "none of the known ones, and no other follows";
  EXPECT_TRUE(refused({-1}));
  EXPECT_TRUE(refused({4}));
  EXPECT_TRUE(refused({3, 1}));
  EXPECT_TRUE(refused({2, -2}));
  EXPECT_TRUE(refused({2, std::numeric_limits<int>::max()}));
  EXPECT_TRUE(refused({std::numeric_limits<int>::min()}));
}

}  // namespace
}  // namespace tutti::internal

namespace tutti {
namespace {

TEST(WordMap, HoldsWhatAMapHolds) {
  WordMap<int> words;
  std::map<int, int> expected;
  std::mt19937 generator(1);
  for (int i = 0; i < 5000; ++i) {
    const int word = static_cast<int>(generator() % 1500u);
    if (generator() % 3u == 0) {
      words.Erase(word);
      expected.erase(word);
    } else {
      words[word] = i;
      expected[word] = i;
    }
  }
  std::map<int, int> found;
  words.ForEach([&](int word, int value) {
    EXPECT_TRUE(found.emplace_hint(found.end(), word, value)->second == value);
  });
  EXPECT_EQ(found, expected);
  EXPECT_EQ(words.size(), expected.size());
}

TEST(WordMap, AWordThatIsGoneComesBackEmpty) {
  WordMap<int> words;
  words[70000] = 5;
  EXPECT_EQ(*words.Find(70000), 5);
  EXPECT_EQ(words.Find(69999), nullptr);
  EXPECT_EQ(words.Find(1 << 28), nullptr);
  words.Erase(70000);
  words.Erase(3);
  EXPECT_EQ(words.Find(70000), nullptr);
  EXPECT_EQ(words[70000], 0);
  EXPECT_EQ(words.size(), 1u);
}

}  // namespace
}  // namespace tutti
