// Reads depth images: unit, size, rectification.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "frontend/features/rectifier.h"
#include "tutti/frontend/dataset.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti {

/// What a layout says of its depth images.
struct DepthFormat {
  double units_per_m = 0;               ///< 0: not known
  std::optional<PinholeCamera> camera;  ///< of another size than the colour images, and of the same centre
  bool same_view = false;               ///< they may be smaller, of the same view
  bool float_in_png = false;            ///< the four bytes of a pixel are a float
};

/// Value of one metre in depth images of 16 bit: what the options say, else the layout, else 5000, as TUM has
/// it. Floats are metres where the options say nothing.
double DepthUnits(const DatasetOptions& options, double of_layout);

/// Depth images that belong to images of one size. Thread-safe.
class DepthReader {
 public:
  /// `colour`: the images' camera as calibrated, if known; `size`: of the images, as they are stored.
  DepthReader(const DatasetOptions& options, const DepthFormat& format,
              const std::optional<PinholeCamera>& colour, cv::Size size)
      : options_(options), format_(format), colour_(colour), size_(size) {}

  /// Empty, and `metres` of the images' size (0: no measurement, CV_32FC1); or what is wrong with the file.
  std::string Read(const std::filesystem::path& file, const std::optional<Rectifier>& rectifier,
                   cv::Mat& metres) const;
  /// What is to be said where nothing says the unit; `first`: a depth image.
  std::vector<std::string> Notes(const std::filesystem::path& first) const;

 private:
  bool Resample(cv::Mat& depth) const;

  DatasetOptions options_;
  DepthFormat format_;
  std::optional<PinholeCamera> colour_;
  cv::Size size_;
};

}  // namespace tutti
#pragma GCC visibility pop
