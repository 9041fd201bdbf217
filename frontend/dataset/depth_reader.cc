#include "frontend/dataset/depth_reader.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "frontend/dataset/image_file.h"
#include "frontend/dataset/rectified_rig.h"

namespace tutti {
namespace {

constexpr double kTumUnits = 5000;

// For each of `count` pixels the pixel of the depth image that looks the same way.
std::vector<int> PixelsOfDepth(int count, double f, double c, double f_depth, double c_depth) {
  std::vector<int> pixels(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    pixels[static_cast<std::size_t>(i)] =
        static_cast<int>(std::lround(std::clamp((i - c) / f * f_depth + c_depth, -1e6, 1e6)));
  return pixels;
}

}  // namespace

double DepthUnits(const DatasetOptions& options, double of_layout) {
  if (options.depth_units_per_m > 0) return options.depth_units_per_m;
  return of_layout > 0 ? of_layout : kTumUnits;
}

// To the images' size, if it is known how.
bool DepthReader::Resample(cv::Mat& depth) const {
  PinholeCamera from = colour_.value_or(PinholeCamera());
  if (from.fx <= 0) from.fx = from.fy = 1;  // the same for both
  const double width = double(depth.cols) / size_.width, height = double(depth.rows) / size_.height;
  PinholeCamera to;
  if (format_.camera) {
    to = *format_.camera;
  } else if (format_.same_view && std::abs(width / height - 1) < 0.02) {
    to.fx = width * from.fx, to.cx = width * (from.cx + 0.5) - 0.5;
    to.fy = height * from.fy, to.cy = height * (from.cy + 0.5) - 0.5;
  } else {
    return false;
  }
  const std::vector<int> columns = PixelsOfDepth(size_.width, from.fx, from.cx, to.fx, to.cx);
  const std::vector<int> rows = PixelsOfDepth(size_.height, from.fy, from.cy, to.fy, to.cy);
  cv::Mat out = cv::Mat::zeros(size_, CV_32FC1);
  for (int v = 0; v < out.rows; ++v) {
    const int row = rows[static_cast<std::size_t>(v)];
    if (row < 0 || row >= depth.rows) continue;
    for (int u = 0; u < out.cols; ++u) {
      const int column = columns[static_cast<std::size_t>(u)];
      if (column >= 0 && column < depth.cols) out.at<float>(v, u) = depth.at<float>(row, column);
    }
  }
  depth = out;
  return true;
}

std::string DepthReader::Read(const std::filesystem::path& file, const std::optional<Rectifier>& rectifier,
                              cv::Mat& metres) const {
  const ImageFile read = ReadDepthFile(file, format_.float_in_png);
  if (!read.error.empty()) return read.error;
  const bool metres_as_stored = options_.depth_units_per_m <= 0 && read.image.depth() == CV_32F;
  const double units = metres_as_stored ? 1 : DepthUnits(options_, format_.units_per_m);
  cv::Mat depth = DepthInMetres(read.image, units, options_.max_depth_m);
  constexpr double kMillimetres = 1000;  // 65.535 m is what a Kinect's driver writes for "none"
  if (read.image.type() == CV_16UC1 && format_.units_per_m == kMillimetres)
    depth.setTo(0, read.image == std::numeric_limits<unsigned short>::max());
  if (depth.size() != size_ && !Resample(depth))
    return file.string() + ": the depth image has " + SizeText(depth.size()) +
           " pixels, but the colour images have " + SizeText(size_) + "; depth must be registered to colour";
  metres = Rectified(rectifier, depth, Sampling::kNearest);
  return {};
}

std::vector<std::string> DepthReader::Notes(const std::filesystem::path& first) const {
  if (options_.depth_units_per_m > 0 || format_.units_per_m > 0) return {};
  const ImageFile read = ReadDepthFile(first);
  if (read.image.depth() == CV_32F) return {};
  std::string middle;
  std::vector<unsigned short> values;
  for (int v = 0; v < read.image.rows; ++v) {
    for (int u = 0; u < read.image.cols; ++u) {
      const auto value = read.image.at<unsigned short>(v, u);
      if (value > 0) values.push_back(value);
    }
  }
  if (!values.empty()) {
    const auto median = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), median, values.end());
    char text[120];
    std::snprintf(text, sizeof text, "; the median of the first image is %.2f m (%.2f m in millimetres)",
                  *median / kTumUnits, *median / 1000.0);
    middle = text;
  }
  return {first.parent_path().string() +
          ": nothing says the unit of the depth images; 5000 a metre is assumed, " + "as TUM has it" +
          middle +
          ". With the wrong unit, the whole map has the wrong scale: --set dataset.depth_units_per_m=1000 is "
          "for millimetres"};
}

}  // namespace tutti
