#include "apps/run/timing.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

namespace tutti {
namespace {

using Json = nlohmann::ordered_json;

double Microseconds(Span::Clock::duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

std::string StageRow(const StageTiming& stage) {
  char cpu[16] = "-", text[160];
  if (stage.cpu_ms >= 0) std::snprintf(cpu, sizeof cpu, "%.0f", stage.cpu_ms);
  std::snprintf(text, sizeof text, "  %-13s %-14s %7zu %9.2f %9.2f %10.0f %9s %6.1f %%\n",
                ToString(stage.lane), stage.name.c_str(), stage.calls, stage.median_ms, stage.p99_ms,
                stage.total_ms, cpu, 100 * stage.share);
  return text;
}

}  // namespace

double Quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(values.size())));
  return values[std::min(values.size() - 1, rank > 0 ? rank - 1 : 0)];
}

std::vector<StageTiming> SummarizeStages(const std::vector<Span>& spans, double wall_s) {
  std::map<std::pair<Lane, std::string>, std::vector<double>> durations;
  std::map<std::pair<Lane, std::string>, StageTiming> rows;
  for (const Span& span : spans) {
    const auto key = std::make_pair(span.lane, span.name);
    StageTiming& row = rows[key];
    durations[key].push_back(span.Milliseconds());
    row.total_ms += span.Milliseconds();
    row.cpu_ms = span.cpu_ms < 0 || row.cpu_ms < 0 ? -1 : row.cpu_ms + span.cpu_ms;
  }
  std::vector<StageTiming> out;
  for (auto& [key, row] : rows) {
    row.lane = key.first;
    row.name = key.second;
    row.calls = durations[key].size();
    row.median_ms = Quantile(durations[key], 0.5);
    row.p99_ms = Quantile(durations[key], 0.99);
    row.share = wall_s > 0 ? row.total_ms / (1e3 * wall_s) : 0;
    out.push_back(row);
  }
  std::stable_sort(out.begin(), out.end(), [](const StageTiming& a, const StageTiming& b) {
    return a.lane != b.lane ? a.lane < b.lane : a.total_ms > b.total_ms;
  });
  return out;
}

std::string TimingTable(const std::vector<StageTiming>& stages, double wall_s, double cpu_s,
                        std::size_t frames) {
  char text[200];
  std::snprintf(text, sizeof text, "\n  %-13s %-14s %7s %9s %9s %10s %9s %8s\n", "", "stage", "calls",
                "median ms", "p99 ms", "total ms", "CPU ms", "share");
  std::string out = text;
  for (const StageTiming& stage : stages) out += StageRow(stage);
  std::snprintf(text, sizeof text,
                "  share: of the run's %.1f s; stages lie within each other (frame has them all)\n"
                "  processor time, all threads: %.1f s, %.1f ms per frame\n",
                wall_s, cpu_s, frames > 0 ? 1e3 * cpu_s / static_cast<double>(frames) : 0.0);
  return out + text;
}

std::string ChromeTrace(const std::vector<Span>& spans, Span::Clock::time_point begin) {
  Json events = Json::array();
  const auto metadata = [&](const char* what, int thread, const char* name) {
    events.push_back({{"name", what}, {"ph", "M"}, {"pid", 1}, {"tid", thread}, {"args", {{"name", name}}}});
  };
  metadata("process_name", 0, "tutti run");
  for (int lane = 0; lane < kLanes; ++lane)
    metadata("thread_name", lane + 1, ToString(static_cast<Lane>(lane)));
  for (const Span& span : spans) {
    Json event = {{"name", span.name},
                  {"cat", ToString(span.lane)},
                  {"ph", "X"},
                  {"ts", Microseconds(span.begin - begin)},
                  {"dur", Microseconds(span.end - span.begin)},
                  {"pid", 1},
                  {"tid", static_cast<int>(span.lane) + 1}};
    if (span.cpu_ms >= 0) event["args"] = {{"cpu_ms", span.cpu_ms}};
    events.push_back(std::move(event));
  }
  const Json trace = {{"displayTimeUnit", "ms"}, {"traceEvents", events}};
  return trace.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace tutti
