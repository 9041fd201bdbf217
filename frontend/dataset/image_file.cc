#include "frontend/dataset/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/replaced_file.h"
#include "frontend/dataset/layout.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

using Bytes = std::vector<unsigned char>;

// The bytes of a file, or what is wrong with it. Only regular files are opened: one waits at a pipe without
// end.
std::string ReadBytes(const fs::path& file, Bytes* bytes) {
  std::error_code code;
  const fs::file_status status = fs::status(file, code);
  if (status.type() == fs::file_type::not_found) return "is missing";
  std::ifstream in;
  if (fs::is_regular_file(status)) in.open(file, std::ios::binary | std::ios::ate);
  const std::streamoff size = in.is_open() ? std::streamoff(in.tellg()) : -1;
  if (size < 0) return "can't be read; check that it is a readable file";
  if (size > kMostImageBytes)
    return "is too large for an image (" + std::to_string(size / 1000000) + " MB; at most " +
           std::to_string(kMostImageBytes / 1000000) + " are read)";
  bytes->resize(static_cast<std::size_t>(size));
  in.seekg(0);
  if (size > 0 && !in.read(reinterpret_cast<char*>(bytes->data()), size)) return "can't be read in full";
  return {};
}

template <class Decode>
ImageFile Decoded(const fs::path& file, const Decode& decode) {
  ImageFile out;
  Bytes bytes;
  out.error = ReadBytes(file, &bytes);
  if (out.error.empty()) out = decode(bytes);
  if (!out.error.empty()) out.error = file.string() + ": " + out.error;
  return out;
}

ImageFile ReadPixels(const fs::path& file, int colour) {
  ImageFile out = ReadImageFile(file, colour | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  if (!out.error.empty()) return out;
  if (out.image.depth() != CV_8U && out.image.depth() != CV_16U) {
    out.error = file.string() + ": has pixels that are neither 8 nor 16 bit; convert it";
    out.image.release();
  }
  return out;
}

}  // namespace

ImageFile ReadGreyFile(const fs::path& file) { return ReadPixels(file, cv::IMREAD_GRAYSCALE); }
ImageFile ReadColourFile(const fs::path& file) { return ReadPixels(file, cv::IMREAD_COLOR); }
ImageFile ReadImageFile(const fs::path& file, int flags) {
  return Decoded(file, [&](const Bytes& bytes) { return DecodeImage(bytes, flags); });
}

ImageFile ReadDepthFile(const fs::path& file, bool float_in_png) {
  ImageFile out =
      file.extension() == ".npy" ? Decoded(file, DecodeNpy) : ReadImageFile(file, cv::IMREAD_UNCHANGED);
  if (!out.error.empty()) return out;
  if (float_in_png && out.image.type() == CV_8UC4)
    out.image = cv::Mat(out.image.rows, out.image.cols, CV_32FC1, out.image.data).clone();
  if (out.image.type() != CV_16UC1 && out.image.type() != CV_32FC1) {
    out.error = file.string() + ": is no depth image; one channel of 16 bit (or float) is needed";
    out.image.release();
  }
  return out;
}

void WritePngFile(const fs::path& file, const cv::Mat& image, const std::vector<int>& parameters) {
  Bytes bytes;
  cv::imencode(".png", image, bytes, parameters);
  internal::WriteFile(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

std::string SizeText(cv::Size size) { return std::to_string(size.width) + "x" + std::to_string(size.height); }

cv::Mat To8Bit(const cv::Mat& image, const GreyRange& range) {
  if (image.depth() == CV_8U) return image;
  cv::Mat out;
  const double scale = 256 / (range.white - range.black);
  image.convertTo(out, CV_8U, scale, -range.black * scale);
  return out;
}

cv::Mat ToColour(const cv::Mat& image) {
  if (image.channels() == 3) return image;
  cv::Mat out;
  cv::cvtColor(image, out, cv::COLOR_GRAY2BGR);
  return out;
}

GreyRange RangeOf(const std::vector<cv::Mat>& greys) {
  constexpr double kStray = 0.001;  // of the pixels: dead ones
  std::vector<std::size_t> pixels_with(65536);
  std::size_t pixels = 0;
  double greatest = 0;  // of the first image
  for (const cv::Mat& grey : greys) {
    if (grey.depth() != CV_16U || grey.channels() != 1) continue;
    if (pixels == 0) cv::minMaxLoc(grey, nullptr, &greatest);
    pixels += grey.total();
    for (int v = 0; v < grey.rows; ++v) {
      for (int u = 0; u < grey.cols; ++u) ++pixels_with[grey.at<unsigned short>(v, u)];
    }
  }
  GreyRange range;
  while (range.bits < 16 && greatest >= (1 << range.bits)) range.bits += 2;  // as sensors have them
  range.white = 1 << range.bits;
  if (range.bits == 8) return range;
  const auto stray = static_cast<std::size_t>(kStray * static_cast<double>(pixels));
  int low = 0, high = 65535;
  for (std::size_t n = pixels_with[0]; n <= stray; n += pixels_with[static_cast<std::size_t>(low)]) ++low;
  for (std::size_t n = pixels_with[65535]; n <= stray; n += pixels_with[static_cast<std::size_t>(high)])
    --high;
  const double used = std::max(high - low, 16);
  if (8 * used > range.white) return range;
  range.narrow = true;
  range.black = std::max(0.0, low - 0.5 * used);
  range.white = high + 0.5 * used;
  return range;
}

std::string RangeText(const GreyRange& range) {
  std::string text = "16-bit images, taken as " + std::to_string(range.bits) + "-bit and scaled to 8 bit";
  if (range.narrow)
    text = "16-bit images of a narrow range; " + std::to_string(std::lround(range.black)) + " to " +
           std::to_string(std::lround(range.white)) + " become 0 to 255";
  return text;
}

cv::Mat DepthInMetres(const cv::Mat& stored, double units_per_m, double max_depth_m) {
  cv::Mat depth;
  stored.convertTo(depth, CV_32F, 1.0 / units_per_m);
  const float limit = max_depth_m > 0 ? static_cast<float>(max_depth_m) : 1e6F;
  for (int v = 0; v < depth.rows; ++v) {
    float* row = depth.ptr<float>(v);
    for (int u = 0; u < depth.cols; ++u) {
      row[u] = ((row[u] > 0.0F) & (row[u] <= limit)) ? row[u] : 0.0F;  // without a jump: vectors
    }
  }
  return depth;
}

bool HasImageExtension(const fs::path& file) {
  static constexpr std::array<const char*, 15> kExtensions = {".png", ".jpg", ".jpeg", ".webp", ".bmp",
                                                              ".pgm", ".ppm", ".pnm",  ".tif",  ".tiff",
                                                              ".jp2", ".dib", ".jpe",  ".pbm",  ".exr"};
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

std::vector<fs::path> ListFiles(const fs::path& folder, const std::function<bool(const fs::path&)>& wanted) {
  std::vector<std::string> names;
  std::error_code code;
  for (fs::directory_iterator it(folder, code), end; !code && it != end; it.increment(code)) {
    std::string name = it->path().filename().string();
    if (name.front() == '.' || !wanted(it->path())) continue;
    if (!it->is_directory(code)) names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end(), NaturalLess);
  std::vector<fs::path> files;
  files.reserve(names.size());
  const internal::StampsOfNames found = StampsInNames({names.begin(), names.end()});
  if (found.stamps.size() == names.size()) {  // also below 0, and with more decimals or fewer
    for (const auto& stamp : found.stamps) files.push_back(folder / names[stamp.second]);
    return files;
  }
  for (const std::string& name : names) files.push_back(folder / name);
  return files;
}

internal::StampsOfNames StampsInNames(const std::vector<fs::path>& files) {
  std::vector<std::string> names;
  names.reserve(files.size());
  for (const fs::path& file : files) names.push_back(file.stem().string());
  return internal::FindStamps(names);
}

std::vector<fs::path> ListImages(const fs::path& folder) { return ListFiles(folder, HasImageExtension); }

std::optional<fs::path> ImagesOfDataset(const fs::path& folder) {
  for (const char* images : {"image_0", "image_2", "rgb", "mav0/cam0/data", "cam0/data", "color", "images"}) {
    if (!ListImages(folder / images).empty()) return folder / images;
  }
  const std::optional<FoundLayout> found = FindLayout(folder);
  if (!found || *found->layout->left.folder == '\0') return std::nullopt;
  return folder / found->layout->left.folder;
}

}  // namespace tutti
