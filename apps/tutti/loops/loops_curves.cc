// Precision-recall curves of `tutti loops`.
#include <utility>

#include "apps/plot/plot.h"
#include "apps/tutti/loops/loops_output.h"
#include "apps/tutti/text_table.h"
#include "core/replaced_file.h"

namespace tutti::cli {
namespace {

void AppendCsv(const char* name, const LoopEvaluation& evaluation, std::string& csv) {
  for (const PrecisionRecall& p : evaluation.curve) {
    csv += Formatted("%s,%.9g,%d,%.9g,%.9g,%d,%d\n", name, p.threshold, p.rejected ? 1 : 0, p.precision,
                     p.recall, p.true_positives, p.false_positives);
  }
}

// Steps, as the area under the curve is computed: each growth of recall has the precision that it ends at.
PlotCurve Curve(const char* name, const LoopEvaluation& evaluation) {
  PlotCurve curve;
  double recall_before = 0;
  for (const PrecisionRecall& p : evaluation.curve) {
    curve.points.emplace_back(recall_before, p.precision);
    curve.points.emplace_back(p.recall, p.precision);
    recall_before = p.recall;
  }
  if (evaluation.true_positives + evaluation.false_positives > 0)
    curve.marks.emplace_back(evaluation.at_default_threshold.recall,
                             evaluation.at_default_threshold.precision);
  curve.name = Formatted("%s: recall %.1f %% at 100 %% precision, area %.3f", name,
                         100 * evaluation.recall_at_100_precision, evaluation.area_under_curve);
  return curve;
}

void AppendRecallCsv(const char* decision, const char* over, const std::vector<RecallPart>& parts,
                     std::string& csv) {
  for (const RecallPart& p : parts) {
    csv += Formatted("%s,%s,%.9g,%.9g,%d,%d,%d\n", decision, over, p.from, p.to, p.rows, p.found,
                     p.found_at_100_precision);
  }
}

PlotCurve RecallCurve(const char* name, const LoopEvaluation& evaluation,
                      double (RecallPart::*recall)() const) {
  PlotCurve curve;
  curve.name = name;
  for (const RecallPart& p : evaluation.recall_by_overlap) {
    if (p.rows > 0) curve.points.emplace_back(p.from, (p.*recall)());
  }
  curve.marks = curve.points;
  return curve;
}

}  // namespace

std::string RunTitle(const LoopRun& run, const LoopReport& report) {
  std::filesystem::path folder(run.images);
  if (!folder.has_filename()) folder = folder.parent_path();
  std::string name = folder.filename().string();
  if (folder.has_parent_path() && folder.parent_path().has_filename())
    name = folder.parent_path().filename().string() + "/" + name;
  std::string text =
      RuleName(run.options) + ", " + std::to_string(report.verified.images) + " images of " + name;
  if (run.stride > 1) text += " (stride " + std::to_string(run.stride) + ")";
  if (!run.judged) return text;
  return text + ", " + std::to_string(report.verified.rows_with_loop) + " with a loop";
}

void WriteCurvesCsv(const LoopReport& report, const std::filesystem::path& file) {
  std::string csv = "curve,threshold,rejected,precision,recall,true_positives,false_positives\n";
  AppendCsv("verified", report.verified, csv);
  AppendCsv("ranked", report.ranked, csv);
  AppendCsv("posterior", report.posterior, csv);
  internal::WriteFile(file, csv);
}

CurvePlot PlotCurves(const LoopRun& run, const LoopReport& report) {
  CurvePlot plot;
  plot.title = RunTitle(run, report);
  plot.x_name = "recall";
  plot.y_name = "precision";
  // The dashes lie over the broad line, so that both are seen where they run together.
  PlotCurve verified = Curve("with verification", report.verified);
  verified.color = kTrueColor;
  verified.width = 5;
  PlotCurve posterior = Curve("posterior only", report.posterior);
  posterior.color = kMissedColor;
  posterior.dashed = true;
  PlotCurve ranked = Curve("refused images ranked behind", report.ranked);
  ranked.color = PlotPalette(2);
  ranked.marks.clear();  // the decision is that of the verified ones
  plot.curves = {verified, ranked, posterior};
  plot.notes.push_back(Formatted("disc: at the default, probability >= %g (posterior only: H >= %g)",
                                 run.options.loop_threshold, run.options.propose_threshold));
  if (report.verified.rows_with_loop == 0)
    plot.notes.push_back("the ground truth has no loop: recall is 0 by definition");
  if (report.ranked.curve.empty() && report.posterior.curve.empty())
    plot.notes.push_back("no image has a hypothesis: the curves are empty");
  return plot;
}

void WriteRecallByViewCsv(const LoopReport& report, const std::filesystem::path& file) {
  std::string csv = "decision,over,from,to,images,found,found_at_100_precision\n";
  for (const auto& [name, evaluation] :
       {std::make_pair("verified", &report.verified), std::make_pair("posterior", &report.posterior)}) {
    AppendRecallCsv(name, "overlap", evaluation->recall_by_overlap, csv);
    AppendRecallCsv(name, "angle_deg", evaluation->recall_by_angle, csv);
  }
  internal::WriteFile(file, csv);
}

CurvePlot PlotRecallByView(const LoopRun& run, const LoopReport& report) {
  CurvePlot plot;
  plot.title = RunTitle(run, report);
  plot.x_name = "overlap of the earlier view that shares most, at least";
  plot.y_name = "recall";
  PlotCurve accepted = RecallCurve("accepted", report.verified, &RecallPart::Recall);
  accepted.color = kTrueColor;
  accepted.width = 5;
  PlotCurve sure = RecallCurve("at 100 % precision", report.verified, &RecallPart::RecallAt100Precision);
  sure.color = PlotPalette(2);
  PlotCurve posterior = RecallCurve("proposed, right place first", report.posterior, &RecallPart::Recall);
  posterior.color = kMissedColor;
  posterior.dashed = true;
  plot.curves = {accepted, sure, posterior};
  std::string angles = "accepted, by the angle to that view:";
  for (const RecallPart& part : report.verified.recall_by_angle) {
    if (part.rows == 0) continue;
    angles += Formatted(" %g to %g deg: %d of %d;", part.from, part.to, part.found, part.rows);
  }
  plot.notes.push_back(angles.substr(0, angles.size() - 1));
  return plot;
}

}  // namespace tutti::cli
