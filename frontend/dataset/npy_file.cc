#include "frontend/dataset/npy_file.h"

#include <cstdint>
#include <cstring>
#include <fstream>
#include <vector>

#include "tutti/core/text.h"

namespace tutti {
namespace {

constexpr std::size_t kMostNpyHeaderBytes = 65536;

// What stands behind 'key': in the header, a Python dictionary, up to `end`.
std::string NpyValueOf(const std::string& header, const std::string& key, char end) {
  const std::size_t at = header.find("'" + key + "':");
  if (at == std::string::npos) return {};
  const std::size_t begin = at + key.size() + 3, stop = header.find(end, begin);
  return stop == std::string::npos ? std::string() : header.substr(begin, stop - begin);
}

struct NpyArray {
  int type = -1;  // of OpenCV
  std::uint64_t rows = 0, columns = 0;
};

// What is wrong; empty: `array` is set.
// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
std::string ParseNpyHeader(const std::string& header, NpyArray& array) {
  const std::string type = JoinText(SplitText(NpyValueOf(header, "descr", ','), " '\""), "");
  if (type == "<f4") array.type = CV_32FC1;
  if (type == "<f8") array.type = CV_64FC1;
  if (type == "<f2") array.type = CV_16FC1;
  if (type == "<u2") array.type = CV_16UC1;
  if (array.type < 0)
    return "has numbers of type '" + type.substr(0, 20) +
           "'; float16, float32, float64 and uint16 can be read";
  if (NpyValueOf(header, "fortran_order", ',').find("False") == std::string::npos)
    return "is not in C order; save it with numpy.ascontiguousarray";
  const std::string shape = NpyValueOf(header, "shape", ')');
  std::vector<std::uint64_t> sizes;
  for (const std::string& word : SplitText(shape, " (,")) {
    const std::optional<long long> size = ParseInteger(word);
    if (!size || *size < 1) return "has the shape " + shape.substr(0, 40) + ")";
    if (*size != 1 || sizes.size() < 2) sizes.push_back(static_cast<std::uint64_t>(*size));
  }
  if (sizes.size() == 3 && sizes.front() == 1) sizes.erase(sizes.begin());
  if (sizes.size() != 2) return "is no image: its shape has " + std::to_string(sizes.size()) + " dimensions";
  array.rows = sizes[0];
  array.columns = sizes[1];
  if (array.rows > kMostImagePixels / array.columns)
    return "says that it has " + std::to_string(array.columns) + " x " + std::to_string(array.rows) +
           " pixels; at most " + std::to_string(kMostImagePixels / 1000000) + " million are read";
  return {};
}

// What is wrong; empty: `image` is set.
std::string ReadNpy(std::ifstream& in, std::uint64_t bytes, cv::Mat& image) {
  unsigned char start[12] = {};
  in.read(reinterpret_cast<char*>(start), sizeof start);
  if (!in || std::memcmp(start, "\x93NUMPY", 6) != 0) return "is no array of NumPy";
  const bool wide = start[6] >= 2;  // the header's length has four bytes
  std::size_t length = start[8] + 256U * start[9];
  if (wide) length += 65536U * start[10] + 16777216U * start[11];
  const std::size_t begin = wide ? 12 : 10;
  if (length > kMostNpyHeaderBytes || begin + length > bytes) return "has a damaged header";
  std::string header(length, ' ');
  in.seekg(static_cast<std::streamoff>(begin));
  if (!in.read(header.data(), static_cast<std::streamsize>(length))) return "has a damaged header";
  NpyArray array;
  std::string problem = ParseNpyHeader(header, array);
  if (!problem.empty()) return problem;
  const std::uint64_t need = array.rows * array.columns * CV_ELEM_SIZE(array.type);
  if (bytes - begin - length < need)
    return "is truncated (it ends after " + std::to_string(bytes) + " bytes)";
  image.create(static_cast<int>(array.rows), static_cast<int>(array.columns), array.type);
  if (!in.read(reinterpret_cast<char*>(image.data), static_cast<std::streamsize>(need)))
    return "can't be read in full";
  if (array.type != CV_16UC1) image.convertTo(image, CV_32F);
  return {};
}

}  // namespace

ImageFile ReadNpyFile(const std::filesystem::path& file) {
  ImageFile out;
  std::error_code code;
  std::ifstream in;
  if (std::filesystem::is_regular_file(file, code)) in.open(file, std::ios::binary);
  const std::uintmax_t bytes = in.is_open() ? std::filesystem::file_size(file, code) : 0;
  std::string problem = "can't be read; check that it is a readable file";
  try {
    if (in.is_open() && !code) problem = ReadNpy(in, bytes, out.image);
  } catch (const std::exception&) {  // out of memory
    problem = "can't be read: there is not enough memory";
  }
  if (problem.empty()) return out;
  out.image.release();
  out.error = file.string() + ": " + problem;
  return out;
}

}  // namespace tutti
