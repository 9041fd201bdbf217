#include "loopclosure/vocabulary/word_map.h"

#include <gtest/gtest.h>

#include <map>
#include <random>

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
