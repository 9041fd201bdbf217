// ROS 1 bags of format 2.0 (wiki.ros.org/Bags/Format/2.0), plain, LZ4 or BZ2.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

#include "frontend/dataset/chunked_bag.h"

namespace tutti {

class RosBag : public ChunkedBag {
 public:
  static constexpr std::string_view kMagic = "#ROSBAG V2.0\n";

  /// `file` begins with the magic. Throws InputError where it can't be opened, or is encrypted.
  explicit RosBag(const std::filesystem::path& file);

 private:
  struct Record;

  static unsigned char ReadRecord(const ByteSource& bytes, std::uint64_t at, std::uint64_t end,
                                  Record* record);
  void Walk(const ByteSource& bytes, std::uint64_t at, std::uint64_t end, std::int32_t chunk);
  void TakeMessage(const ByteSource& bytes, const Record& record, std::int32_t chunk);
  void TakeConnection(const ByteSource& bytes, const Record& record);
  void TakeChunk(const Record& record);

  bool chunk_lost_ = false;  // the one before the record that is looked at
};

}  // namespace tutti
