// MCAP files (mcap.dev/spec), as 'ros2 bag record' writes them: plain, LZ4 or Zstandard.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "frontend/dataset/chunked_bag.h"

namespace tutti {

class McapBag : public ChunkedBag {
 public:
  static constexpr std::string_view kMagic = "\x89MCAP0\r\n";

  /// `file` begins with the magic. Throws InputError where it can't be opened.
  explicit McapBag(const std::filesystem::path& file);

 private:
  std::optional<Record> RecordAt(const ByteSource& bytes, std::uint64_t at,
                                 std::uint64_t limit) const override;
  std::optional<Chunk> ChunkOf(const ByteSource& bytes, const Record& record) const override;
  void Take(const ByteSource& bytes, const Record& record, std::int32_t chunk) override;
  void TakeSchema(const std::string& content);
  void TakeChannel(const std::string& content);
  void TakeMessage(const ByteSource& bytes, const Record& record, std::int32_t chunk);

  std::map<std::uint16_t, std::string> schemas_;  // names of types
};

}  // namespace tutti
