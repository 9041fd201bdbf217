// PNG by libpng: OpenCV's image writer loads 120 libraries when a program starts.
#include <png.h>

#include <opencv2/core.hpp>

#include "apps/plot/plot_picture.h"
#include "tutti/core/error.h"

namespace tutti {

void WritePicture(const std::filesystem::path& file, const cv::Mat& picture) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.cols);
  image.height = static_cast<png_uint_32>(picture.rows);
  image.format = PNG_FORMAT_BGR;
  const auto row_bytes = static_cast<png_int_32>(picture.step);
  if (png_image_write_to_file(&image, file.c_str(), 0, picture.data, row_bytes, nullptr) != 0) return;
  throw InputError(file.string() + ": can't be written (" + image.message +
                   "); check that the folder is writable and not full");
}

}  // namespace tutti
