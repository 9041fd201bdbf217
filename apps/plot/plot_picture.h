// The shapes of a plot as pixels, and PNG files.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "apps/plot/plot_shapes.h"

namespace tutti {

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
