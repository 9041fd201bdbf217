// Files of MATLAB 5 to 7, uncompressed, as save -v6 writes them.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace tutti::testing {

constexpr std::uint32_t kInt8 = 1, kUint8 = 2, kInt32 = 5, kUint32 = 6, kDouble = 9, kMatrix = 14;
constexpr std::uint32_t kCell = 1, kSparse = 5, kDoubles = 6, kBytes = 9;  // classes of arrays

/// One element: type, length, data, padding to 8 bytes.
template <typename T>
std::string MatElement(std::uint32_t type, const std::vector<T>& data) {
  const std::array<std::uint32_t, 2> tag = {type, static_cast<std::uint32_t>(data.size() * sizeof(T))};
  std::string bytes(sizeof tag + (tag[1] + 7) / 8 * 8, '\0');
  std::memcpy(bytes.data(), tag.data(), sizeof tag);
  if (!data.empty()) std::memcpy(bytes.data() + sizeof tag, data.data(), tag[1]);
  return bytes;
}

/// A matrix of this class; `content` is what follows its name.
inline std::string MatVariable(std::uint32_t array_class, int rows, int columns, const std::string& content) {
  const std::string all = MatElement<std::uint32_t>(kUint32, {array_class, 9}) +
                          MatElement<std::int32_t>(kInt32, {rows, columns}) +
                          MatElement<char>(kInt8, {'t', 'r', 'u', 't', 'h'}) + content;
  return MatElement(kMatrix, std::vector<char>(all.begin(), all.end()));
}

/// What a file begins with; variables follow.
inline std::string MatHeader() {
  std::string header = "MATLAB 5.0 MAT-file";
  header.resize(124, ' ');
  return header + std::string("\0\1IM", 4);
}

}  // namespace tutti::testing
