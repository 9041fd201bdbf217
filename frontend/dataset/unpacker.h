// LZ4, bzip2 and Zstandard, for chunks of bags that say how large they become.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tutti {

/// Grows `out` as bytes come, so that a chunk that lies about its size costs no memory. Each gives false
/// where the bytes are damaged, or do not become `size` bytes.
class Unpacker {
 public:
  Unpacker(std::uint64_t size, std::string* out) : size_(size), out_(out) {}

  bool Lz4(std::string_view packed);  ///< a frame (lz4frame.h)
  bool Bz2(std::string packed);
  bool Zstd(std::string_view packed);

 private:
  bool Append(std::size_t given);

  std::uint64_t size_;
  std::string* out_;
  std::vector<char> buffer_ = std::vector<char>(1U << 16U);
};

/// The content of one frame of Zstandard that says its size; nothing: it is damaged, or larger than `most`
/// bytes.
std::optional<std::string> UnpackedFrame(std::string_view packed, std::uint64_t most);

}  // namespace tutti
