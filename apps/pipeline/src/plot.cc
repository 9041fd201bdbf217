#include "tutti/pipeline/plot.h"

#include "plot_layout.h"

namespace tutti {
namespace {

template <typename Plot>
void WritePlotPng(const std::filesystem::path& file, const Plot& plot) {
  cv::Mat picture(kPlotHeight, kPlotWidth, CV_8UC3, cv::Scalar::all(255));
  DrawShapes(LayOut(plot), picture);
  WritePicture(file, picture);
}

}  // namespace

void WriteSvg(const std::filesystem::path& file, const TrajectoryPlot& plot) {
  WriteSvg(file, LayOut(plot), kPlotWidth, kPlotHeight);
}

void WriteSvg(const std::filesystem::path& file, const CurvePlot& plot) {
  WriteSvg(file, LayOut(plot), kPlotWidth, kPlotHeight);
}

void WritePng(const std::filesystem::path& file, const TrajectoryPlot& plot) { WritePlotPng(file, plot); }

void WritePng(const std::filesystem::path& file, const CurvePlot& plot) { WritePlotPng(file, plot); }

}  // namespace tutti
