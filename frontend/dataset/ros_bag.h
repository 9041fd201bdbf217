// ROS 1 bags of format 2.0 (wiki.ros.org/Bags/Format/2.0), plain, LZ4 or BZ2.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

#include "frontend/dataset/chunked_bag.h"

namespace tutti {

class RosBag : public ChunkedBag {
 public:
  static constexpr std::string_view kMagic = "#ROSBAG V2.0\n";

  /// `file` begins with the magic. Throws InputError where it can't be opened, or is encrypted.
  explicit RosBag(const std::filesystem::path& file);

 private:
  std::optional<Record> RecordAt(const ByteSource& bytes, std::uint64_t at,
                                 std::uint64_t limit) const override;
  std::optional<Chunk> ChunkOf(const ByteSource& bytes, const Record& record) const override;
  void Take(const ByteSource& bytes, const Record& record, std::int32_t chunk) override;
  void TakeMessage(const ByteSource& bytes, const Record& record, std::int32_t chunk);
  void TakeConnection(const ByteSource& bytes, const Record& record);
};

}  // namespace tutti
