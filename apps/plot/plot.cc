#include "apps/plot/plot.h"

#include "apps/plot/plot_picture.h"

namespace tutti {
namespace {

template <typename Plot>
void WritePlotPng(const std::filesystem::path& file, const Plot& plot) {
  cv::Mat picture(kPlotHeight, kPlotWidth, CV_8UC3, cv::Scalar::all(255));
  DrawShapes(LayOut(plot), picture);
  WritePicture(file, picture);
}

}  // namespace

const char* PlotPalette(std::size_t k) {
  static constexpr const char* kColors[kPlotPaletteSize] = {"#0072b2", "#d55e00", "#009e73",
                                                            "#cc79a7", "#e69f00", "#56b4e9"};
  return kColors[k % kPlotPaletteSize];
}

void WriteSvg(const std::filesystem::path& file, const TrajectoryPlot& plot) {
  WriteSvg(file, LayOut(plot), kPlotWidth, kPlotHeight);
}

void WriteSvg(const std::filesystem::path& file, const CurvePlot& plot) {
  WriteSvg(file, LayOut(plot), kPlotWidth, kPlotHeight);
}

void WritePng(const std::filesystem::path& file, const TrajectoryPlot& plot) { WritePlotPng(file, plot); }

void WritePng(const std::filesystem::path& file, const CurvePlot& plot) { WritePlotPng(file, plot); }

}  // namespace tutti
