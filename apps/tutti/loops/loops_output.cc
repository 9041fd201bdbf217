#include "apps/tutti/loops/loops_output.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <utility>

#include "apps/tutti/files.h"
#include "apps/tutti/loops/earlier_images.h"
#include "apps/tutti/text_table.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "tutti/core/text.h"

namespace tutti::cli {
namespace {

// Of a copy, sorted; q in [0, 1]; 0 for none.
double Quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  const double position = q * static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(std::lround(position))];
}

std::vector<double> Collect(const std::vector<LoopRow>& rows,
                            const std::function<double(const LoopRow&)>& value) {
  std::vector<double> values;
  for (const LoopRow& row : rows) {
    if (row.read) values.push_back(value(row));
  }
  return values;
}

nlohmann::ordered_json Stages(const std::vector<LoopRow>& rows) {
  const std::vector<std::pair<const char*, double LoopResult::*>> stages = {
      {"extract", &LoopResult::extract_ms}, {"quantise", &LoopResult::quantise_ms},
      {"memory", &LoopResult::memory_ms},   {"likelihood", &LoopResult::likelihood_ms},
      {"filter", &LoopResult::filter_ms},   {"verify", &LoopResult::verify_ms}};
  nlohmann::ordered_json json;
  for (const auto& [name, field] : stages) {
    const auto member = field;
    json[name] = Quantile(Collect(rows, [member](const LoopRow& row) { return row.result.*member; }), 0.5);
  }
  return json;
}

nlohmann::ordered_json Rates(const PrecisionRecall& rates) {
  return {{"precision", rates.precision}, {"recall", rates.recall}};
}

// null where there is nothing that could be calibrated.
nlohmann::ordered_json CalibrationError(const LoopEvaluation& evaluation) {
  if (evaluation.calibration_images == 0) return nullptr;
  return evaluation.calibration_error;
}

std::string Percent(double share) { return Formatted("%.1f%%", 100 * share); }

std::string CalibrationText(const LoopEvaluation& evaluation) {
  return evaluation.calibration_images == 0 ? "-" : Percent(evaluation.calibration_error);
}

nlohmann::ordered_json Reliability(const LoopEvaluation& evaluation) {
  nlohmann::ordered_json bins = nlohmann::ordered_json::array();
  const double count = LoopEvaluation::kReliabilityBins;
  for (std::size_t b = 0; b < evaluation.reliability.size(); ++b) {
    const ReliabilityBin& bin = evaluation.reliability[b];
    bins.push_back({{"above", static_cast<double>(b) / count},
                    {"up_to", static_cast<double>(b + 1) / count},
                    {"images", bin.images},
                    {"mean_probability", bin.mean_probability},
                    {"accuracy", bin.accuracy}});
  }
  return bins;
}

nlohmann::ordered_json RecallParts(const std::vector<RecallPart>& parts) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const RecallPart& part : parts) {
    json.push_back({{"from", part.from},
                    {"to", part.to},
                    {"images", part.rows},
                    {"recall", part.Recall()},
                    {"recall_at_100_precision", part.RecallAt100Precision()}});
  }
  return json;
}

std::ptrdiff_t CountSecondWords(const LoopRun& run, SecondWord word) {
  return std::count_if(run.rows.begin(), run.rows.end(),
                       [word](const LoopRow& row) { return row.second_word == word; });
}

std::ptrdiff_t Count(const LoopRun& run, bool (*is)(const LoopRow&)) {
  return std::count_if(run.rows.begin(), run.rows.end(), is);
}
bool IsEarlier(const LoopRow& row) { return row.earlier.has_value(); }
bool IsAccepted(const LoopRow& row) { return row.result.accepted; }
bool IsDamaged(const LoopRow& row) { return !row.read; }

std::string Csv(const LoopRun& run) {
  std::string text =
      "image,file,hypothesis,candidate,posterior,probability,proposed,accepted,verified_candidate,matches,"
      "inliers,truth,row_has_loop";
  for (const std::string& name : run.options.members) {
    for (const char* column : {"_hypothesis", "_best", "_at_candidate"})
      text.append(",").append(name).append(column);
  }
  text += ",late,reason\n";
  for (const LoopRow& row : run.rows) {
    const LoopResult& r = row.result;
    const int image = static_cast<int>(r.query);
    const long verified = r.accepted ? run.Number(r.candidate) : -1;
    const long location = row.Said();
    text +=
        std::to_string(run.Number(image)) + "," + Quoted(row.file) +
        Formatted(
            ",%.9g,%ld,%.9g,%.9g,%d,%d,%ld,%d,%d,%s,%d", r.hypothesis, run.Number(r.best), r.posterior,
            r.probability, r.proposed ? 1 : 0, r.accepted ? 1 : 0, verified, r.verification.matches,
            r.verification.inliers,
            location < 0 || !run.judged ? "-" : LabelName(run.truth.At(image, static_cast<int>(location))),
            run.truth.HasLoop(image) ? 1 : 0);
    for (std::size_t k = 0; k < run.options.members.size(); ++k) {
      const MemberOpinion opinion = k < r.members.size() ? r.members[k] : MemberOpinion();
      text += Formatted(",%.9g,%ld,%.9g", opinion.hypothesis, run.Number(opinion.best), opinion.at_candidate);
    }
    text += std::string(",") + SecondWordName(row.second_word);
    text += "," + Quoted(row.read ? r.reason : "the image can't be read") + "\n";
  }
  return text;
}

// The loops that were accepted, one a line: both images with their files, probability, inliers.
std::string FoundLoopsCsv(const LoopRun& run) {
  std::string text = "image,loop_with,probability,inliers,matches,late,file,loop_with_file\n";
  for (const LoopRow& row : run.rows) {
    const LoopResult& r = row.result;
    if (!r.accepted) continue;
    const auto candidate = static_cast<std::size_t>(r.candidate);
    const std::string other = candidate < run.rows.size() ? run.rows[candidate].file : "";
    text += Formatted("%ld,%ld,%.9g,%d,%d,%d,", run.Number(r.query), run.Number(r.candidate), r.probability,
                      r.verification.inliers, r.verification.matches,
                      row.second_word == SecondWord::kAccepted ? 1 : 0) +
            Quoted(row.file) + "," + Quoted(other) + "\n";
  }
  return text;
}

// Without a ground truth there is nothing to rank against.
nlohmann::ordered_json FoundJson(const LoopRun& run, const LoopReport& report) {
  return {{"images", run.rows.size()},
          {"images_damaged", report.damaged},
          {"accepted", Count(run, IsAccepted)},
          {"threshold", run.options.loop_threshold},
          {"ms_per_image", {{"median", report.ms_median}, {"p99", report.ms_p99}}},
          {"stage_ms_median", Stages(run.rows)}};
}

void PrintFound(const LoopRun& run, const LoopReport& report, const std::filesystem::path& folder) {
  std::printf("%-34s %s\n", "rule", RuleName(run.options).c_str());
  std::printf("%-34s %zu, %d of them damaged\n", "images", run.rows.size(), report.damaged);
  std::printf("%-34s %td, at a probability of %g or more\n", "loops accepted", Count(run, IsAccepted),
              run.options.loop_threshold);
  std::printf("%-34s %.1f median, %.1f p99\n", "ms per image", report.ms_median, report.ms_p99);
  std::printf("written: %s, contact_sheet.png (look at it), hypotheses.csv, results.json, confusion.png\n",
              (folder / "loops.csv").string().c_str());
  std::printf("with --ground-truth (a loop matrix or a trajectory) they are judged as well\n");
}

void PrintRecall(const std::string& name, const RecallPart& verified, const RecallPart& posterior) {
  std::printf("%-34s %11.1f%% %11.1f%%   of %d images\n", name.c_str(), 100 * verified.Recall(),
              100 * posterior.Recall(), verified.rows);
}

// "recall, overlap >= 0.5", "recall, turned by 10 to 20 deg".
void PrintRecallByView(const LoopReport& report) {
  const LoopEvaluation &v = report.verified, &p = report.posterior;
  for (std::size_t k = 0; k < v.recall_by_overlap.size(); ++k) {
    PrintRecall(Formatted("recall, overlap >= %g", v.recall_by_overlap[k].from), v.recall_by_overlap[k],
                p.recall_by_overlap[k]);
  }
  for (std::size_t k = 0; k < v.recall_by_angle.size(); ++k) {
    const RecallPart& part = v.recall_by_angle[k];
    PrintRecall(Formatted("recall, turned by %g to %g deg", part.from, part.to), part, p.recall_by_angle[k]);
  }
}

}  // namespace

const char* LabelName(LoopLabel label) {
  return label == LoopLabel::kLoop ? "loop" : label == LoopLabel::kIgnore ? "ignored" : "none";
}

const char* SecondWordName(SecondWord word) {
  return word == SecondWord::kAccepted ? "accepted" : word == SecondWord::kWithdrawn ? "withdrawn" : "";
}

LoopReport EvaluateRun(const LoopRun& run) {
  std::vector<LoopObservation> observations;
  for (const LoopRow& row : run.rows) observations.push_back(Observe(row.result));
  LoopReport report;
  report.verified = EvaluateVerified(observations, run.truth);
  report.ranked = EvaluateRanked(observations, run.truth);
  report.posterior = EvaluatePosterior(observations, run.truth, run.options.propose_threshold);
  const std::vector<double> ms = Collect(run.rows, [](const LoopRow& row) { return row.ms; });
  report.ms_median = Quantile(ms, 0.5);
  report.ms_p99 = Quantile(ms, 0.99);
  report.damaged = static_cast<int>(Count(run, IsDamaged));
  return report;
}

nlohmann::ordered_json FiguresJson(const LoopRun& run, const LoopReport& report) {
  const LoopEvaluation &verified = report.verified, &posterior = report.posterior;
  const std::vector<std::pair<std::string, const LoopEvaluation*>> rankings = {
      {"", &verified}, {"_ranked", &report.ranked}, {"_posterior", &posterior}};
  nlohmann::ordered_json json;
  const auto add = [&](const std::string& key, const auto& figure) {
    for (const auto& [suffix, evaluation] : rankings) json[key + suffix] = figure(*evaluation);
  };
  json["images"] = verified.images;
  json["images_damaged"] = report.damaged;
  json["rows_with_loop"] = verified.rows_with_loop;
  add("recall_at_100_precision", [](const LoopEvaluation& e) { return e.recall_at_100_precision; });
  add("area_under_curve", [](const LoopEvaluation& e) { return e.area_under_curve; });
  add("best_f1", [](const LoopEvaluation& e) { return e.best_f1; });
  // The decision does not depend on how images are ranked.
  json["at_default_threshold"] = Rates(verified.at_default_threshold);
  json["at_default_threshold"]["threshold"] = run.options.loop_threshold;
  json["at_default_threshold_posterior"] = Rates(posterior.at_default_threshold);
  json["at_default_threshold_posterior"]["threshold"] = run.options.propose_threshold;
  json["f1_at_default"] = verified.f1_at_default;
  json["f1_at_default_posterior"] = posterior.f1_at_default;
  json["accepted"] = {
      {"true", verified.true_positives}, {"false", verified.false_positives}, {"ignored", verified.ignored}};
  json["second_word"] = {{"accepted", CountSecondWords(run, SecondWord::kAccepted)},
                         {"withdrawn", CountSecondWords(run, SecondWord::kWithdrawn)}};
  if (!run.truth.best_views.empty()) {
    add("recall_by_overlap", [](const LoopEvaluation& e) { return RecallParts(e.recall_by_overlap); });
    add("recall_by_angle_deg", [](const LoopEvaluation& e) { return RecallParts(e.recall_by_angle); });
  }
  add("calibration_error", CalibrationError);
  add("calibration_images", [](const LoopEvaluation& e) { return e.calibration_images; });
  json["ms_per_image"] = {{"median", report.ms_median}, {"p99", report.ms_p99}};
  json["stage_ms_median"] = Stages(run.rows);
  add("threshold_at_100_precision", [](const LoopEvaluation& e) { return e.threshold_at_100_precision; });
  add("reliability", Reliability);
  return json;
}

nlohmann::ordered_json ProtocolJson(const LoopRun& run) {
  return {
      {"image_folder", run.images},
      {"stride", run.stride},
      {"ground_truth", run.judged ? nlohmann::ordered_json(run.truth.description) : nlohmann::ordered_json()},
      {"tolerance_frames", 0},
      {"exclusion", "the newest " + std::to_string(run.options.stm_size) + " images (short-term memory)"},
      {"threshold",
       "recall_at_100_precision: chosen after the fact; at_default_threshold: fixed, of the probability; "
       "posterior: of H"}};
}

OutputLayout LoopsLayout(bool table) {
  const auto is_result = [](const std::filesystem::path& entry) {
    static const std::vector<std::string> kFiles = SplitText(
        "results.json hypotheses.csv loops.csv precision_recall.csv precision_recall.svg "
        "precision_recall.png confusion.png contact_sheet.png recall_by_view.csv recall_by_view.svg "
        "recall_by_view.png posteriors.csv earlier_loops.csv dump_candidates.csv dump_verification.csv "
        "table.json table.md table.csv",
        " ");
    return std::find(kFiles.begin(), kFiles.end(), entry.filename().string()) != kFiles.end();
  };
  const auto is_part = [](const std::filesystem::path& entry) {
    return std::filesystem::exists(entry / "results.json") || std::filesystem::exists(entry / "table.json");
  };
  return {is_result, table ? "table.json" : "results.json", "protocol", {}, is_part};
}

std::filesystem::path WriteLoopRun(const LoopRun& run, const LoopReport& report, bool finished,
                                   OutputFolder& folder) {
  using File = const std::filesystem::path&;
  nlohmann::ordered_json json = run.judged ? FiguresJson(run, report) : FoundJson(run, report);
  json["protocol"] = ProtocolJson(run);
  json["protocol"]["rule"] = RuleName(run.options);
  json["protocol"]["members"] = run.options.members;
  json["protocol"]["seed"] = run.options.seed;
  json["protocol"]["threads"] = run.options.threads;
  if (run.earlier > 0) json["earlier"] = {{"images", run.earlier}, {"loops", Count(run, IsEarlier)}};
  folder.Write({"results.json", [&](File file) { internal::WriteFile(file, JsonText(json)); }});
  folder.Write({"hypotheses.csv", [&](File file) { internal::WriteFile(file, Csv(run)); }});
  folder.Write({"loops.csv", [&](File file) { internal::WriteFile(file, FoundLoopsCsv(run)); }});
  if (run.judged) {
    const CurvePlot curves = PlotCurves(run, report);
    folder.Write({"precision_recall.csv", [&](File file) { WriteCurvesCsv(report, file); }});
    folder.Write({"precision_recall.svg", [&](File file) { WriteSvg(file, curves); }});
    folder.Write({"precision_recall.png", [&](File file) { WritePng(file, curves); }});
  }
  if (!run.truth.best_views.empty()) {
    const CurvePlot recall = PlotRecallByView(run, report);
    folder.Write({"recall_by_view.csv", [&](File file) { WriteRecallByViewCsv(report, file); }});
    folder.Write({"recall_by_view.svg", [&](File file) { WriteSvg(file, recall); }});
    folder.Write({"recall_by_view.png", [&](File file) { WritePng(file, recall); }});
  }
  folder.Write({"confusion.png", [&](File file) { WriteConfusion(run, report, file); }});
  folder.Write({"contact_sheet.png", [&](File file) { WriteContactSheet(run, report, file); }});
  if (run.earlier > 0)
    folder.Write({"earlier_loops.csv", [&](File file) { internal::WriteFile(file, EarlierLoopsCsv(run)); }});
  if (run.options.keep_posterior)
    folder.Write({"posteriors.csv", [&](File file) { WritePosteriors(run, file); }});
  std::filesystem::path where = folder.Finish(finished);
  ThrowFailures(folder.failures(), where);
  return where;
}

void PrintLoopRun(const LoopRun& run, const LoopReport& report, const std::filesystem::path& folder) {
  if (!run.judged) return PrintFound(run, report, folder);
  const LoopEvaluation &verified = report.verified, &ranked = report.ranked, &posterior = report.posterior;
  std::printf("%-34s %s\n", "rule", RuleName(run.options).c_str());
  std::printf("%-34s %d (%d with a loop)\n", "images", verified.images, verified.rows_with_loop);
  std::printf("%-34s %s\n", "ground truth", internal::Printable(run.truth.description).c_str());
  const auto line = [](const char* name, const std::vector<std::string>& cells) {
    std::printf("%-34s", name);
    for (const std::string& cell : cells) std::printf(" %12s", cell.c_str());
    std::printf("\n");
  };
  const auto ranking = [&](const char* name, double LoopEvaluation::*figure) {
    line(name, {Percent(verified.*figure), Percent(posterior.*figure), Percent(ranked.*figure)});
  };
  const PrecisionRecall &v = verified.at_default_threshold, &p = posterior.at_default_threshold;
  line("", {"verified", "posterior", "ranked"});
  ranking("recall at 100 % precision", &LoopEvaluation::recall_at_100_precision);
  ranking("area under the curve", &LoopEvaluation::area_under_curve);
  ranking("best F1", &LoopEvaluation::best_f1);
  line("precision at the default threshold", {Percent(v.precision), Percent(p.precision)});
  line("recall at the default threshold", {Percent(v.recall), Percent(p.recall)});
  line("F1 at the default threshold", {Percent(verified.f1_at_default), Percent(posterior.f1_at_default)});
  line("calibration error", {CalibrationText(verified), CalibrationText(posterior), CalibrationText(ranked)});
  line("  over n images",
       {std::to_string(verified.calibration_images), std::to_string(posterior.calibration_images),
        std::to_string(ranked.calibration_images)});
  std::printf("%-34s %d true, %d false, %d near misses (ignored pairs)\n", "accepted",
              verified.true_positives, verified.false_positives, verified.ignored);
  const std::ptrdiff_t late = CountSecondWords(run, SecondWord::kAccepted);
  const std::ptrdiff_t withdrawn = CountSecondWords(run, SecondWord::kWithdrawn);
  if (late + withdrawn > 0)
    std::printf("%-34s %td accepted, %td withdrawn\n", "  by the second word", late, withdrawn);
  PrintRecallByView(report);
  if (run.earlier > 0) {
    std::printf("%-34s %td images, into %lld\n", "loops into earlier runs", Count(run, IsEarlier),
                static_cast<long long>(run.earlier));
  }
  std::printf("%-34s %.1f median, %.1f p99\n", "ms per image", report.ms_median, report.ms_p99);
  std::printf(
      "written: %s, loops.csv, hypotheses.csv, precision_recall.{csv,svg,png}, confusion.png, "
      "contact_sheet.png\n",
      (folder / "results.json").string().c_str());
}

}  // namespace tutti::cli
