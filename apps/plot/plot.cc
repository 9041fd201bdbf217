#include "apps/plot/plot.h"

#include <array>

#include "apps/plot/plot_picture.h"

namespace tutti {
const char* PlotPalette(std::size_t k) {
  static constexpr const char* kColors[kPlotPaletteSize] = {"#0072b2", "#d55e00", "#009e73",
                                                            "#cc79a7", "#e69f00", "#56b4e9"};
  return kColors[k % kPlotPaletteSize];
}

const char* SessionColor(std::size_t k) {
  static constexpr std::array kColors = {"#cc79a7", "#56b4e9", "#8f7d2f", "#999999", "#7a5195", "#5a9a8f"};
  return kColors[k % kColors.size()];
}

void WriteSvg(const std::filesystem::path& file, const TrajectoryPlot& plot) {
  WritePlot(file, PlotFormat::kSvg, LayOut(plot));
}

void WriteSvg(const std::filesystem::path& file, const CurvePlot& plot) {
  WritePlot(file, PlotFormat::kSvg, LayOut(plot));
}

void WritePng(const std::filesystem::path& file, const TrajectoryPlot& plot) {
  WritePlot(file, PlotFormat::kPng, LayOut(plot));
}

void WritePng(const std::filesystem::path& file, const CurvePlot& plot) {
  WritePlot(file, PlotFormat::kPng, LayOut(plot));
}

}  // namespace tutti
