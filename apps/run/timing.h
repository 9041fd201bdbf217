// Where the time of a run went: a table of stages, and a trace for Chrome or Perfetto.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tutti/core/span_recorder.h"

namespace tutti {

/// All spans of one name.
struct StageTiming {
  Lane lane = Lane::kTracking;
  std::string name;
  std::size_t calls = 0;
  double median_ms = 0;  ///< wall time of a call
  double p99_ms = 0;
  double total_ms = 0;  ///< wall time, summed
  double cpu_ms =
      0;  ///< processor time of the threads that ran it, summed; helpers' not included; -1: unknown
  double share = 0;  ///< total_ms over the wall time of the run
};

/// One row for each lane and name, lanes in their order, the longest total first. Stages may lie within each
/// other, so shares need not add up to 1. `wall_s` > 0.
std::vector<StageTiming> SummarizeStages(const std::vector<Span>& spans, double wall_s);

/// For the terminal.
std::string TimingTable(const std::vector<StageTiming>& stages, double wall_s, double cpu_s,
                        std::size_t frames);

/// Trace events in JSON, as chrome://tracing and ui.perfetto.dev read them: complete events [us] after
/// `begin`, one named thread for each lane.
std::string ChromeTrace(const std::vector<Span>& spans, Span::Clock::time_point begin);

/// Value below which a share q of the values lies (nearest rank); 0 for none.
double Quantile(std::vector<double> values, double q);

}  // namespace tutti
