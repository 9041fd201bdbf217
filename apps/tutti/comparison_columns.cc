// The columns of a table of runs, and their time per stage.
#include "apps/tutti/comparison.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

namespace tutti::cli {
namespace {

std::size_t Failures(const Variant& variant) {
  return static_cast<std::size_t>(std::count_if(variant.runs.begin(), variant.runs.end(),
                                                [](const RunFigures* run) { return !run->failure.empty(); }));
}

enum class Kind { kRuns, kMean, kWorst, kP };

struct Column {
  const char* word;
  const char* header;
  Kind kind;
  double RunFigures::*field;
  int decimals;
  bool is_error;  ///< --precision holds
  bool has_best;  ///< the least is the best
  double scale;   ///< from the figure to the column's unit
};

constexpr Column kColumns[] = {
    {"runs", "runs", Kind::kRuns, nullptr, 0, false, false, 1},
    {"proposed", "proposed", Kind::kMean, &RunFigures::proposed, 1, false, false, 1},
    {"accepted", "accepted", Kind::kMean, &RunFigures::accepted, 1, false, false, 1},
    {"false", "false", Kind::kMean, &RunFigures::false_loops, 1, false, true, 1},
    {"ate", "ATE [m]", Kind::kMean, &RunFigures::ate_m, 4, true, true, 1},
    {"worst-ate", "worst ATE [m]", Kind::kWorst, &RunFigures::ate_m, 4, true, true, 1},
    {"p", "p", Kind::kP, nullptr, 4, false, false, 1},
    {"rpe", "RPE [m]", Kind::kMean, &RunFigures::rpe_m, 4, true, true, 1},
    {"t_rel", "t_rel [%]", Kind::kMean, &RunFigures::t_rel_percent, 3, true, true, 1},
    {"r_rel", "r_rel [deg/100 m]", Kind::kMean, &RunFigures::r_rel_deg_per_m, 3, true, true, 100},
    {"time", "time [s]", Kind::kMean, &RunFigures::wall_s, 1, false, true, 1},
    {"odometry", "odometry [s]", Kind::kMean, &RunFigures::odometry_s, 1, false, true, 1},
    {"loops", "loops [s]", Kind::kMean, &RunFigures::loops_s, 1, false, true, 1},
    {"frame", "frame [ms]", Kind::kMean, &RunFigures::frame_ms, 1, false, true, 1},
    {"memory", "memory [MB]", Kind::kMean, &RunFigures::memory_mb, 0, false, true, 1},
};

std::vector<const Column*> Chosen(const TableChoice& choice) {
  std::vector<const Column*> out;
  for (const Column& column : kColumns) {
    if (choice.columns.empty()) out.push_back(&column);
  }
  for (const std::string& word : choice.columns) {
    for (const Column& column : kColumns) {
      if (word == column.word) out.push_back(&column);
    }
  }
  return out;
}

/// What stands in the column: a mean with its interval, or the largest alone.
MeanInterval FigureOf(const Column& column, const Variant& variant) {
  MeanInterval figure = Over(variant, column.field);
  if (column.kind == Kind::kWorst) return {figure.count == 0 ? 0u : 1u, figure.largest};
  figure.mean *= column.scale;
  figure.half_width *= column.scale;
  return figure;
}

int DecimalsOf(const Column& column, const TableChoice& choice) {
  return column.is_error ? choice.decimals.value_or(column.decimals) : column.decimals;
}

std::string CellOf(const Column& column, const Variant& variant, const std::vector<Variant>& all,
                   const TableChoice& choice) {
  if (column.kind == Kind::kRuns) {
    const std::size_t failed = Failures(variant);
    return std::to_string(variant.runs.size() - failed) +
           (failed > 0 ? " (" + std::to_string(failed) + " failed)" : "");
  }
  if (column.kind == Kind::kP) {
    const PairedTTestResult test = AgainstEnsemble(variant, all);
    return variant.name == kEnsemble || test.pairs < kLeastPairs ? "-" : Fixed(test.p, column.decimals);
  }
  return IntervalCell(FigureOf(column, variant), DecimalsOf(column, choice));
}

/// Rows whose mean is the least, as it is printed. A column in which all rows are the same has no best.
std::vector<std::size_t> BestRows(const Column& column, const std::vector<Variant>& variants, int decimals) {
  std::vector<std::string> printed;
  double least = std::numeric_limits<double>::infinity();
  std::string best;
  for (const Variant& variant : variants) {
    const MeanInterval figure = FigureOf(column, variant);
    printed.push_back(figure.count == 0 ? "-" : Fixed(figure.mean, decimals));
    if (figure.count == 0 || !(figure.mean < least)) continue;
    least = figure.mean;
    best = printed.back();
  }
  std::vector<std::size_t> rows;
  for (std::size_t k = 0; k < printed.size(); ++k) {
    if (printed[k] == best) rows.push_back(k);
  }
  return rows.size() == printed.size() ? std::vector<std::size_t>() : rows;
}

constexpr std::array kOrder = {"read",         "odometry_extract",  "odometry_initialize", "odometry_track",
                               "odometry_map", "odometry_local_ba", "odometry_relocalize", "relocalize",
                               "loop_extract", "loop_quantise",     "loop_likelihood",     "loop_filter",
                               "loop_verify",  "loop_memory",       "loop_measure",        "loop_optimize",
                               "loop_solve",   "loop_fuse",         "global_adjustment"};
// What a thread spends in these, others work in: it is no work of its own.
constexpr std::array kWaiting = {"read_wait", "loop_wait", "loop_inline"};

template <typename Names>
bool Has(const Names& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

MeanInterval Over(const Variant& variant, double RunFigures::*field) {
  std::vector<double> values;
  for (const RunFigures* run : variant.runs) values.push_back(run->*field);
  return MeanWithInterval(values);
}

PairedTTestResult AgainstEnsemble(const Variant& variant, const std::vector<Variant>& all) {
  std::vector<double> a, b;
  for (const Variant& other : all) {
    if (other.name != kEnsemble) continue;
    for (const RunFigures* run : variant.runs) {
      for (const RunFigures* ensemble : other.runs) {
        if (!(run->sample == ensemble->sample) || !std::isfinite(run->ate_m) ||
            !std::isfinite(ensemble->ate_m))
          continue;
        a.push_back(run->ate_m);
        b.push_back(ensemble->ate_m);
      }
    }
  }
  return PairedTTest(a, b);
}

std::vector<std::string> ComparisonColumns() {
  std::vector<std::string> words;
  for (const Column& column : kColumns) words.emplace_back(column.word);
  return words;
}

TextTable FiguresTable(const std::vector<Variant>& variants, const TableChoice& choice) {
  const std::vector<const Column*> columns = Chosen(choice);
  TextTable table;
  table.header = {"variant"};
  for (const Column* column : columns) table.header.emplace_back(column->header);
  for (const Variant& variant : variants) {
    table.rows.push_back({variant.name});
    for (const Column* column : columns)
      table.rows.back().push_back(CellOf(*column, variant, variants, choice));
  }
  for (std::size_t k = 0; choice.bold_best && k < columns.size(); ++k) {
    if (!columns[k]->has_best) continue;
    for (const std::size_t row : BestRows(*columns[k], variants, DecimalsOf(*columns[k], choice)))
      table.bold.emplace_back(row, k + 1);
  }
  return table;
}

std::map<std::string, double> StageSeconds(const nlohmann::ordered_json& summary) {
  const nlohmann::ordered_json::json_pointer pointer("/timing/stage_ms");
  std::map<std::string, double> seconds;
  if (!summary.contains(pointer) || !summary.at(pointer).is_object()) return seconds;
  for (const auto& [name, ms] : summary.at(pointer).items()) {
    if (ms.is_number()) seconds[name] = ms.get<double>() / 1e3;
  }
  return seconds;
}

double WorkSeconds(const std::map<std::string, double>& stages_s, const std::string& prefix) {
  if (stages_s.empty()) return RunFigures::kNone;
  double sum = 0;
  for (const auto& [name, seconds] : stages_s) {
    if (name.rfind(prefix, 0) == 0 && !Has(kWaiting, name)) sum += seconds;
  }
  return sum;
}

std::vector<std::string> StageOrder(const std::vector<Variant>& variants) {
  std::set<std::string> rest;
  for (const Variant& variant : variants) {
    for (const RunFigures* run : variant.runs) {
      for (const auto& stage : run->stages_s) rest.insert(stage.first);
    }
  }
  std::vector<std::string> order;
  for (const char* name : kOrder) {
    if (rest.erase(name) > 0) order.emplace_back(name);
  }
  for (const std::string& name : rest) {  // of another version
    if (!Has(kWaiting, name)) order.push_back(name);
  }
  for (const char* name : kWaiting) {
    if (rest.count(name) > 0) order.emplace_back(name);
  }
  return order;
}

MeanInterval StageOver(const Variant& variant, const std::string& stage) {
  std::vector<double> values;
  bool there = false;
  for (const RunFigures* run : variant.runs) {
    if (run->stages_s.empty()) continue;
    const auto found = run->stages_s.find(stage);
    there = there || found != run->stages_s.end();
    values.push_back(found != run->stages_s.end() ? found->second : 0);
  }
  return there ? MeanWithInterval(values) : MeanInterval();
}

TextTable StageTable(const std::vector<Variant>& variants) {
  TextTable table;
  table.header = {"stage [s]"};
  for (const Variant& variant : variants) table.header.push_back(variant.name);
  for (const std::string& stage : StageOrder(variants)) {
    table.rows.push_back({stage});
    for (const Variant& variant : variants)
      table.rows.back().push_back(IntervalCell(StageOver(variant, stage), 2));
  }
  return table;
}

}  // namespace tutti::cli
