#include "apps/tutti/stage_times.h"

#include <algorithm>
#include <array>
#include <set>

namespace tutti::cli {
namespace {

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
