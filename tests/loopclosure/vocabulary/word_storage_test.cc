// Words as bytes and back.
#include "loopclosure/vocabulary/word_storage.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "core/state_archive.h"
#include "loopclosure/store/packed_mat.h"
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
