#include "apps/tutti/evaluation_output.h"

#include <algorithm>
#include <limits>
#include <map>

#include "apps/tutti/evaluation_report.h"
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

Json EstimateJson(const std::string& reference, const EvaluatedEstimate& estimate) {
  Json json;
  json["reference"] = reference;
  json["estimate"] = estimate.file;
  json["name"] = estimate.name;
  json.update(ReportJson(estimate.report, estimate.options));
  return json;
}

std::string DeltaName(const EvaluationOptions& options) {
  static constexpr const char* kShort[] = {"frames", "m", "deg", "s", "rad"};
  const bool one_frame = options.rpe_unit == DeltaUnit::kFrames && options.rpe_delta == 1;
  return Formatted("%g %s", options.rpe_delta,
                   one_frame ? "frame" : kShort[static_cast<int>(options.rpe_unit)]);
}

std::string SegmentsLine(const char* name, const SegmentErrors& errors) {
  return std::string("  ") + name + ": t_rel " + Fixed(errors.translation_percent, 4) + " %, r_rel " +
         Fixed(100 * errors.rotation_deg_per_m, 4) + " deg/100 m (" + std::to_string(errors.segments) +
         " segments)\n";
}

std::string Plural(std::size_t count, const char* what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

bool IsPartial(const EvaluationReport& report) { return report.coverage.share() < kFullCoverage; }

std::string Percent(const TrajectoryCoverage& coverage) { return Fixed(100 * coverage.share(), 2); }

constexpr const char* kPartly =
    "! covers less than 99 % of the reference: the ATE is that of the part with poses\n";

std::string AssociationLine(const EvaluatedEstimate& estimate) {
  const EvaluationReport& r = estimate.report;
  std::string text = "unmatched: reference " + std::to_string(r.association.reference_unmatched) +
                     ", estimate " + std::to_string(r.association.estimate_unmatched);
  if (!estimate.options.by_index && !estimate.options.interpolate) {
    text += "; time difference of a pair: median " + Fixed(1e3 * r.association.median_time_difference_s, 3) +
            " ms, largest " + Fixed(1e3 * r.association.largest_time_difference_s, 3) + " ms";
  }
  return text + "\n";
}

std::string CoverageLine(const EvaluatedEstimate& estimate) {
  const TrajectoryCoverage& coverage = estimate.report.coverage;
  std::string text = "coverage: " + Percent(coverage) + " % (" + std::to_string(coverage.posed) + " of " +
                     std::to_string(coverage.all) + " frames of the reference's time have a pose";
  if (coverage.unpaired > 0)
    text += "; " + std::to_string(coverage.unpaired) + " poses have no partner in the reference";
  return text + ")\n";
}

constexpr const char* kPositionsAlone =
    "  positions alone: errors of rotation and of relative motion are left out\n";

std::string Title(const EvaluatedEstimate& estimate) {
  const EvaluationReport& r = estimate.report;
  std::string text = Plural(r.pairs, "pair") + " of poses (reference " + std::to_string(r.reference_poses) +
                     ", estimate " + std::to_string(r.estimate_poses) + "), path " +
                     Fixed(r.path_length_m, 2) + " m, alignment " + ToString(r.alignment);
  if (estimate.options.align_first > 0)
    text += " by the first " + std::to_string(estimate.options.align_first);
  if (r.alignment == TrajectoryAlignment::kSim3 || r.alignment == TrajectoryAlignment::kScale)
    text += " (scale " + Fixed(r.S_reference_estimate.scale, 6) + ")";
  if (estimate.options.plane != ProjectionPlane::kNone)
    text += std::string(", in the plane ") + ToString(estimate.options.plane);
  return text + "\n" + AssociationLine(estimate) + CoverageLine(estimate);
}

std::string Rate(const SegmentErrors& errors, double value, int decimals) {
  return errors.segments > 0 ? Fixed(value, decimals) : "-";
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

std::string DescribeEvaluation(const EvaluatedEstimate& estimate, TableFormat format) {
  const EvaluationReport& r = estimate.report;
  TextTable table;
  table.header = {"", "rmse", "mean", "median", "std", "min", "max", "sse"};
  const auto add = [&](const std::string& name, const ErrorStatistics& s) {
    table.rows.push_back({name, Fixed(s.rmse, 6), Fixed(s.mean, 6), Fixed(s.median, 6), Fixed(s.std, 6),
                          Fixed(s.min, 6), Fixed(s.max, 6), Fixed(s.sse, 6)});
  };
  add(IsPartial(r) ? "ATE [m] !" : "ATE [m]", r.ate);
  if (r.rotations) {
    add("ATE rotation [deg]", r.ate_rotation);
    add("ATE full", r.ate_full);
  }
  const std::string rpe = "RPE per " + DeltaName(estimate.options);
  if (r.rpe.count > 0) {
    add(rpe + " [m]", r.rpe);
    add(rpe + " [deg]", r.rpe_rotation);
    add(rpe + " full", r.rpe_full);
  }
  if (r.rpe_point_distance.count > 0) add(rpe + " distance [m]", r.rpe_point_distance);
  if (r.rpe_point_distance_ratio.count > 0) add(rpe + " distance [%]", r.rpe_point_distance_ratio);
  if (format == TableFormat::kCsv) return Render(table, format);
  std::string text = Title(estimate) + Render(table, format);
  if (IsPartial(r)) text += kPartly;
  if (!r.rotations) text += kPositionsAlone;
  if (r.rpe_point_distance.count == 0) text += "  " + rpe + ": no two poses are that far apart\n";
  if (r.kitti.segments > 0) text += SegmentsLine("KITTI, 100..800 m", r.kitti);
  if (r.drift.segments > 0) text += SegmentsLine("drift, 10..50 % of the path", r.drift);
  return text;
}

std::string CompareEvaluations(const std::vector<EvaluatedEstimate>& estimates, TableFormat format) {
  const EvaluationOptions& options = estimates.front().options;
  const std::string rpe = "RPE per " + DeltaName(options);
  TextTable table;
  bool partly = false, positions_alone = false;
  table.header = {"estimate",   "pairs",  "coverage [%]", "ATE rmse [m]",
                  "mean",       "median", "max",          "rotation [deg]",
                  rpe + " [m]", "[deg]",  "t_rel [%]",    "r_rel [deg/100 m]",
                  "drift [%]"};
  for (const EvaluatedEstimate& estimate : estimates) {
    const EvaluationReport& r = estimate.report;
    const bool relative = r.rpe.count > 0;
    partly = partly || IsPartial(r);
    positions_alone = positions_alone || !r.rotations;
    table.rows.push_back(
        {estimate.name, std::to_string(r.pairs),
         Percent(r.coverage) + (IsPartial(r) && format != TableFormat::kCsv ? " !" : ""),
         Fixed(r.ate.rmse, 6), Fixed(r.ate.mean, 6), Fixed(r.ate.median, 6), Fixed(r.ate.max, 6),
         r.rotations ? Fixed(r.ate_rotation.rmse, 6) : "-", relative ? Fixed(r.rpe.rmse, 6) : "-",
         relative ? Fixed(r.rpe_rotation.rmse, 6) : "-", Rate(r.kitti, r.kitti.translation_percent, 4),
         Rate(r.kitti, 100 * r.kitti.rotation_deg_per_m, 4), Rate(r.drift, r.drift.translation_percent, 4)});
  }
  if (format == TableFormat::kCsv) return Render(table, format);
  return std::string("alignment ") + ToString(options.alignment) + "; rotations and relative errors: rmse\n" +
         Render(table, format) + (partly ? kPartly : "") + (positions_alone ? kPositionsAlone : "");
}

Json EvaluationJson(const std::string& reference, const std::vector<EvaluatedEstimate>& estimates) {
  if (estimates.size() == 1) return EstimateJson(reference, estimates.front());
  Json json = {{"reference", reference}, {"estimates", Json::array()}};
  for (const EvaluatedEstimate& estimate : estimates)
    json["estimates"].push_back(EstimateJson(reference, estimate));
  return json;
}

std::string ErrorsCsv(const std::vector<EvaluatedEstimate>& estimates) {
  std::string text = "estimate,stamp_s,translation_m,rotation_deg,full\n";
  for (const EvaluatedEstimate& estimate : estimates) {
    const EvaluationReport& r = estimate.report;
    for (std::size_t k = 0; k < r.pairs; ++k) {
      text += '"' + estimate.name + '"' +
              Formatted(",%.9f,%.9g", r.poses.stamps_s[k], r.absolute.translation[k]) +
              (r.rotations ? Formatted(",%.9g,%.9g", r.absolute.rotation_deg[k], r.absolute.full[k]) : ",,") +
              "\n";
    }
  }
  return text;
}

}  // namespace tutti::cli
