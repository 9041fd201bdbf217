// Pictures of `tutti loops`. Colours that the colour-blind can tell apart (Okabe and Ito), and marks that
// differ in shape as well.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "apps/plot/plot.h"
#include "apps/tutti/loops/loops_output.h"

namespace tutti::cli {

constexpr const char* kTrueColor = "#0072b2";    // blue
constexpr const char* kFalseColor = "#d55e00";   // vermilion
constexpr const char* kMissedColor = "#e69f00";  // orange

/// Adds one result's kept posterior to a picture of `images` x `images`, scaled down where that is too large.
void AddPosterior(const LoopResult& result, int images, cv::Mat& posterior);

/// The curves of precision over recall: precision_recall.csv, and the picture.
void WriteCurvesCsv(const LoopReport& report, const std::filesystem::path& file);
CurvePlot PlotCurves(const LoopRun& run, const LoopReport& report);

/// Ground truth by overlap: recall over the overlap and the angle of the earlier view that shares most.
void WriteRecallByViewCsv(const LoopReport& report, const std::filesystem::path& file);
CurvePlot PlotRecallByView(const LoopRun& run, const LoopReport& report);

/// Ground truth, posterior and what was said, side by side.
void WriteConfusion(const LoopRun& run, const LoopReport& report, const std::filesystem::path& file);

/// Every false positive and every missed loop, up to a stated number: the image, what was proposed, and what
/// the ground truth says. Reads the images again.
void WriteContactSheet(const LoopRun& run, const LoopReport& report, const std::filesystem::path& file);

/// "mean, 84 images of corridor, 44 with a loop", for titles.
std::string RunTitle(const LoopRun& run, const LoopReport& report);

}  // namespace tutti::cli
