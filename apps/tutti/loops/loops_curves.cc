// Precision-recall curves of `tutti loops`.
#include <cstdio>

#include "apps/plot/plot.h"
#include "apps/tutti/loops/loops_pictures.h"
#include "core/replaced_file.h"

namespace tutti::cli {
namespace {

std::string Percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f %%", 100 * share);
  return text;
}

void AppendCsv(const char* name, const LoopEvaluation& evaluation, std::string& csv) {
  for (const PrecisionRecall& p : evaluation.curve) {
    char line[160];
    std::snprintf(line, sizeof line, "%s,%.9g,%d,%.9g,%.9g,%d,%d\n", name, p.threshold, p.rejected ? 1 : 0,
                  p.precision, p.recall, p.true_positives, p.false_positives);
    csv += line;
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
  char area[32];
  std::snprintf(area, sizeof area, "%.3f", evaluation.area_under_curve);
  curve.name = std::string(name) + ": recall " + Percent(evaluation.recall_at_100_precision) +
               " at 100 % precision, area " + area;
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
  char note[120];
  std::snprintf(note, sizeof note, "disc: at the default, probability >= %g (posterior only: H >= %g)",
                run.options.loop_threshold, run.options.propose_threshold);
  plot.notes.push_back(note);
  if (report.verified.rows_with_loop == 0)
    plot.notes.push_back("the ground truth has no loop: recall is 0 by definition");
  if (report.ranked.curve.empty() && report.posterior.curve.empty())
    plot.notes.push_back("no image has a hypothesis: the curves are empty");
  return plot;
}

}  // namespace tutti::cli
