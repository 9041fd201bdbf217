#include "core/byte_stream.h"

#include <zlib.h>

#include <algorithm>

namespace tutti::internal {
void ByteWriter::PutString(std::string_view text) {
  Put<std::uint64_t>(text.size());
  PutRaw(text.data(), text.size());
}

void ByteWriter::PutPlanes(const std::vector<float>& values) {
  Put<std::uint64_t>(values.size());
  const std::size_t begin = bytes_.size();
  bytes_.resize(begin + values.size() * sizeof(float));
  const char* const from = reinterpret_cast<const char*>(values.data());
  for (std::size_t plane = 0; plane < sizeof(float); ++plane) {
    char* const to = bytes_.data() + begin + plane * values.size();
    for (std::size_t i = 0; i < values.size(); ++i) to[i] = from[i * sizeof(float) + plane];
  }
}

std::vector<float> ByteReader::GetPlanes() {
  std::vector<float> values(GetCount(sizeof(float)));
  const char* const from = Take(values.size() * sizeof(float));
  char* const to = reinterpret_cast<char*>(values.data());
  for (std::size_t plane = 0; plane < sizeof(float); ++plane) {
    for (std::size_t i = 0; i < values.size(); ++i)
      to[i * sizeof(float) + plane] = from[plane * values.size() + i];
  }
  return values;
}

std::uint64_t ByteReader::GetVarint() {
  std::uint64_t value = 0;
  for (int bits = 0; bits < 64; bits += 7) {
    const auto byte = static_cast<std::uint8_t>(*Take(1));
    value |= std::uint64_t{byte & 0x7FU} << bits;
    if (byte < 0x80) return value;
  }
  Damaged("an impossible number");
}

std::string ByteReader::GetString() {
  const std::size_t size = GetCount(1);
  return std::string(Take(size), size);
}

std::size_t ByteReader::GetCount(std::size_t least_bytes) {
  const auto count = Get<std::uint64_t>();
  if (count > bytes_.size() / std::max<std::size_t>(1, least_bytes)) Damaged("more entries than bytes");
  return static_cast<std::size_t>(count);
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

std::uint32_t Crc32(std::string_view bytes, std::uint32_t before) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

}  // namespace tutti::internal
