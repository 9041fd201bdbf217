// Published figures beside one's own: `tutti evaluate --against`.
#include <algorithm>
#include <limits>
#include <map>

#include "apps/tutti/evaluation_output.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::cli {
namespace {

using Json = nlohmann::ordered_json;

std::string Figure(const std::optional<double>* ate_m) {
  if (ate_m == nullptr) return "-";
  return *ate_m ? Formatted("%.6g", **ate_m) : "x";
}

std::vector<std::string> Sensors(const std::string& benchmark) {
  std::vector<std::string> out;
  for (const PublishedRow& row : PublishedRows()) {
    if (row.benchmark == benchmark && std::find(out.begin(), out.end(), row.sensor) == out.end())
      out.push_back(row.sensor);
  }
  return out;
}

/// What of the evaluation no published row was made with; empty: nothing.
std::string UnusualOption(const EvaluationInput& input) {
  if (input.plane != "none") return "--project-to-plane";
  if (input.options.align_first > 0) return "--align-first";
  if (input.options.interpolate) return "--interpolate";
  if (input.options.downsample > 0) return "--downsample";
  if (!input.motion_filter.empty()) return "--motion-filter";
  return {};
}

std::string FindSequence(const Against& against, const EvaluationInput& input) {
  const std::vector<std::string> known = PublishedSequences(against.benchmark);
  if (!against.sequence.empty()) {
    if (std::find(known.begin(), known.end(), against.sequence) != known.end()) return against.sequence;
    throw InputError("--sequence " + against.sequence + ": there are figures of " + JoinText(known));
  }
  std::vector<std::string> paths = input.estimates;
  paths.push_back(input.reference);
  for (const std::string& path : paths) {
    std::string sequence = SequenceInPath(against.benchmark, path);
    if (!sequence.empty()) return sequence;
  }
  throw InputError("--against " + against.benchmark +
                   ": the names of the files don't say which sequence it is; pass --sequence, one of " +
                   JoinText(known));
}

}  // namespace

std::string DescribePublished(const std::string& benchmark, TableFormat format) {
  std::map<std::string, std::vector<const PublishedRow*>> groups;
  std::vector<std::string> order;
  for (const PublishedRow& row : PublishedRows()) {
    if (row.benchmark != benchmark) continue;
    const std::string group = row.sensor + ", alignment " + row.alignment;
    if (groups[group].empty()) order.push_back(group);
    groups[group].push_back(&row);
  }
  std::string text, sources;
  for (const std::string& group : order) {
    TextTable table;
    table.header = {"system"};
    for (const std::string& sequence : PublishedSequences(benchmark)) {
      const auto has = [&](const PublishedRow* row) { return row->Of(sequence) != nullptr; };
      if (std::any_of(groups[group].begin(), groups[group].end(), has)) table.header.push_back(sequence);
    }
    for (const PublishedRow* row : groups[group]) {
      table.rows.push_back({row->system});
      for (std::size_t k = 1; k < table.header.size(); ++k)
        table.rows.back().push_back(Figure(row->Of(table.header[k])));
      sources += "  " + row->system + ", " + row->sensor + ": " + row->source + " (" + row->protocol + ")\n";
    }
    text += group + ", ATE rmse [m]\n" + Render(table, format) + "\n";
  }
  return text + "Figures are of whole sequences; x: failed, -: not published. Sources:\n" + sources;
}

PublishedComparison::PublishedComparison(const Against& against, const EvaluationInput& input)
    : benchmark_(against.benchmark),
      sensor_(against.sensor.empty() ? input.sensor : against.sensor),
      alignment_(input.align) {
  const std::string begin = "--against " + benchmark_ + ": ";
  const std::vector<std::string> sensors = Sensors(benchmark_);
  if (sensor_.empty()) {
    throw InputError(begin + "figures of different sensors can't be compared; pass --sensor, one of " +
                     JoinText(sensors));
  }
  if (std::find(sensors.begin(), sensors.end(), sensor_) == sensors.end())
    throw InputError(begin + "there are no figures of the sensor " + sensor_ + ", only of " +
                     JoinText(sensors));
  const std::string unusual = UnusualOption(input);
  if (!unusual.empty())
    throw InputError(begin + "the published figures were made without " + unusual + "; leave it out");
  sequence_ = FindSequence(against, input);
  std::string other;
  for (const PublishedRow& row : PublishedRows()) {
    if (row.benchmark != benchmark_ || row.sensor != sensor_ || row.Of(sequence_) == nullptr) continue;
    if (row.alignment == alignment_)
      rows_.push_back(&row);
    else
      other = row.alignment;
  }
  if (!rows_.empty()) return;
  if (other.empty())
    throw InputError(begin + "there are no figures of " + sequence_ + " with the sensor " + sensor_);
  throw InputError(begin + "the published figures of the sensor " + sensor_ + " are after the alignment " +
                   other + ", and this evaluation's is " + alignment_ + "; pass --align " + other);
}

std::string PublishedComparison::Describe(const std::vector<EvaluatedEstimate>& estimates,
                                          TableFormat format) const {
  std::vector<std::pair<double, std::vector<std::string>>> rows;
  for (const EvaluatedEstimate& estimate : estimates) {
    const double ate = estimate.report.ate.rmse, share = estimate.report.coverage.share();
    const std::string covered = Fixed(100 * share, 2) + (share < kFullCoverage ? " !" : "");
    rows.push_back({ate, {estimate.name, Fixed(ate, 4), covered, "this evaluation"}});
  }
  for (const PublishedRow* row : rows_) {
    const std::optional<double>* ate = row->Of(sequence_);
    rows.push_back({ate->value_or(std::numeric_limits<double>::infinity()),
                    {row->system, Figure(ate), "-", row->source + " (" + row->protocol + ")"}});
  }
  std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  TextTable table;
  table.header = {benchmark_ + " " + sequence_, "ATE rmse [m]", "coverage [%]", "source"};
  for (auto& [ate, row] : rows) table.rows.push_back(std::move(row));
  return "\n" + sensor_ + ", alignment " + alignment_ +
         "; published figures are of the whole sequence (x: failed)\n" + Render(table, format);
}

Json PublishedComparison::ToJson() const {
  Json json = {{"benchmark", benchmark_},
               {"sequence", sequence_},
               {"sensor", sensor_},
               {"alignment", alignment_},
               {"rows", Json::array()}};
  for (const PublishedRow* row : rows_) {
    const std::optional<double>& ate = *row->Of(sequence_);
    json["rows"].push_back({{"system", row->system},
                            {"ate_rmse_m", ate ? Json(*ate) : Json()},
                            {"source", row->source},
                            {"protocol", row->protocol}});
  }
  return json;
}

}  // namespace tutti::cli
