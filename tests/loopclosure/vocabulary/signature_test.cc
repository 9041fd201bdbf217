#include "loopclosure/vocabulary/signature.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

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
