// Recordings of ROS, of any format: their messages by topic. Nothing in them is believed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "frontend/dataset/ros_message.h"

namespace tutti {

constexpr std::string_view kRosBagMagic = "#ROSBAG V2.0\n",
                           kMcapMagic = "\x89MCAP0\r\n";  ///< beginnings of files

constexpr std::uint32_t kMostMessageBytes = 1U << 29U;  ///< and those of an unpacked chunk: 537 MB

/// Where a message lies.
struct BagMessage {
  std::uint32_t connection = 0;
  std::uint32_t size = 0;   ///< [bytes]
  std::uint64_t begin = 0;  ///< in the unpacked chunk, or in the file; of a database: its row
  std::int32_t chunk = -1;  ///< that is compressed; -1: none
  std::uint32_t part = 0;   ///< of a recording in several files
  double stamp_s = 0;       ///< in its header (std_msgs/Header); nan where the message is compressed
  double received_s = 0;    ///< when the recorder got it
};

/// The messages of a recording. Indices in it are not needed: one that was cut off while recording gives what
/// lies before the cut. Memory: 40 bytes a message.
class Bag {
 public:
  struct Topic {
    std::string name, type;  ///< "/camera/image_raw", "sensor_msgs/Image" (of ROS 2, too)
    Serialization serialization = Serialization::kRos1;
  };

  /// A bag of ROS 1 (format 2.0), one of ROS 2 (MCAP or SQLite), by what the file begins with; or the folder
  /// in which 'ros2 bag record' leaves such files, which are read one after the other. Throws InputError
  /// where it can't be opened, or is none of these.
  static std::unique_ptr<Bag> Open(const std::filesystem::path& path);
  /// By its name: .bag, .mcap, .db3, or a packed one (.zstd), which Open refuses with a sentence.
  static bool IsNamed(const std::filesystem::path& file);
  /// The files of such a folder, in the order of their numbers, also packed ones (.db3.zstd) that lie there
  /// alone; empty: it is none.
  static std::vector<std::filesystem::path> Files(const std::filesystem::path& folder);

  virtual ~Bag() = default;
  Bag(const Bag&) = delete;
  Bag& operator=(const Bag&) = delete;

  /// By name; one that two nodes publish is there once.
  const std::vector<Topic>& topics() const { return topics_; }
  /// Null: it has no such topic.
  const Topic* Find(const std::string& topic) const;
  /// In the order in which they were recorded.
  std::vector<BagMessage> Messages(const std::string& topic) const;
  /// Messages of the topic that lie in what can't be unpacked, as the file counts them.
  std::size_t Lost(const std::string& topic) const;
  /// The bytes of a message, unpacked if it is compressed for itself (compression_mode: message). Throws
  /// InputError, which does not name the file, if they can't be read (any more). Thread-safe.
  std::string Read(const BagMessage& message) const;
  /// One sentence if not all could be read; empty: it is whole.
  const std::string& damage() const { return damage_; }

 protected:
  explicit Bag(std::filesystem::path file) : file_(std::move(file)) {}

  /// The bytes as they are stored, as Read() gives them.
  virtual std::string ReadStored(const BagMessage& message) const = 0;

  const std::filesystem::path& file() const { return file_; }
  void AddConnection(std::uint32_t id, Topic topic) { connections_.emplace(id, std::move(topic)); }
  /// Throws InputError where there are more than can be meant.
  void AddMessage(const BagMessage& message);
  void AddLost(std::uint32_t connection, std::size_t count) { lost_[connection] += count; }
  /// What is found first is kept. `text` is what follows the file's name.
  void NoteDamage(const std::string& text);
  /// All of another bag, as that part of this one.
  void Absorb(Bag&& part, std::uint32_t number);
  /// To be called once all connections are known.
  void ListTopics();

 private:
  std::filesystem::path file_;
  std::vector<BagMessage> messages_;
  std::map<std::uint32_t, Topic> connections_;
  std::map<std::uint32_t, std::size_t> lost_;  // by connection
  std::vector<Topic> topics_;
  std::string damage_;
};

/// Files of one format, which begin with its magic. Throw InputError where the file can't be opened, is
/// encrypted, or has not the tables of 'ros2 bag record'.
std::unique_ptr<Bag> OpenRosBag(const std::filesystem::path& file);
std::unique_ptr<Bag> OpenMcapBag(const std::filesystem::path& file);
std::unique_ptr<Bag> OpenSqliteBag(const std::filesystem::path& file);

}  // namespace tutti
