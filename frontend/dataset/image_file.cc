#include "frontend/dataset/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/replaced_file.h"
#include "frontend/dataset/image_size.h"
#include "frontend/dataset/layout.h"
#include "frontend/dataset/npy_file.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

using Bytes = std::vector<unsigned char>;

std::uint32_t BigEndian(const Bytes& b, std::size_t at) {
  return (std::uint32_t{b[at]} << 24) | (std::uint32_t{b[at + 1]} << 16) | (std::uint32_t{b[at + 2]} << 8) |
         b[at + 3];
}

std::uint32_t LittleEndian(const Bytes& b, std::size_t at) {
  return (std::uint32_t{b[at + 3]} << 24) | (std::uint32_t{b[at + 2]} << 16) |
         (std::uint32_t{b[at + 1]} << 8) | b[at];
}

// PNG: chunks of (length, type, data, checksum) up to IEND.
bool PngIsComplete(const Bytes& b) {
  std::size_t at = 8;
  while (at + 12 <= b.size()) {
    const std::size_t length = BigEndian(b, at);
    if (std::memcmp(&b[at + 4], "IEND", 4) == 0) return true;
    at += 12 + length;
  }
  return false;
}

// JPEG: segments up to the first scan (SOS), then coded data in which a true FF D9 can only be the end of the
// image. An embedded thumbnail's own end lies before the first scan.
bool JpegIsComplete(const Bytes& b) {
  std::size_t at = 2;
  while (at + 4 <= b.size()) {
    if (b[at] != 0xFF) return false;
    const unsigned char marker = b[at + 1];
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    if (marker == 0xDA) break;
    at += 2 + ((std::size_t{b[at + 2]} << 8) | b[at + 3]);
  }
  for (std::size_t i = b.size(); i-- > at + 1;) {
    if (b[i] == 0xD9 && b[i - 1] == 0xFF) return true;
  }
  return false;
}

// A few bytes may claim any size.
std::string TooLarge(const Bytes& b) {
  const std::optional<ClaimedSize> size = SizeInHeader(b);
  if (!size || size->width == 0 || size->height <= kMostImagePixels / size->width) return {};
  return "says that it has " + std::to_string(size->width) + " x " + std::to_string(size->height) +
         " pixels; at most " + std::to_string(kMostImagePixels / 1000000) + " million are read";
}

// What is wrong with the bytes of an image file; empty if nothing is seen from outside.
std::string Damage(const Bytes& b) {
  if (b.empty()) return "is empty (0 bytes)";
  std::string too_large = TooLarge(b);
  if (!too_large.empty()) return too_large;
  const auto starts = [&](const char* magic, std::size_t size, std::size_t at = 0) {
    return b.size() >= at + size && std::memcmp(b.data() + at, magic, size) == 0;
  };
  bool complete = true;
  if (starts("\x89PNG\r\n\x1a\n", 8)) {
    complete = PngIsComplete(b);
  } else if (starts("\xFF\xD8", 2)) {
    complete = JpegIsComplete(b);
  } else if (starts("RIFF", 4) && starts("WEBP", 4, 8)) {
    complete = b.size() >= std::size_t{LittleEndian(b, 4)} + 8;
  } else if (starts("BM", 2) && b.size() >= 6) {
    complete = b.size() >= LittleEndian(b, 2);
  }
  return complete ? std::string() : "is truncated (it ends after " + std::to_string(b.size()) + " bytes)";
}

ImageFile Decode(const std::filesystem::path& file, int flags) {
  ImageFile out;
  std::error_code code;
  const std::filesystem::file_status status = std::filesystem::status(file, code);
  if (status.type() == std::filesystem::file_type::not_found) {
    out.error = file.string() + ": is missing";
    return out;
  }
  // Nothing else is opened: one waits at a pipe without end.
  std::ifstream in;
  if (std::filesystem::is_regular_file(status)) in.open(file, std::ios::binary | std::ios::ate);
  const std::streamoff size = in.is_open() ? std::streamoff(in.tellg()) : -1;
  if (size < 0) {
    out.error = file.string() + ": can't be read; check that it is a readable file";
    return out;
  }
  if (size > kMostImageBytes) {
    out.error = file.string() + ": is too large for an image (" + std::to_string(size / 1000000) +
                " MB; at most " + std::to_string(kMostImageBytes / 1000000) + " are read)";
    return out;
  }
  Bytes bytes(static_cast<std::size_t>(size));
  in.seekg(0);
  if (size > 0 && !in.read(reinterpret_cast<char*>(bytes.data()), size)) {
    out.error = file.string() + ": can't be read in full";
    return out;
  }
  out = DecodeImage(bytes, flags);
  if (!out.error.empty()) out.error = file.string() + ": " + out.error;
  return out;
}

ImageFile ReadPixels(const std::filesystem::path& file, int colour) {
  ImageFile out = Decode(file, colour | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  if (!out.error.empty()) return out;
  if (out.image.depth() != CV_8U && out.image.depth() != CV_16U) {
    out.error = file.string() + ": has pixels that are neither 8 nor 16 bit; convert it";
    out.image.release();
  }
  return out;
}

}  // namespace

ImageFile DecodeImage(const std::vector<unsigned char>& bytes, int flags) {
  ImageFile out;
  out.error = Damage(bytes);
  if (!out.error.empty()) return out;
  try {
    out.image = cv::imdecode(bytes, flags);
  } catch (const cv::Exception&) {
    out.image.release();
  }
  if (out.image.empty()) out.error = "is damaged or not an image that OpenCV can decode";
  return out;
}

ImageFile ReadGreyFile(const std::filesystem::path& file) { return ReadPixels(file, cv::IMREAD_GRAYSCALE); }
ImageFile ReadColourFile(const std::filesystem::path& file) { return ReadPixels(file, cv::IMREAD_COLOR); }
ImageFile ReadImageFile(const std::filesystem::path& file, int flags) { return Decode(file, flags); }

ImageFile ReadDepthFile(const std::filesystem::path& file, bool float_in_png) {
  ImageFile out = file.extension() == ".npy" ? ReadNpyFile(file) : Decode(file, cv::IMREAD_UNCHANGED);
  if (!out.error.empty()) return out;
  if (float_in_png && out.image.type() == CV_8UC4)
    out.image = cv::Mat(out.image.rows, out.image.cols, CV_32FC1, out.image.data).clone();
  if (out.image.type() != CV_16UC1 && out.image.type() != CV_32FC1) {
    out.error = file.string() + ": is no depth image; one channel of 16 bit (or float) is needed";
    out.image.release();
  }
  return out;
}

void WritePngFile(const std::filesystem::path& file, const cv::Mat& image,
                  const std::vector<int>& parameters) {
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

bool HasImageExtension(const std::filesystem::path& file) {
  static constexpr std::array<const char*, 15> kExtensions = {".png", ".jpg", ".jpeg", ".webp", ".bmp",
                                                              ".pgm", ".ppm", ".pnm",  ".tif",  ".tiff",
                                                              ".jp2", ".dib", ".jpe",  ".pbm",  ".exr"};
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

std::vector<std::filesystem::path> ListFiles(
    const std::filesystem::path& folder, const std::function<bool(const std::filesystem::path&)>& wanted) {
  std::vector<std::string> names;
  std::error_code code;
  for (std::filesystem::directory_iterator it(folder, code), end; !code && it != end; it.increment(code)) {
    std::string name = it->path().filename().string();
    if (name.front() == '.' || !wanted(it->path())) continue;
    if (!it->is_directory(code)) names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end(), NaturalLess);
  std::vector<std::filesystem::path> files;
  files.reserve(names.size());
  const internal::StampsOfNames found = StampsInNames({names.begin(), names.end()});
  if (found.stamps.size() == names.size()) {  // also below 0, and with more decimals or fewer
    for (const auto& stamp : found.stamps) files.push_back(folder / names[stamp.second]);
    return files;
  }
  for (const std::string& name : names) files.push_back(folder / name);
  return files;
}

internal::StampsOfNames StampsInNames(const std::vector<std::filesystem::path>& files) {
  std::vector<std::string> names;
  names.reserve(files.size());
  for (const std::filesystem::path& file : files) names.push_back(file.stem().string());
  return internal::FindStamps(names);
}

std::vector<std::filesystem::path> ListImages(const std::filesystem::path& folder) {
  return ListFiles(folder, HasImageExtension);
}

std::optional<std::filesystem::path> ImagesOfDataset(const std::filesystem::path& folder) {
  for (const char* images : {"image_0", "image_2", "rgb", "mav0/cam0/data", "cam0/data", "color", "images"}) {
    if (!ListImages(folder / images).empty()) return folder / images;
  }
  const std::optional<FoundLayout> found = FindLayout(folder);
  if (!found || *found->layout->left.folder == '\0') return std::nullopt;
  return folder / found->layout->left.folder;
}

}  // namespace tutti
