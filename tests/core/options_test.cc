#include "tutti/core/options.h"

#include <gtest/gtest.h>

#include <limits>

namespace tutti {
namespace {

enum class Shape { kRound, kSquare };
EnumWords<Shape> WordsOf(Shape /*of*/) { return {{"round", Shape::kRound}, {"square", Shape::kSquare}}; }

struct Inner {
  TUTTI_OPTION(double, share, 0.5, "share of the whole", Above(0), To(1));
  TUTTI_OPTIONS_END;
};

struct Outer {
  TUTTI_OPTION(int, count, 3, "how many", Basic(), From(1), To(9));
  TUTTI_OPTION(double, length, 2.5, "how long", Unit("m"), Below(10));
  TUTTI_OPTION(Shape, shape, Shape::kSquare, "which");
  TUTTI_OPTION(Inner, inner, {}, "of another kind");
  TUTTI_OPTIONS_END;
};

TEST(Options, AreFieldsOfAPlainAggregate) {
  static_assert(std::is_aggregate_v<Outer>);
  static_assert(sizeof(Inner) == sizeof(double));
  Outer options{4, 1.5, Shape::kRound, {0.25}};
  EXPECT_EQ(options.inner.share, 0.25);
  options = {};
  EXPECT_EQ(options.count, 3);
  EXPECT_EQ(options.shape, Shape::kSquare);
}

TEST(Options, AreVisitedInTheirOrderWithWhatIsSaidOfThem) {
  std::string names;
  Outer options;
  ForEachOption(options, [&](const OptionText& text, auto& field) {
    names += std::string(text.name) + (text.basic ? "! " : " ");
    if constexpr (std::is_same_v<decltype(field), double&>) {
      EXPECT_EQ(&field, &options.length);
      EXPECT_STREQ(text.sentence, "how long");
      EXPECT_STREQ(text.unit, "m");
    }
  });
  EXPECT_EQ(names, "count! length shape inner ");
}

TEST(Options, TheFirstThatIsOutOfItsRangeIsNamedWithTheRange) {
  Outer options;
  EXPECT_EQ(OutOfRange(options), "");
  options.count = 9;
  EXPECT_EQ(OutOfRange(options), "");
  options.inner.share = 0;
  EXPECT_EQ(OutOfRange(options, "my."), "my.inner.share must be above 0, at most 1, not 0");
  options.length = 10;
  EXPECT_EQ(OutOfRange(options), "length must be below 10 [m], not 10");
  options.count = 10;
  EXPECT_EQ(OutOfRange(options), "count must be 1 to 9, not 10");
}

TEST(Options, WhatIsNotFiniteIsOutOfEveryRange) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  OptionText text{"x", ""};
  EXPECT_EQ(text.Refusal("x", -1e30), "");
  EXPECT_EQ(text.Refusal("x", kNan), "x must be a finite number, not nan");
  EXPECT_NE(text.Refusal("x", std::numeric_limits<double>::infinity()), "");
  option_marks::From(0)(text);
  EXPECT_EQ(text.Refusal("x", kNan), "x must be at least 0, not nan");
  EXPECT_NE(text.Refusal("x", std::numeric_limits<double>::infinity()), "");
}

TEST(Options, WhatCantBeComputedWithIsOutOfEveryRange) {
  OptionText text{"x", ""};
  EXPECT_EQ(text.Refusal("x", 0), "");
  EXPECT_EQ(text.Refusal("x", 1e-30), "");
  for (const double value : {1e300, -1e300, 1e-300, -1e-300}) {
    EXPECT_NE(text.Refusal("x", value).find("must be 0 or of 1e-30 to 1e30"), std::string::npos) << value;
  }
}

TEST(Options, ValuesOfEnumerationsHaveWords) { EXPECT_STREQ(WordOf(Shape::kSquare), "square"); }

}  // namespace
}  // namespace tutti
