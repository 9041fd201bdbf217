// The shapes of a plot as pixels and as files: SVG, PNG and PDF, all drawn by Cairo.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "apps/plot/plot_shapes.h"

namespace tutti {

enum class PlotFormat { kSvg, kPng, kPdf };

/// How texts look.
struct PlotFont {
  std::string family =
      "sans-serif";  ///< as fontconfig knows it: "Times New Roman", "serif"; unknown: the nearest
  double scale = 1;  ///< of all heights
};

/// The format of a file's ending. Throws InputError if it is none of .svg, .png and .pdf.
PlotFormat PlotFormatOf(const std::filesystem::path& file);

/// Writes a page of kPlotWidth x kPlotHeight (PDF: points of 1/72 inch), whatever the file's name; the same
/// bytes from the same shapes. Texts of an SVG are outlines, which look the same everywhere; they can be read
/// in its <desc>, a line each. Throws InputError if the file can't be written in full.
void WritePlot(const std::filesystem::path& file, PlotFormat format, const std::vector<PlotShape>& shapes,
               const PlotFont& font = {});

/// Draws over a CV_8UC3 (BGR) picture.
void DrawShapes(const std::vector<PlotShape>& shapes, cv::Mat& picture);

/// Width of a text that DrawShapes draws [px].
double TextWidth(const std::string& text, double height);

/// #rrggbb as BGR; black if it is none.
cv::Scalar PlotColor(const std::string& hex);

/// The picture (CV_8UC3, BGR) as a PNG file, whatever its name. Throws InputError if it can't be written in
/// full.
void WritePicture(const std::filesystem::path& file, const cv::Mat& picture);

}  // namespace tutti
