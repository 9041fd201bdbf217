// ROS 1 bags of format 2.0 (wiki.ros.org/Bags/Format/2.0), plain, LZ4 or BZ2. Nothing in them is believed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace tutti {

/// Where a message lies.
struct BagMessage {
  std::uint32_t connection = 0;
  std::uint32_t size = 0;   ///< [bytes]
  std::uint64_t begin = 0;  ///< in the unpacked chunk, or in the file
  std::int32_t chunk = -1;  ///< that is compressed; -1: none
  double stamp_s = 0;       ///< of its header, for messages that begin with one (std_msgs/Header)
};

/// The messages of a bag, found by going through its records from front to back: the index at its end is not
/// needed, so a bag that was cut off while recording gives what lies before the cut. Memory: 32 bytes a
/// message and one chunk.
class RosBag {
 public:
  struct Topic {
    std::string name, type;  ///< "/camera/image_raw", "sensor_msgs/Image"
  };

  /// Throws InputError where the file can't be opened, is no such bag, or is encrypted.
  explicit RosBag(std::filesystem::path file);

  /// By name; one that two nodes publish is there once.
  const std::vector<Topic>& topics() const { return topics_; }
  /// Empty: it has no such topic.
  std::string TypeOf(const std::string& topic) const;
  /// In the order of the file.
  std::vector<BagMessage> Messages(const std::string& topic) const;
  /// Messages of the topic that lie in chunks that can't be unpacked, as the chunks' own indices count them.
  std::size_t Lost(const std::string& topic) const;
  /// The bytes of a message. Throws InputError, which does not name the file, if they can't be read (any
  /// more). Thread-safe.
  std::string Read(const BagMessage& message) const;
  /// One sentence if not all of the file could be read; empty: it is whole.
  const std::string& damage() const { return damage_; }

 private:
  struct Chunk {
    std::uint64_t begin = 0, size = 0;  // in the file
    std::uint32_t unpacked_size = 0;
    bool lz4 = false;
  };
  struct Record;
  class FileBytes;
  class MemoryBytes;

  template <typename Bytes>
  static unsigned char ReadRecord(const Bytes& bytes, std::uint64_t at, std::uint64_t end, Record* record);
  template <typename Bytes>
  void Walk(const Bytes& bytes, std::uint64_t at, std::uint64_t end, std::int32_t chunk);
  template <typename Bytes>
  void AddMessage(const Bytes& bytes, const Record& record, std::int32_t chunk);
  template <typename Bytes>
  void AddConnection(const Bytes& bytes, const Record& record);
  void OpenChunk(const Record& record, std::uint64_t file_end);
  std::string Unpack(std::size_t chunk) const;
  void ListTopics();

  std::filesystem::path file_;
  std::vector<Chunk> chunks_;  // compressed ones
  std::vector<BagMessage> messages_;
  std::map<std::uint32_t, Topic> connections_;
  std::map<std::uint32_t, std::size_t> lost_;  // by connection
  std::vector<Topic> topics_;
  bool chunk_lost_ = false;  // the one before the record that is looked at
  std::string damage_;

  mutable std::mutex mutex_;
  mutable std::ifstream in_;
  mutable std::int32_t unpacked_ = -1;  // whose bytes these are
  mutable std::string unpacked_bytes_;
};

}  // namespace tutti
