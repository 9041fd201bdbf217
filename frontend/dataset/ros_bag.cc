#include "frontend/dataset/ros_bag.h"

#include <bzlib.h>
#include <lz4frame.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic = "#ROSBAG V2.0\n";
constexpr std::uint32_t kMostHeaderBytes = 1U << 16U;
constexpr std::uint32_t kMostChunkBytes = 1U << 29U;  // and those of a message: 537 MB
constexpr std::size_t kMostMessages = 20'000'000;     // 55 hours of 100 Hz

// The kinds of records.
enum Op : unsigned char { kMessage = 2, kBagHeader = 3, kIndex = 4, kChunk = 5, kConnection = 7 };

template <typename T>
std::optional<T> NumberIn(std::string_view field) {
  T value;
  if (field.size() != sizeof value) return std::nullopt;
  std::memcpy(&value, field.data(), sizeof value);
  return value;
}

// The value of "name=value" among fields, each with its length before it; nothing if it is not there.
std::optional<std::string_view> FieldOf(std::string_view fields, std::string_view name) {
  while (fields.size() >= 4) {
    const std::uint32_t size = *NumberIn<std::uint32_t>(fields.substr(0, 4));
    fields.remove_prefix(4);
    if (size > fields.size()) return std::nullopt;
    const std::string_view field = fields.substr(0, size);
    fields.remove_prefix(size);
    if (field.size() > name.size() && field[name.size()] == '=' && field.substr(0, name.size()) == name)
      return field.substr(name.size() + 1);
  }
  return std::nullopt;
}

// Grows `out` as bytes come, so that a chunk that lies about its size costs no memory. False: damaged.
class Unpacker {
 public:
  Unpacker(std::uint32_t size, std::string* out) : size_(size), out_(out) {}

  bool Lz4(std::string_view packed) {
    LZ4F_dctx* made = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0) return false;
    const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
        made, LZ4F_freeDecompressionContext);
    for (std::size_t hint = 1; hint != 0;) {
      std::size_t taken = packed.size(), given = buffer_.size();
      hint = LZ4F_decompress(context.get(), buffer_.data(), &given, packed.data(), &taken, nullptr);
      if (LZ4F_isError(hint) != 0 || !Append(given)) return false;
      if (taken == 0 && given == 0 && hint != 0) return false;  // ends too early
      packed.remove_prefix(taken);
    }
    return out_->size() == size_;
  }

  bool Bz2(std::string packed) {
    bz_stream stream = {};
    if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return false;
    const std::unique_ptr<bz_stream, decltype(&BZ2_bzDecompressEnd)> end(&stream, BZ2_bzDecompressEnd);
    stream.next_in = packed.data();
    stream.avail_in = static_cast<unsigned>(packed.size());
    for (int state = BZ_OK; state != BZ_STREAM_END;) {
      stream.next_out = buffer_.data();
      stream.avail_out = static_cast<unsigned>(buffer_.size());
      state = BZ2_bzDecompress(&stream);
      const std::size_t given = buffer_.size() - stream.avail_out;
      if ((state != BZ_OK && state != BZ_STREAM_END) || !Append(given)) return false;
      if (state == BZ_OK && given == 0 && stream.avail_in == 0) return false;  // ends too early
    }
    return out_->size() == size_;
  }

 private:
  bool Append(std::size_t given) {
    if (given > size_ - out_->size()) return false;
    out_->append(buffer_.data(), given);
    return true;
  }

  std::size_t size_;
  std::string* out_;
  std::vector<char> buffer_ = std::vector<char>(1U << 16U);
};

}  // namespace

// A record: its header (fields), and where its data lies.
struct RosBag::Record {
  std::string header;
  std::uint64_t begin = 0;
  std::uint32_t size = 0;
  std::uint64_t end() const { return begin + size; }

  std::optional<std::uint32_t> Number(std::string_view name) const {
    const std::optional<std::string_view> field = FieldOf(header, name);
    return field ? NumberIn<std::uint32_t>(*field) : std::nullopt;
  }
};

class RosBag::FileBytes {
 public:
  explicit FileBytes(std::ifstream* in) : in_(in) {}
  bool Read(std::uint64_t at, std::size_t size, char* out) const {
    in_->clear();
    in_->seekg(static_cast<std::streamoff>(at));
    return static_cast<bool>(in_->read(out, static_cast<std::streamsize>(size)));
  }

 private:
  std::ifstream* in_;
};

class RosBag::MemoryBytes {
 public:
  explicit MemoryBytes(std::string_view bytes) : bytes_(bytes) {}
  bool Read(std::uint64_t at, std::size_t size, char* out) const {
    if (at > bytes_.size() || size > bytes_.size() - at) return false;
    if (size > 0) std::memcpy(out, bytes_.data() + at, size);
    return true;
  }

 private:
  std::string_view bytes_;
};

RosBag::RosBag(fs::path file) : file_(std::move(file)) {
  const std::string no_bag = file_.string() + ": can't be read as a ROS bag: ";
  std::error_code error;
  if (!fs::is_regular_file(file_, error)) throw InputError(no_bag + "it is missing, or no file");
  in_.rdbuf()->pubsetbuf(nullptr, 0);  // a few bytes here and there
  in_.open(file_, std::ios::binary | std::ios::ate);
  const std::streamoff size = in_.is_open() ? std::streamoff(in_.tellg()) : -1;
  std::string magic(kMagic.size(), '\0');
  const FileBytes bytes(&in_);
  if (size < 0) throw InputError(no_bag + "it can't be opened");
  if (!bytes.Read(0, magic.size(), magic.data()) || magic != kMagic) {
    const bool ros2 = magic.find("MCAP") == 1 || magic.find("SQLite") == 0;
    throw InputError(no_bag + (ros2
                                   ? "it is one of ROS 2; convert it: rosbags-convert (pip install rosbags)"
                                   : "it does not begin with '#ROSBAG V2.0' as those of 'rosbag record' do"));
  }
  Walk(bytes, kMagic.size(), static_cast<std::uint64_t>(size), -1);
  ListTopics();
}

// Its kind; 0 if it does not end before `end`, or does not say.
template <typename Bytes>
unsigned char RosBag::ReadRecord(const Bytes& bytes, std::uint64_t at, std::uint64_t end, Record* record) {
  std::uint32_t header_size = 0;
  const auto read_number = [&](std::uint64_t where, std::uint32_t* number) {
    return where + sizeof *number <= end &&
           bytes.Read(where, sizeof *number, reinterpret_cast<char*>(number));
  };
  if (!read_number(at, &header_size) || header_size > kMostHeaderBytes) return 0;
  record->begin = at + 2 * sizeof header_size + header_size;
  record->header.resize(header_size);
  if (record->begin > end || !bytes.Read(at + sizeof header_size, header_size, record->header.data()))
    return 0;
  if (!read_number(record->begin - sizeof record->size, &record->size)) return 0;
  const std::optional<std::string_view> op = FieldOf(record->header, "op");
  return op ? NumberIn<unsigned char>(*op).value_or(0) : std::uint8_t{0};
}

template <typename Bytes>
void RosBag::Walk(const Bytes& bytes, std::uint64_t at, std::uint64_t end, std::int32_t chunk) {
  std::uint64_t chunk_end = 0;  // of the plain chunk that was entered last
  while (at < end) {
    const std::uint64_t limit = at < chunk_end ? std::min(chunk_end, end) : end;
    Record record;
    const unsigned char op = ReadRecord(bytes, at, limit, &record);
    // The chunk in which a recording was cut off is read as far as it goes.
    if (op == 0 || (op != kChunk && record.end() > limit)) {
      if (damage_.empty()) {
        damage_ = file_.string() +
                  (chunk < 0 ? ": is damaged, or was cut off while recording, at byte "
                             : ": compressed chunk " + std::to_string(chunk) + " is damaged at its byte ") +
                  std::to_string(at) + "; what follows there is not read";
      }
      if (limit == end) return;
      at = limit;
      continue;
    }
    if (op == kMessage) {
      AddMessage(bytes, record, chunk);
    } else if (op == kConnection) {
      AddConnection(bytes, record);
    } else if (op == kChunk && chunk < 0) {
      chunk_lost_ = false;
      if (FieldOf(record.header, "compression").value_or("") == "none") {
        chunk_end = record.end();
        at = record.begin;  // its records lie there like those between chunks
        continue;
      }
      OpenChunk(record, end);
    } else if (op == kIndex && chunk_lost_) {
      lost_[record.Number("conn").value_or(0)] += record.size / 12;  // time, place
    } else if (op == kBagHeader && !FieldOf(record.header, "encryptor").value_or("").empty()) {
      throw InputError(file_.string() + ": is encrypted; decrypt it with 'rosbag decrypt'");
    }
    at = record.end();
  }
}

template <typename Bytes>
void RosBag::AddMessage(const Bytes& bytes, const Record& record, std::int32_t chunk) {
  const std::optional<std::uint32_t> connection = record.Number("conn");
  std::uint32_t words[3] = {};  // of std_msgs/Header: number, seconds, nanoseconds
  if (!connection || record.size < sizeof words) return;
  if (!bytes.Read(record.begin, sizeof words, reinterpret_cast<char*>(words))) return;
  if (messages_.size() == kMostMessages) {
    throw InputError(file_.string() + ": has more than " + std::to_string(kMostMessages / 1'000'000) +
                     " million messages; take the images out with 'rosbag filter'");
  }
  messages_.push_back({*connection, record.size, record.begin, chunk, words[1] + 1e-9 * words[2]});
}

template <typename Bytes>
void RosBag::AddConnection(const Bytes& bytes, const Record& record) {
  const std::optional<std::uint32_t> id = record.Number("conn");
  const std::optional<std::string_view> topic = FieldOf(record.header, "topic");
  // The type stands in its data, beside the definition of the message, which may be long.
  std::string data(std::min<std::size_t>(record.size, 1U << 20U), '\0');
  if (!id || !topic || !bytes.Read(record.begin, data.size(), data.data())) return;
  const std::optional<std::string_view> type = FieldOf(data, "type");
  if (type) connections_.emplace(*id, Topic{std::string(*topic), std::string(*type)});
}

void RosBag::OpenChunk(const Record& record, std::uint64_t file_end) {
  const std::string_view compression = FieldOf(record.header, "compression").value_or("");
  Chunk chunk;
  chunk.begin = record.begin;
  chunk.size = std::min(record.end(), file_end) - record.begin;
  chunk.unpacked_size = record.Number("size").value_or(0);
  chunk.lz4 = compression == "lz4";
  chunks_.push_back(chunk);
  const auto number = static_cast<std::int32_t>(chunks_.size() - 1);
  try {
    if (!chunk.lz4 && compression != "bz2")
      throw InputError("the chunk at byte " + std::to_string(chunk.begin) +
                       " is compressed in an unknown way");
    unpacked_bytes_ = Unpack(chunks_.size() - 1);
    unpacked_ = number;
  } catch (const InputError& e) {
    chunk_lost_ = true;
    if (damage_.empty()) damage_ = file_.string() + ": " + e.what();
    return;
  }
  Walk(MemoryBytes(unpacked_bytes_), 0, unpacked_bytes_.size(), number);
}

std::string RosBag::Unpack(std::size_t number) const {
  const Chunk& chunk = chunks_[number];
  const std::string at = "the chunk at byte " + std::to_string(chunk.begin);
  if (chunk.size > kMostChunkBytes || chunk.unpacked_size > kMostChunkBytes)
    throw InputError(at + " is too large (at most " + std::to_string(kMostChunkBytes) + " bytes are read)");
  std::string packed(chunk.size, '\0'), out;
  if (!FileBytes(&in_).Read(chunk.begin, packed.size(), packed.data()))
    throw InputError(at + " can't be read");
  Unpacker unpacker(chunk.unpacked_size, &out);
  if (!(chunk.lz4 ? unpacker.Lz4(packed) : unpacker.Bz2(std::move(packed))))
    throw InputError(at + " can't be unpacked: it is damaged");
  return out;
}

void RosBag::ListTopics() {
  for (const auto& [id, topic] : connections_) topics_.push_back(topic);
  std::sort(topics_.begin(), topics_.end(), [](const Topic& a, const Topic& b) { return a.name < b.name; });
  topics_.erase(std::unique(topics_.begin(), topics_.end(),
                            [](const Topic& a, const Topic& b) { return a.name == b.name; }),
                topics_.end());
}

std::string RosBag::TypeOf(const std::string& topic) const {
  const auto at =
      std::find_if(topics_.begin(), topics_.end(), [&](const Topic& t) { return t.name == topic; });
  return at != topics_.end() ? at->type : std::string();
}

std::vector<BagMessage> RosBag::Messages(const std::string& topic) const {
  std::vector<BagMessage> found;
  for (const BagMessage& message : messages_) {
    const auto at = connections_.find(message.connection);
    if (at != connections_.end() && at->second.name == topic) found.push_back(message);
  }
  return found;
}

std::size_t RosBag::Lost(const std::string& topic) const {
  std::size_t lost = 0;
  for (const auto& [connection, count] : lost_) {
    const auto at = connections_.find(connection);
    if (at != connections_.end() && at->second.name == topic) lost += count;
  }
  return lost;
}

std::string RosBag::Read(const BagMessage& message) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (message.size > kMostChunkBytes)
    throw InputError("the message is too large (" + std::to_string(message.size / 1000000) + " MB)");
  std::string bytes(message.size, '\0');
  if (message.chunk >= 0 && message.chunk != unpacked_) {
    unpacked_ = -1;
    unpacked_bytes_ = Unpack(static_cast<std::size_t>(message.chunk));
    unpacked_ = message.chunk;
  }
  const bool read = message.chunk < 0
                        ? FileBytes(&in_).Read(message.begin, bytes.size(), bytes.data())
                        : MemoryBytes(unpacked_bytes_).Read(message.begin, bytes.size(), bytes.data());
  if (!read) throw InputError("a message can't be read (any more)");
  return bytes;
}

}  // namespace tutti
