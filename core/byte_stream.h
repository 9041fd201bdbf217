// Bytes out and bytes in, for saved maps and detectors and the long-term memory's file. Not installed.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "tutti/core/error.h"

#pragma GCC visibility push(default)  // used across libraries
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
  /// A number that is small as a rule: seven bits a byte.
  void PutVarint(std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) bytes_.push_back(static_cast<char>(value | 0x80));
    bytes_.push_back(static_cast<char>(value));
  }
  /// PutVarint for a number of either sign.
  void PutSignedVarint(std::int64_t value) {
    PutVarint(static_cast<std::uint64_t>(value) << 1 ^ static_cast<std::uint64_t>(value >> 63));
  }
  /// First bytes of all, then all second ones and so on: those that are much alike lie together
  /// (SectionPacker).
  void PutPlanes(const std::vector<float>& values);
  void PutRaw(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }

  const std::string& bytes() const { return bytes_; }
  /// The bytes, which the writer has no more.
  std::string Take() { return std::move(bytes_); }

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
  std::uint64_t GetVarint();
  std::int64_t GetSignedVarint() {
    const std::uint64_t value = GetVarint();
    return static_cast<std::int64_t>(value >> 1 ^ (~(value & 1) + 1));
  }
  std::vector<float> GetPlanes();
  std::string GetString();
  /// `data` may be null where `size` is 0.
  void GetRaw(void* data, std::size_t size) {
    if (size > 0) std::memcpy(data, Take(size), size);
  }
  /// The next bytes, where they lie.
  std::string_view GetView(std::size_t size) { return {Take(size), size}; }
  /// A number of things that take at least `least_bytes` each.
  std::size_t GetCount(std::size_t least_bytes);
  bool AtEnd() const { return bytes_.empty(); }
  std::size_t Left() const { return bytes_.size(); }  ///< [bytes]
  const std::string& source() const { return source_; }
  /// Throws InputError: the source is damaged, for `what`.
  [[noreturn]] void Damaged(const std::string& what) const;

 private:
  const char* Take(std::size_t size);

  std::string_view bytes_;  // that are left
  std::string source_;
};

/// CRC-32 of zlib; `before`: that of the bytes before these.
std::uint32_t Crc32(std::string_view bytes, std::uint32_t before = 0);

}  // namespace tutti::internal
#pragma GCC visibility pop
