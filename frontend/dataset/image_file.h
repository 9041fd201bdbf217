// Reads image files without trusting them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/time_stamps.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti {

/// An image, or what is wrong with the file (`error` is empty if there is an image).
struct ImageFile {
  cv::Mat image;
  std::string error;
};

/// What pixels become: one channel, three with blue first, both of 8 or 16 bit; or nothing else (depth).
enum class Pixels { kGrey, kColour, kStored };

/// More is no image of a camera; memory and time to read one have a bound: 16-bit colour needs 6 bytes a
/// pixel.
constexpr std::uint64_t kMostImagePixels = 1ULL << 27;  // 134 million, 11585 x 11585
constexpr std::int64_t kMostImageBytes = 1000000000;    // of the file

/// Reads an image in grey, 8 or 16 bit as stored. Decoders fill the missing part of a truncated JPEG, PNG or
/// WebP with grey without a word, so the ends of these are checked first. Never throws; thread-safe.
ImageFile ReadGreyFile(const std::filesystem::path& file);
/// Gives 3 channels, blue first.
ImageFile ReadColourFile(const std::filesystem::path& file);
/// Gives what cv::imread does with these flags.
ImageFile ReadImageFile(const std::filesystem::path& file, int flags);
/// Decodes the bytes of such a file; messages do not name it.
ImageFile DecodeImage(const std::vector<unsigned char>& bytes, int flags);
/// NumPy's array (.npy), a depth image: of two dimensions (or three, of which one is 1) in C order. float16,
/// float32 and float64 become CV_32FC1, uint16 CV_16UC1.
ImageFile DecodeNpy(const std::vector<unsigned char>& bytes);

/// How large an image says it is, without decoding it.
struct ClaimedSize {
  std::uint64_t width = 0, height = 0;  ///< [px]
};
/// From the header of PNG, JPEG, BMP, PNM, TIFF, WebP (extended) and JPEG 2000; nothing of other bytes, or
/// where the header is cut off.
std::optional<ClaimedSize> SizeInHeader(const std::vector<unsigned char>& bytes);

/// Reads a depth image as stored: one channel of 16 bit or float, of an image file or NumPy's.
/// `float_in_png`: 4 channels of 8 bit are a float.
ImageFile ReadDepthFile(const std::filesystem::path& file, bool float_in_png = false);

/// Writes an image as a PNG file, as cv::imwrite does with these parameters. Throws InputError.
void WritePngFile(const std::filesystem::path& file, const cv::Mat& image,
                  const std::vector<int>& parameters = {});

/// "640x480", for messages.
std::string SizeText(cv::Size size);

/// Grey values of 16-bit images that become 0 to 255.
struct GreyRange {
  double black = 0, white = 256;
  bool narrow = false;  ///< a small part of what `bits` can say, and stretched
  int bits = 8;         ///< significant ones of the images
};
/// The range of the first images of a recording: all that their bits can say, unless they use an eighth of it
/// or less, as those of thermal cameras do: then from the darkest to the brightest, with a margin of half of
/// that on each side.
GreyRange RangeOf(const std::vector<cv::Mat>& greys);
/// "16-bit images, taken as 14-bit and scaled to 8 bit".
std::string RangeText(const GreyRange& range);

/// To 8 bit, any channels. 16-bit images are scaled and saturated.
cv::Mat To8Bit(const cv::Mat& image, const GreyRange& range);
/// Three equal channels from one; three channels stay.
cv::Mat ToColour(const cv::Mat& image);
/// A depth image as stored (16 bit or float) to CV_32FC1 [m]; 0: no measurement, which NaN, negative,
/// infinite values and those beyond max_depth_m (0: no limit) become.
cv::Mat DepthInMetres(const cv::Mat& stored, double units_per_m, double max_depth_m);

/// True if the name ends like an image file that OpenCV can read.
bool HasImageExtension(const std::filesystem::path& file);
/// Where a data set's folder has the images of its (left) camera (KITTI: image_0 or image_2, TUM: rgb, EuRoC:
/// mav0/cam0/data; and the layouts of layout.h): the first of these that holds any.
std::optional<std::filesystem::path> ImagesOfDataset(const std::filesystem::path& folder);
/// The files in a folder that are `wanted`, without hidden ones, in the order of the time stamps that they
/// are called by, else in natural order; none if it can't be read.
std::vector<std::filesystem::path> ListFiles(const std::filesystem::path& folder,
                                             const std::function<bool(const std::filesystem::path&)>& wanted);
/// The images in a folder, as ListFiles.
std::vector<std::filesystem::path> ListImages(const std::filesystem::path& folder);
/// Time stamps that the files are called by.
internal::StampsOfNames StampsInNames(const std::vector<std::filesystem::path>& files);

}  // namespace tutti
#pragma GCC visibility pop
