#include "loopclosure/store/byte_stream.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>

namespace tutti::internal {
namespace {

enum class MatKind : std::uint8_t { kEmpty, kBytes, kFloats, kFloatsAsBytes };

bool WholeBytes(const cv::Mat& matrix) {
  for (int r = 0; r < matrix.rows; ++r) {
    const float* row = matrix.ptr<float>(r);
    const bool whole = std::all_of(row, row + matrix.cols,
                                   [](float v) { return v >= 0.0f && v <= 255.0f && v == std::floor(v); });
    if (!whole) return false;
  }
  return true;
}

}  // namespace

void ByteWriter::PutString(std::string_view text) {
  Put<std::uint64_t>(text.size());
  PutRaw(text.data(), text.size());
}

void ByteWriter::PutMat(const cv::Mat& matrix) {
  if (matrix.empty()) return Put(MatKind::kEmpty);
  CV_Assert(matrix.type() == CV_8U || matrix.type() == CV_32F);
  const bool pack = matrix.type() == CV_32F && WholeBytes(matrix);
  Put(matrix.type() == CV_8U ? MatKind::kBytes : pack ? MatKind::kFloatsAsBytes : MatKind::kFloats);
  Put<std::int32_t>(matrix.rows);
  Put<std::int32_t>(matrix.cols);
  cv::Mat stored = matrix;
  if (pack) matrix.convertTo(stored, CV_8U);
  for (int r = 0; r < stored.rows; ++r) {
    PutRaw(stored.ptr(r), static_cast<std::size_t>(stored.cols) * stored.elemSize());
  }
}

std::string ByteReader::GetString() {
  const std::size_t size = GetCount(1);
  return std::string(Take(size), size);
}

cv::Mat ByteReader::GetMat() {
  const auto kind = Get<std::uint8_t>();
  if (kind == static_cast<std::uint8_t>(MatKind::kEmpty)) return {};
  if (kind > static_cast<std::uint8_t>(MatKind::kFloatsAsBytes)) Damaged("a matrix of an unknown kind");
  const auto rows = Get<std::int32_t>();
  const auto columns = Get<std::int32_t>();
  const std::size_t width = kind == static_cast<std::uint8_t>(MatKind::kFloats) ? sizeof(float) : 1;
  if (rows <= 0 || columns <= 0 ||
      static_cast<std::uint64_t>(rows) * static_cast<std::uint64_t>(columns) > bytes_.size() / width) {
    Damaged("a matrix of an impossible size");
  }
  cv::Mat matrix(rows, columns, width == sizeof(float) ? CV_32F : CV_8U);
  std::memcpy(matrix.data, Take(matrix.total() * width), matrix.total() * width);
  if (kind == static_cast<std::uint8_t>(MatKind::kFloatsAsBytes)) matrix.convertTo(matrix, CV_32F);
  return matrix;
}

std::size_t ByteReader::GetCount(std::size_t least_bytes) {
  const auto count = Get<std::uint64_t>();
  if (count > bytes_.size() / std::max<std::size_t>(1, least_bytes)) Damaged("more entries than bytes");
  return static_cast<std::size_t>(count);
}

int ByteReader::GetIndex(int end) {
  const auto index = Get<std::int32_t>();
  if (index < 0 || index >= end) Damaged("an index out of range");
  return index;
}

void ByteReader::Damaged(const std::string& what) const {
  throw InputError(source_ + ": is damaged (" + what + "); make it again, or use an older copy");
}

const char* ByteReader::Take(std::size_t size) {
  if (size > bytes_.size()) Damaged("it ends too early");
  const char* data = bytes_.data();
  bytes_.remove_prefix(size);
  return data;
}

std::uint32_t Crc32(std::string_view bytes) {
  uLong crc = crc32_z(0, nullptr, 0);
  return static_cast<std::uint32_t>(
      crc32_z(crc, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

}  // namespace tutti::internal
