// Numbers in the bytes of files that other programs read. Not installed.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>

namespace tutti::internal {

/// Appends an integer, float or double, least significant byte first on any machine.
template <class Number>
void AppendLittleEndian(Number number, std::string* bytes) {
  static_assert(std::is_arithmetic_v<Number> && sizeof(Number) <= 8);
  std::conditional_t<sizeof(Number) == 8, std::uint64_t, std::uint32_t> bits = 0;
  if constexpr (std::is_floating_point_v<Number>)
    std::memcpy(&bits, &number, sizeof number);
  else
    bits = static_cast<decltype(bits)>(number);
  for (std::size_t i = 0; i < sizeof number; ++i) bytes->push_back(static_cast<char>(bits >> (8 * i)));
}

}  // namespace tutti::internal
