#include "frontend/dataset/image_mask.h"

#include "frontend/dataset/image_file.h"
#include "frontend/dataset/rectified_rig.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

cv::Mat ReadMask(const fs::path& file) {
  const ImageFile read = ReadGreyFile(file);
  if (!read.error.empty()) throw InputError(read.error + " (the mask)");
  if (read.image.type() != CV_8UC1)
    throw InputError(file.string() + ": a mask has 8 bits a pixel, and this has 16; convert it");
  if (cv::countNonZero(read.image) == 0)
    throw InputError(file.string() +
                     ": this mask is 0 all over, so that nothing of the image is used; what is to be used "
                     "must be white");
  return read.image;
}

void CheckSize(const fs::path& file, const cv::Mat& mask, cv::Size size) {
  if (mask.size() == size) return;
  throw InputError(file.string() + ": the mask has " + SizeText(mask.size()) +
                   " pixels, but the images have " + SizeText(size) +
                   "; it must be as large as the images are stored, before any turn or rectification");
}

}  // namespace

ImageMasks::ImageMasks(const fs::path& file_or_folder) : path_(file_or_folder) {
  std::error_code code;
  if (!fs::exists(path_, code))
    throw InputError(path_.string() + ": does not exist; a mask is an image, or a folder with one an image");
  if (!fs::is_directory(path_, code)) {
    single_ = ReadMask(path_);
    return;
  }
  for (const fs::path& file : ListImages(path_)) files_.emplace(file.stem().string(), file);
  if (files_.empty())
    throw InputError(path_.string() +
                     ": holds no masks; they are images with the names of those that they belong to");
}

cv::Mat ImageMasks::Of(const std::string& stem, cv::Size size) const {
  if (!PerImage()) return OfAll(size);
  const auto found = files_.find(stem);
  if (found == files_.end()) return {};
  cv::Mat mask = ReadMask(found->second);
  CheckSize(found->second, mask, size);
  return mask;
}

cv::Mat ImageMasks::OfAll(cv::Size size) const {
  if (PerImage())
    throw InputError(
        path_.string() +
        ": is a folder of masks, but these images have no names to find theirs by; give one mask "
        "for all, or take the frames out into a folder of images");
  CheckSize(path_, single_, size);
  return single_;
}

cv::Mat MaskOfAll(const DatasetOptions& options, cv::Size size, const std::optional<Rectifier>& rectifier) {
  if (options.mask.empty()) return {};
  return Rectified(rectifier, ImageMasks(options.mask).OfAll(size), Sampling::kNearest);
}

}  // namespace tutti
