// Runs of several variants, put into one table: `tutti compare` and `tutti collect`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/tutti/text_table.h"
#include "tutti/core/significance.h"

namespace tutti::cli {

/// What a run was of. Runs of one variant differ in it; two variants are compared where it is the same.
struct Sample {
  std::string dataset;
  int start = 0;           ///< first frame
  double noise = 0;        ///< standard deviation, grey levels
  int noise_draw = 0;      ///< which noise
  std::uint64_t seed = 1;  ///< of the loop detector
};
bool operator==(const Sample& a, const Sample& b);
/// "first frame 2, noise draw 2, seed 1".
std::string Describe(const Sample& sample);

/// The figures of one run, from its summary.json. NaN: there is none (no ground truth, path too short).
struct RunFigures {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::string dataset;  ///< table that the run belongs to: its data set, unless several make one table
  std::string variant;
  Sample sample;
  std::filesystem::path folder;  ///< of the run; empty: unknown
  std::string failure;           ///< why the run left no figures; then only the fields above are set
  double proposed = kNone, accepted = kNone, false_loops = kNone;
  double ate_m = kNone, rpe_m = kNone;                         ///< rmse after loop closing
  double t_rel_percent = kNone, r_rel_deg_per_m = kNone;       ///< KITTI
  double wall_s = kNone, frame_ms = kNone, memory_mb = kNone;  ///< frame_ms: median
  double odometry_s = kNone, loops_s = kNone;                  ///< summed stages, of all threads
  std::map<std::string, double> stages_s;                      ///< summed over the run, waiting as well
};

/// Runs that differ in their sample alone.
struct Variant {
  std::string name;
  std::vector<const RunFigures*> runs;
};

/// What a run wrote. `variant` of a run of `tutti run`: "odometry" without loops, "ensemble" for the rule
/// joint, "standardised-mean" for the mean of standardised evidence, else the rule. Throws InputError that
/// names the file if it is no summary.json.
RunFigures ReadRunFigures(const std::filesystem::path& summary);

/// Mean with the half-width of its 95 % confidence interval (Student's t; NaN for one value), and the
/// largest. Values that are not finite are left out; no value: NaN.
struct MeanInterval {
  std::size_t count = 0;
  double mean = RunFigures::kNone, half_width = RunFigures::kNone, largest = RunFigures::kNone;
};
MeanInterval MeanWithInterval(const std::vector<double>& values);
/// "mean +- half-width", the mean alone where there is no interval, "-" where there is no value.
std::string IntervalCell(const MeanInterval& value, int decimals);

/// The table of one data set, and what it says below.
struct ComparisonTable {
  std::string dataset;
  TextTable table;
  TextTable stages;  ///< StageTable; no rows: the runs say nothing of their stages
  std::vector<std::string> notes;
};

/// How the figures are printed.
struct TableChoice {
  std::vector<std::string> columns;  ///< of ComparisonColumns(), in this order; empty: all
  std::optional<int> decimals;       ///< of errors; nothing: those that fit each column
  bool bold_best = false;            ///< the best mean of each column of errors, times and memory
};
/// Of the runs in groups: by data set, then by variant, both in the order of their first appearance.
std::vector<ComparisonTable> ComparisonTables(const std::vector<RunFigures>& runs,
                                              const TableChoice& choice = {});

/// One table per data set and one of the time per stage, with the paired t-test of each variant's ATE against
/// the ensemble's over common samples (from kLeastPairs on), and below it what varies between the runs, which
/// variants the ensemble beats, and which it does not. CSV: the first table alone, for all data sets.
std::string DescribeComparison(const std::vector<RunFigures>& runs, TableFormat format,
                               const TableChoice& choice = {});
nlohmann::ordered_json ComparisonJson(const std::vector<RunFigures>& runs);
/// The page of a comparison (report.html), or removes an older one if pages are left out. Runs without a
/// report.json are in the table alone.
void WriteComparisonReport(const std::filesystem::path& file, const std::string& title,
                           const std::vector<RunFigures>& runs);

// The columns of a table of runs, and their time per stage: timing.stage_ms of their summary.json
// (docs/outputs.md).

constexpr const char* kEnsemble = "ensemble";

MeanInterval Over(const Variant& variant, double RunFigures::*field);
/// ATE of the variant minus that of the ensemble, over the samples that both have.
PairedTTestResult AgainstEnsemble(const Variant& variant, const std::vector<Variant>& all);

/// Words for columns, in the order of the whole table. The variant's name is always the first column.
std::vector<std::string> ComparisonColumns();
/// A row for each variant.
TextTable FiguresTable(const std::vector<Variant>& variants, const TableChoice& choice);

/// Seconds by stage; empty if the summary has none.
std::map<std::string, double> StageSeconds(const nlohmann::ordered_json& summary);
/// Sum of the stages whose name begins so, without those that only wait for others (read_wait, loop_wait,
/// loop_inline); NaN for no stages at all.
double WorkSeconds(const std::map<std::string, double>& stages_s, const std::string& prefix);
/// Every stage of these runs, in the order in which a frame goes through them; waiting comes last.
std::vector<std::string> StageOrder(const std::vector<Variant>& variants);
/// Mean over the runs; one that has stages but not this one spent 0 s on it. No run has it: no value.
MeanInterval StageOver(const Variant& variant, const std::string& stage);
/// A row for each stage, a column for each variant [s].
TextTable StageTable(const std::vector<Variant>& variants);

}  // namespace tutti::cli
