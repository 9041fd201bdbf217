#include "tutti/core/shared_vector.h"

#include <gtest/gtest.h>

#include <string>

namespace tutti {
namespace {

using Words = SharedVector<std::string, 4>;

Words Ten() {
  Words words;
  for (int i = 0; i < 10; ++i) words.Append(std::to_string(i));
  return words;
}

TEST(SharedVector, HoldsWhatWasAppended) {
  const Words words = Ten();
  ASSERT_EQ(words.size(), 10U);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_EQ(words[i], std::to_string(i));
}

TEST(SharedVector, CopiesShareUntilOneIsWrittenTo) {
  Words a = Ten();
  const Words b = a;
  EXPECT_EQ(&a[5], &b[5]);
  a.Mutable(5) = "changed";
  EXPECT_EQ(a[5], "changed");
  EXPECT_EQ(b[5], "5");
  EXPECT_NE(&a[4], &b[4]) << "the chunk around it is copied with it";
  EXPECT_EQ(&a[0], &b[0]) << "others stay shared";
}

TEST(SharedVector, CopiesGrowApart) {
  Words a = Ten();
  Words b = a;
  a.Append("a");
  b.Append("b");
  b.Append("bb");
  EXPECT_EQ(a.size(), 11U);
  EXPECT_EQ(a[10], "a");
  EXPECT_EQ(b.size(), 12U);
  EXPECT_EQ(b[10], "b");
}

TEST(SharedVector, ReferencesForWritingStayGoodWhileItGrows) {
  Words a = Ten();
  const Words b = a;
  std::string& ninth = a.Mutable(9);
  for (int i = 0; i < 100; ++i) a.Append("more");
  ninth = "still there";
  EXPECT_EQ(a[9], "still there");
  EXPECT_EQ(b[9], "9");
}

TEST(SharedVector, WritingToAnUnsharedChunkCopiesNothing) {
  Words a = Ten();
  const std::string* const before = &a[2];
  a.Mutable(2) = "x";
  EXPECT_EQ(before, &a[2]);
}

}  // namespace
}  // namespace tutti
