#include "apps/run/prefetcher.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace tutti {
namespace {

/// Ten frames; number 3 is bad, number 5 makes the reader throw.
class FakeDataset : public Dataset {
 public:
  std::size_t Size() const override { return 10; }
  double Stamp(std::size_t i) const override { return static_cast<double>(i); }
  ReadResult Read(std::size_t i) const override {
    ReadResult result;
    if (i == 5) throw std::runtime_error("frame 5 exploded");
    if (i == 3) {
      result.error = "frame 3 is damaged";
    } else {
      result.frame.emplace();
      result.frame->index = static_cast<std::int64_t>(i);
    }
    return result;
  }
  const CameraRig& Rig() const override { return rig_; }
  std::optional<std::filesystem::path> GroundTruthFile() const override { return std::nullopt; }
  Trajectory ReadGroundTruth(const std::filesystem::path&, std::vector<std::string>*) const override {
    return {};
  }
  const std::vector<std::string>& Warnings() const override { return warnings_; }

 private:
  CameraRig rig_;
  std::vector<std::string> warnings_;
};

PrefetchOptions Options(std::size_t begin, std::size_t end, std::size_t ahead) {
  PrefetchOptions options;
  options.begin = begin;
  options.end = end;
  options.ahead = ahead;
  return options;
}

class PrefetcherAhead : public ::testing::TestWithParam<std::size_t> {};

TEST_P(PrefetcherAhead, DeliversAllFramesInOrderAndErrorsInTheirPlace) {
  const FakeDataset dataset;
  Prefetcher frames(dataset, Options(1, dataset.Size(), GetParam()));
  for (std::size_t i = 1; i < dataset.Size(); ++i) {
    const auto fetched = frames.Next();
    ASSERT_TRUE(fetched.has_value());
    EXPECT_EQ(fetched->position, i);
    const ReadResult* read = &fetched->read;
    if (i == 3) {
      EXPECT_EQ(read->error, "frame 3 is damaged");
    } else if (i == 5) {
      EXPECT_EQ(read->error, "frame 5 exploded");
    } else {
      ASSERT_TRUE(read->frame.has_value());
      EXPECT_EQ(read->frame->index, static_cast<std::int64_t>(i));
    }
  }
  EXPECT_FALSE(frames.Next().has_value());
}

TEST_P(PrefetcherAhead, SkipsForwardsAndNeverBack) {
  const FakeDataset dataset;
  Prefetcher frames(dataset, Options(0, dataset.Size(), GetParam()));
  EXPECT_EQ(frames.Next()->position, 0u);
  frames.SkipTo(4);
  EXPECT_EQ(frames.Next()->position, 4u);
  frames.SkipTo(2);
  EXPECT_EQ(frames.Next()->position, 5u);
  frames.SkipTo(100);
  EXPECT_FALSE(frames.Next().has_value());
}

TEST_P(PrefetcherAhead, EndsWhereAGrowingDataSetEnds) {
  const FakeDataset dataset;
  Prefetcher frames(dataset, Options(8, static_cast<std::size_t>(-1), GetParam()));
  EXPECT_TRUE(frames.Next().has_value());
  EXPECT_TRUE(frames.Next().has_value());
  EXPECT_FALSE(frames.Next().has_value());
}

TEST(Prefetcher, NewestKeepsTheLastFrameWhenNobodyTakesThem) {
  const FakeDataset dataset;
  PrefetchOptions options = Options(0, dataset.Size(), 1);
  options.newest = true;
  Prefetcher frames(dataset, options);
  std::size_t last = 0, taken = 0;
  while (const auto fetched = frames.Next()) {
    EXPECT_TRUE(taken == 0 || fetched->position > last);
    last = fetched->position;
    ++taken;
  }
  EXPECT_EQ(last, dataset.Size() - 1);
}

TEST_P(PrefetcherAhead, StopsInTheMiddleWithoutHanging) {
  const FakeDataset dataset;
  Prefetcher frames(dataset, Options(0, dataset.Size(), GetParam()));
  EXPECT_TRUE(frames.Next().has_value());
}

INSTANTIATE_TEST_SUITE_P(Ahead, PrefetcherAhead, ::testing::Values(0, 1, 4, 100));

}  // namespace
}  // namespace tutti
