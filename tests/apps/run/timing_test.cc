#include "apps/run/timing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace tutti {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

const Span::Clock::time_point kBegin = Span::Clock::time_point() + std::chrono::seconds(100);

Span Make(Lane lane, const char* name, int from_ms, int length_ms, double cpu_ms) {
  return {lane, name, kBegin + milliseconds(from_ms), kBegin + milliseconds(from_ms + length_ms), cpu_ms};
}

std::vector<Span> Example() {
  std::vector<Span> spans;
  spans.reserve(101);
  for (int i = 0; i < 99; ++i) spans.push_back(Make(Lane::kTracking, "frame", 100 * i, 10, 5));
  spans.push_back(Make(Lane::kTracking, "frame", 9900, 90, 50));
  spans.push_back(Make(Lane::kLoopClosure, "verify", 20, 40, -1));
  spans.push_back(Make(Lane::kReading, "read", 0, 4, 4));
  return spans;
}

TEST(Timing, SummarisesEachStageLaneByLane) {
  const std::vector<StageTiming> rows = SummarizeStages(Example(), 10.0);
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0].name, "read");
  EXPECT_EQ(rows[1].name, "frame");
  EXPECT_EQ(rows[1].calls, 100u);
  EXPECT_DOUBLE_EQ(rows[1].median_ms, 10);
  EXPECT_DOUBLE_EQ(rows[1].p99_ms, 10);  // one of a hundred lies above
  EXPECT_DOUBLE_EQ(rows[1].total_ms, 1080);
  EXPECT_DOUBLE_EQ(rows[1].cpu_ms, 545);
  EXPECT_DOUBLE_EQ(rows[1].share, 0.108);
  EXPECT_EQ(rows[2].name, "verify");
  EXPECT_LT(rows[2].cpu_ms, 0);  // not known
}

TEST(Timing, TableNamesStagesAndProcessorTimePerFrame) {
  const std::string table = TimingTable(SummarizeStages(Example(), 10.0), 10.0, 7.0, 100);
  EXPECT_THAT(table, HasSubstr("loop closure  verify"));
  EXPECT_THAT(table, HasSubstr("10.8 %"));
  EXPECT_THAT(table, HasSubstr("70.0 ms per frame"));
}

TEST(Timing, TraceHasNamedThreadsAndCompleteEventsInMicroseconds) {
  const auto trace = nlohmann::json::parse(ChromeTrace(Example(), kBegin));
  std::vector<std::string> threads;
  const nlohmann::json* verify = nullptr;
  for (const auto& event : trace["traceEvents"]) {
    if (event["ph"] == "M" && event["name"] == "thread_name") threads.push_back(event["args"]["name"]);
    if (event["name"] == "verify") verify = &event;
  }
  EXPECT_THAT(threads,
              ::testing::ElementsAre("reading", "tracking", "mapping", "loop closure", "optimisation"));
  ASSERT_NE(verify, nullptr);
  EXPECT_EQ((*verify)["ph"], "X");
  EXPECT_DOUBLE_EQ((*verify)["ts"].get<double>(), 20000);
  EXPECT_DOUBLE_EQ((*verify)["dur"].get<double>(), 40000);
}

TEST(Timing, QuantileIsTheNearestRank) {
  EXPECT_EQ(Quantile({}, 0.5), 0);
  EXPECT_EQ(Quantile({3, 1, 2}, 0.5), 2);
  EXPECT_EQ(Quantile({3, 1, 2}, 0.99), 3);
}

}  // namespace
}  // namespace tutti
