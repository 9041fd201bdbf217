// Words as bytes and back.
#include "loopclosure/vocabulary/word_bytes.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "loopclosure/store/packed_mat.h"
#include "tests/loopclosure/vocabulary/random_descriptors.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

constexpr std::size_t kRowBytes = 32;

std::string RowText(const std::uint8_t* row) { return {row, row + kRowBytes}; }

std::map<int, std::string> LoadedWords(const std::string& bytes, const std::vector<PackedMat>& known) {
  ByteReader in(bytes, "test");
  std::map<int, std::string> words;
  LoadWords(WordStorage(kRowBytes), CV_8U, known, in,
            [&](int word, const std::uint8_t* row) { words[word] = RowText(row); });
  EXPECT_TRUE(in.AtEnd());
  return words;
}

TEST(WordBytes, EverythingComesBack) {
  const cv::Mat first = testing::RandomBytes(5, 1), third = testing::RandomBytes(4, 3);
  const std::vector<PackedMat> known = {first, testing::RandomFloats(3, 32, 2), third};
  const cv::Mat others = testing::RandomBytes(2, 4);
  WordStorage storage(kRowBytes);
  storage.Add(3, third.ptr(3));
  storage.Add(4, others.ptr(0));
  storage.Add(40, first.ptr(0));
  storage.Add(700, third.ptr(0));
  storage.Add(90000, others.ptr(1));
  ByteWriter out;
  SaveWords(storage, CV_8U, known, out);
  const std::map<int, std::string> words = LoadedWords(out.bytes(), known);
  ASSERT_EQ(words.size(), 5u);
  storage.ForEach([&](int word, int row) { EXPECT_EQ(words.at(word), RowText(storage.At(row))) << word; });
}

// A file that names rows one after the other: the first `step` from -1, the next from there.
TEST(WordBytes, RowsThatAreNowhereAreRefused) {
  const std::vector<PackedMat> known = {testing::RandomBytes(3, 1)};
  const auto refused = [&](const std::vector<std::int64_t>& steps) {
    ByteWriter out;
    out.PutVarint(steps.size());
    for (const std::int64_t step : steps) {
      out.PutVarint(0);
      out.PutVarint(1);
      out.PutSignedVarint(step);
    }
    PackedMat().Put(out);
    try {
      EXPECT_EQ(LoadedWords(out.bytes(), known).size(), steps.size());
    } catch (const InputError&) {
      return true;
    }
    return false;
  };
  EXPECT_FALSE(refused({1}));
  EXPECT_FALSE(refused({3}));
  EXPECT_FALSE(refused({3, -2, 2}));
  EXPECT_TRUE(refused({0}));
  EXPECT_TRUE(refused({-1}));
  EXPECT_TRUE(refused({4}));
  EXPECT_TRUE(refused({3, 1}));
  EXPECT_TRUE(refused({2, -2}));
  EXPECT_TRUE(refused({2, std::numeric_limits<std::int64_t>::max()}));
  EXPECT_TRUE(refused({std::numeric_limits<std::int64_t>::min()}));
}

}  // namespace
}  // namespace tutti::internal
