// Bytes out and bytes in, for saved detectors and the long-term memory's file.
#pragma once

#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "tutti/core/error.h"

namespace tutti::internal {

/// Appends plain values, in the machine's own byte order.
class ByteWriter {
 public:
  template <typename T>
  void Put(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    PutRaw(&value, sizeof value);
  }
  template <typename T>
  void PutVector(const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T> && !std::is_same_v<T, bool>);
    Put<std::uint64_t>(values.size());
    if (!values.empty()) PutRaw(values.data(), values.size() * sizeof(T));
  }
  void PutString(std::string_view text);
  /// CV_32F with whole numbers 0..255 throughout (SIFT) is packed into bytes, without loss.
  void PutMat(const cv::Mat& matrix);
  void PutRaw(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }

  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Reads what ByteWriter wrote. Throws InputError, with the name of the source, where the bytes end too early
/// or a size is absurd: never reads beyond the end, never reserves more than the bytes can fill.
class ByteReader {
 public:
  /// `bytes` must outlive the reader. `source` is a file's name, for messages.
  ByteReader(std::string_view bytes, std::string source) : bytes_(bytes), source_(std::move(source)) {}

  template <typename T>
  T Get() {
    static_assert(std::is_trivially_copyable_v<T>);
    T value;
    std::memcpy(&value, Take(sizeof value), sizeof value);
    return value;
  }
  template <typename T>
  std::vector<T> GetVector() {
    const std::size_t count = GetCount(sizeof(T));
    std::vector<T> values(count);
    if (count > 0) std::memcpy(values.data(), Take(count * sizeof(T)), count * sizeof(T));
    return values;
  }
  std::string GetString();
  void GetRaw(void* data, std::size_t size) { std::memcpy(data, Take(size), size); }
  cv::Mat GetMat();
  /// A number of things that take at least `least_bytes` each.
  std::size_t GetCount(std::size_t least_bytes);
  /// An index in [0, end).
  int GetIndex(int end);
  bool AtEnd() const { return bytes_.empty(); }
  /// Throws InputError: the source is damaged, for `what`.
  [[noreturn]] void Damaged(const std::string& what) const;

 private:
  const char* Take(std::size_t size);

  std::string_view bytes_;
  std::string source_;
};

/// CRC-32 of zlib.
std::uint32_t Crc32(std::string_view bytes);

}  // namespace tutti::internal
