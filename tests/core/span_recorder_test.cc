#include "tutti/core/span_recorder.h"

#include <gtest/gtest.h>

#include <thread>

namespace tutti {
namespace {

TEST(SpanRecorder, KeepsNestedSpansInTheOrderOfTheirEnds) {
  SpanRecorder recorder;
  {
    const ScopedSpan outer(&recorder, Lane::kTracking, "frame");
    const ScopedSpan inner(&recorder, Lane::kMapping, "map");
  }
  const std::vector<Span> spans = recorder.Spans();
  ASSERT_EQ(spans.size(), 2u);
  EXPECT_EQ(spans[0].name, "map");
  EXPECT_EQ(spans[0].lane, Lane::kMapping);
  EXPECT_EQ(spans[1].name, "frame");
  EXPECT_LE(spans[1].begin, spans[0].begin);
  EXPECT_GE(spans[1].end, spans[0].end);
  EXPECT_GE(spans[1].cpu_ms, 0);
}

TEST(SpanRecorder, TakesSpansOfSeveralThreads) {
  SpanRecorder recorder;
  const auto work = [&] {
    for (int i = 0; i < 100; ++i) const ScopedSpan span(&recorder, Lane::kReading, "read");
  };
  std::thread a(work), b(work);
  a.join();
  b.join();
  EXPECT_EQ(recorder.Spans().size(), 200u);
}

TEST(SpanRecorder, NoRecorderIsFine) { const ScopedSpan span(nullptr, Lane::kTracking, "frame"); }

}  // namespace
}  // namespace tutti
