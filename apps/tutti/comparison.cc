#include "apps/tutti/comparison.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>
#include <utility>

#include "apps/report/page.h"
#include "apps/tutti/files.h"
#include "core/terminal.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

using Json = nlohmann::ordered_json;

/// The number at a path like "evaluation/slam/ate_rmse_m"; NaN if there is none.
double Number(const Json& json, const std::string& path) {
  const Json::json_pointer pointer("/" + path);
  return json.contains(pointer) && json.at(pointer).is_number() ? json.at(pointer).get<double>()
                                                                : RunFigures::kNone;
}

std::string VariantOf(const Json& json) {
  const Json::json_pointer loops("/config/run/loops"), rule("/config/loops/rule");
  if (json.contains(loops) && json.at(loops) == false) return "odometry";
  if (!json.contains(rule) || !json.at(rule).is_string()) return "?";
  const std::string word = json.at(rule).get<std::string>();
  // A summary without the key is of the time when there was no other evidence.
  const Json::json_pointer kind("/config/loops/evidence/kind");
  const bool standardised = !json.contains(kind) || json.at(kind) == "standardised";
  return word == "joint" ? kEnsemble : word == "mean" && standardised ? "standardised-mean" : word;
}

/// t such that P(|T| >= t) = p, by bisection.
double StudentQuantile(double p, double degrees) {
  double low = 0, high = 1e4;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (StudentTwoSided(middle, degrees) > p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// The runs of one data set.
struct DatasetRuns {
  std::string name;
  std::vector<Variant> variants;
};

std::vector<DatasetRuns> Grouped(const std::vector<RunFigures>& runs) {
  const auto entry = [](auto& list, const std::string& name) -> auto& {
    for (auto& known : list) {
      if (known.name == name) return known;
    }
    list.push_back({name, {}});
    return list.back();
  };
  std::vector<DatasetRuns> out;
  for (const RunFigures& run : runs)
    entry(entry(out, run.dataset).variants, run.variant).runs.push_back(&run);
  return out;
}

/// A figure of ComparisonJson, and where a summary.json has it; null: it is summed up.
struct Figure {
  const char* name;
  const char* path;
  double RunFigures::*field;
};
constexpr Figure kFigures[] = {
    {"loops_proposed", "loops/proposed", &RunFigures::proposed},
    {"loops_accepted", "loops/accepted", &RunFigures::accepted},
    {"loops_false", "loops/false", &RunFigures::false_loops},
    {"ate_rmse_m", "evaluation/slam/ate_rmse_m", &RunFigures::ate_m},
    {"rpe_rmse_m", "evaluation/slam/rpe_rmse_m", &RunFigures::rpe_m},
    {"t_rel_percent", "evaluation/slam/kitti_translation_percent", &RunFigures::t_rel_percent},
    {"r_rel_deg_per_m", "evaluation/slam/kitti_rotation_deg_per_m", &RunFigures::r_rel_deg_per_m},
    {"wall_s", "timing/wall_s", &RunFigures::wall_s},
    {"odometry_s", nullptr, &RunFigures::odometry_s},
    {"loops_s", nullptr, &RunFigures::loops_s},
    {"frame_ms_median", "timing/frame_ms/median", &RunFigures::frame_ms},
    {"peak_memory_mb", "memory/peak_mb", &RunFigures::memory_mb}};

/// What the runs of a table differ in, for a reader: "first frame (0 to 4); noise drawn anew, ...".
std::string WhatVaries(const std::vector<Variant>& variants) {
  std::set<std::string> datasets;
  std::set<int> starts, draws;
  std::set<std::uint64_t> seeds;
  double noise = 0;
  for (const Variant& variant : variants) {
    for (const RunFigures* run : variant.runs) {
      datasets.insert(run->sample.dataset);
      starts.insert(run->sample.start);
      draws.insert(run->sample.noise_draw);
      seeds.insert(run->sample.seed);
      noise = std::max(noise, run->sample.noise);
    }
  }
  std::string text;
  const auto add = [&text](const std::string& what) { text += (text.empty() ? "" : "; ") + what; };
  if (datasets.size() > 1) add("the data set (" + std::to_string(datasets.size()) + ")");
  if (starts.size() > 1) {
    add("the first frame (" + std::to_string(*starts.begin()) + " to " + std::to_string(*starts.rbegin()) +
        ")");
  }
  if (noise > 0 && draws.size() > 1)
    add("image noise, drawn anew (standard deviation " + Fixed(noise, 1) + " of 255)");
  if (seeds.size() > 1) add("the seed of the loop detector alone");
  return text.empty() ? "nothing" : text;
}

/// Where the ensemble helped, where that can't be told, and where it did not, in words.
std::vector<std::string> Verdict(const std::vector<Variant>& variants) {
  double ensemble = RunFigures::kNone;
  for (const Variant& variant : variants) {
    if (variant.name == kEnsemble) ensemble = Over(variant, &RunFigures::ate_m).mean;
  }
  if (!std::isfinite(ensemble)) return {};
  std::string beaten, unclear, not_beaten;
  for (const Variant& variant : variants) {
    const double mean = Over(variant, &RunFigures::ate_m).mean;
    if (variant.name == kEnsemble || !std::isfinite(mean)) continue;
    const PairedTTestResult test = AgainstEnsemble(variant, variants);
    const bool sure = test.pairs >= kLeastPairs && test.p < 0.05;
    std::string& list = mean <= ensemble ? not_beaten : sure ? beaten : unclear;
    list += (list.empty() ? "" : ", ") + variant.name + " (" + Fixed(mean, 4) + " m)";
  }
  std::vector<std::string> lines = {"Mean ATE of the ensemble: " + Fixed(ensemble, 4) + " m."};
  if (!beaten.empty()) lines.push_back("* Lower than that of " + beaten + ", p < 0.05.");
  if (!unclear.empty())
    lines.push_back("* Lower than that of " + unclear +
                    ", but these runs can't tell them apart (p >= 0.05, or fewer than " +
                    std::to_string(kLeastPairs) + " pairs).");
  if (!not_beaten.empty()) lines.push_back("* The ensemble did not help against " + not_beaten + ".");
  return lines;
}

Json IntervalJson(const MeanInterval& value) {
  return {{"mean", value.mean},  // NaN: null
          {"half_width_95", value.half_width},
          {"largest", value.largest},
          {"count", value.count}};
}

Json SampleJson(const RunFigures& run) {
  return {{"dataset", run.sample.dataset},       {"start", run.sample.start}, {"noise", run.sample.noise},
          {"noise_draw", run.sample.noise_draw}, {"seed", run.sample.seed},   {"ate_rmse_m", run.ate_m}};
}

Json VariantJson(const Variant& variant, const std::vector<Variant>& all) {
  Json json = {{"variant", variant.name}, {"samples", Json::array()}, {"failures", Json::array()}};
  for (const RunFigures* run : variant.runs) {
    if (run->failure.empty()) {
      json["samples"].push_back(SampleJson(*run));
    } else {
      json["failures"].push_back(SampleJson(*run));
      json["failures"].back()["reason"] = run->failure;
    }
  }
  for (const Figure& figure : kFigures) json[figure.name] = IntervalJson(Over(variant, figure.field));
  json["stages_s"] = Json::object();
  for (const std::string& stage : StageOrder({variant}))
    json["stages_s"][stage] = IntervalJson(StageOver(variant, stage));
  const PairedTTestResult test = AgainstEnsemble(variant, all);
  json["ate_minus_ensemble"] = {{"pairs", test.pairs}, {"mean_m", test.mean_difference}, {"t", test.t}};
  if (test.pairs >= kLeastPairs) json["ate_minus_ensemble"]["p"] = test.p;
  return json;
}

/// For other programs: the data set is a column, and notes are left out.
TextTable AsOneTable(const std::vector<ComparisonTable>& tables) {
  TextTable out;
  for (const ComparisonTable& table : tables) {
    if (out.header.empty()) {
      out.header = table.table.header;
      out.header.insert(out.header.begin(), "data set");
    }
    for (std::vector<std::string> row : table.table.rows) {
      row.insert(row.begin(), table.dataset);
      out.rows.push_back(std::move(row));
    }
  }
  return out;
}

}  // namespace

bool operator==(const Sample& a, const Sample& b) {
  return std::tie(a.dataset, a.start, a.noise, a.noise_draw, a.seed) ==
         std::tie(b.dataset, b.start, b.noise, b.noise_draw, b.seed);
}

std::string Describe(const Sample& sample) {
  std::string text = "first frame " + std::to_string(sample.start);
  if (sample.noise > 0) text += ", noise draw " + std::to_string(sample.noise_draw);
  return text + ", seed " + std::to_string(sample.seed);
}

RunFigures ReadRunFigures(const std::filesystem::path& summary) {
  const Json json = ReadJson(summary, "give the summary.json of a run");
  if (!json.is_object() || !json.contains("frames") || !json.contains("loops"))
    throw InputError(summary.string() + ": is no summary.json of `tutti run`");
  RunFigures run;
  run.folder = summary.parent_path();
  run.dataset = "?";
  if (json.contains("dataset") && json["dataset"].is_string())
    run.dataset = json["dataset"].get<std::string>();
  run.variant = VariantOf(json);
  const auto whole = [&json](const std::string& path) {
    const double number = Number(json, path);
    return number >= 0 && number <= 1e15 ? static_cast<std::int64_t>(number) : 0;
  };
  run.sample = {run.dataset, static_cast<int>(whole("config/dataset/start")), 0,
                static_cast<int>(whole("config/dataset/noise_draw")),
                static_cast<std::uint64_t>(whole("seed"))};
  if (Number(json, "config/dataset/noise") > 0) run.sample.noise = Number(json, "config/dataset/noise");
  for (const Figure& figure : kFigures) {
    if (figure.path != nullptr) run.*figure.field = Number(json, figure.path);
  }
  run.stages_s = StageSeconds(json);
  run.odometry_s = WorkSeconds(run.stages_s, "odometry_");
  run.loops_s = WorkSeconds(run.stages_s, "loop_");
  return run;
}

MeanInterval MeanWithInterval(const std::vector<double>& values) {
  MeanInterval out;
  double sum = 0, squares = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value;
    out.largest = out.count == 0 ? value : std::max(out.largest, value);
    ++out.count;
  }
  if (out.count == 0) return out;
  const double n = static_cast<double>(out.count);
  out.mean = sum / n;
  if (out.count < 2) return out;
  for (const double value : values) {
    if (std::isfinite(value)) squares += (value - out.mean) * (value - out.mean);
  }
  out.half_width = StudentQuantile(0.05, n - 1) * std::sqrt(squares / (n - 1) / n);
  return out;
}

std::string IntervalCell(const MeanInterval& value, int decimals) {
  if (value.count == 0) return "-";
  std::string text = Fixed(value.mean, decimals);
  if (std::isfinite(value.half_width)) text += " +- " + Fixed(value.half_width, decimals);
  return text;
}

std::vector<ComparisonTable> ComparisonTables(const std::vector<RunFigures>& runs,
                                              const TableChoice& choice) {
  std::vector<ComparisonTable> tables;
  for (const auto& [dataset, variants] : Grouped(runs)) {
    std::vector<std::string> notes = Verdict(variants);
    notes.insert(notes.begin(), "What varies between the runs of a variant: " + WhatVaries(variants) + ".");
    tables.push_back({dataset, FiguresTable(variants, choice), StageTable(variants), std::move(notes)});
  }
  return tables;
}

std::string DescribeComparison(const std::vector<RunFigures>& runs, TableFormat format,
                               const TableChoice& choice) {
  const std::vector<ComparisonTable> tables = ComparisonTables(runs, choice);
  if (format == TableFormat::kCsv) return Render(AsOneTable(tables), format);
  std::string text;
  for (const ComparisonTable& table : tables) {
    text += (text.empty() ? "" : "\n") + table.dataset + "\n\n" + Render(table.table, format) + "\n";
    for (const std::string& note : table.notes) text += note + "\n";
    if (!table.notes.empty()) text += "\n";
    if (!table.stages.rows.empty()) text += "Time per stage:\n\n" + Render(table.stages, format) + "\n";
  }
  return text +
         "Means over the runs, +- half of the 95 % confidence interval; p: paired t-test of the ATE against "
         "the ensemble's, from " +
         std::to_string(kLeastPairs) + " pairs on.\n";
}

Json ComparisonJson(const std::vector<RunFigures>& runs) {
  Json json = {{"datasets", Json::array()}};
  for (const auto& [dataset, variants] : Grouped(runs)) {
    Json entry = {{"dataset", dataset}, {"varies", WhatVaries(variants)}, {"variants", Json::array()}};
    for (const Variant& variant : variants) entry["variants"].push_back(VariantJson(variant, variants));
    json["datasets"].push_back(entry);
  }
  return json;
}

void WriteComparisonReport(const std::filesystem::path& file, const std::string& title,
                           const std::vector<RunFigures>& runs) {
  std::vector<ReportTable> tables;
  for (const ComparisonTable& table : ComparisonTables(runs))
    tables.push_back({table.dataset, table.table.header, table.table.rows, table.notes, table.stages.header,
                      table.stages.rows});
  std::vector<Json> reports;
  std::vector<std::string> failures;
  for (const RunFigures& run : runs) {
    const std::string name = run.variant + ", " + Describe(run.sample) + ": ";
    if (!run.failure.empty()) failures.push_back(name + run.failure);
    try {
      auto report = ReadRunReport(run.folder);
      if (!report) continue;
      (*report)["variant"] = run.variant;
      reports.push_back(std::move(*report));
    } catch (const InputError& error) {
      failures.push_back(name + "no charts: " + error.what());
      internal::Say("warning: no charts of a run: %s", error.what());
    }
  }
  WriteReportPage(file, ComparisonPage(title, tables, std::move(reports), failures));
}

}  // namespace tutti::cli
