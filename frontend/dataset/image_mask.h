// Which parts of images are used.
#pragma once

#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "frontend/features/rectifier.h"
#include "tutti/frontend/dataset.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti {

/// A mask for all images, or a folder with a mask for each. Masks are CV_8UC1; the image is used where they
/// are not 0. Immutable after construction, so it may be used from several threads.
class ImageMasks {
 public:
  /// Throws InputError that names the file for a missing or unreadable one, for a mask that is black all
  /// over, and for a folder without images.
  explicit ImageMasks(const std::filesystem::path& file_or_folder);

  bool PerImage() const { return single_.empty(); }  ///< a mask for each image
  bool Has(const std::string& stem) const { return !PerImage() || files_.count(stem) > 0; }
  /// The mask of an image, by its name without extension; empty if there is none for it. Throws InputError
  /// that names the file for one of another size than the image's, one that can't be read, and one that is
  /// black all over.
  cv::Mat Of(const std::string& stem, cv::Size size) const;
  /// The one mask for all images that have this size. Throws InputError as Of does, and for a folder.
  cv::Mat OfAll(cv::Size size) const;

 private:
  std::filesystem::path path_;
  cv::Mat single_;                                      // empty: per image
  std::map<std::string, std::filesystem::path> files_;  // by the name without extension
};

/// options.mask, which must be one for all images, rectified; empty if there is none. Throws InputError.
cv::Mat MaskOfAll(const DatasetOptions& options, cv::Size size, const std::optional<Rectifier>& rectifier);

}  // namespace tutti
#pragma GCC visibility pop
