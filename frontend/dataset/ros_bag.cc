// ROS 1 bags of format 2.0 (wiki.ros.org/Bags/Format/2.0), plain, LZ4 or BZ2.
#include <algorithm>
#include <cstring>

#include "frontend/dataset/chunked_bag.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr std::uint32_t kMostHeaderBytes = 1U << 16U;

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

// The number in a field of a record's header.
std::optional<std::uint32_t> NumberField(const std::string& header, std::string_view name) {
  const std::optional<std::string_view> field = FieldOf(header, name);
  return field ? NumberIn<std::uint32_t>(*field) : std::nullopt;
}

class RosBag : public ChunkedBag {
 public:
  explicit RosBag(const std::filesystem::path& file) : ChunkedBag(file) {
    WalkFile(kRosBagMagic.size());
    ListTopics();
  }

 private:
  // A header, fields, stands before the content, each with its size before it.
  std::optional<Record> RecordAt(const ByteSource& bytes, std::uint64_t at,
                                 std::uint64_t limit) const override {
    std::uint32_t header_size = 0, size = 0;
    const auto read_number = [&](std::uint64_t where, std::uint32_t* number) {
      return where + sizeof *number <= limit && ReadValue(bytes, where, number);
    };
    if (!read_number(at, &header_size) || header_size > kMostHeaderBytes) return std::nullopt;
    Record record;
    record.begin = at + 2 * sizeof header_size + header_size;
    record.header.resize(header_size);
    if (record.begin > limit || !bytes(at + sizeof header_size, header_size, record.header.data()) ||
        !read_number(record.begin - sizeof size, &size))
      return std::nullopt;
    record.size = size;
    const std::optional<std::string_view> op = FieldOf(record.header, "op");
    record.op = op ? NumberIn<unsigned char>(*op).value_or(0) : std::uint8_t{0};
    if (record.op == 0) return std::nullopt;
    if (record.op == kChunk) record.kind = Record::Kind::kChunk;
    return record;
  }

  void Take(const ByteSource& bytes, const Record& record, std::int32_t chunk) override {
    if (record.op == kMessage) {
      TakeMessage(bytes, record, chunk);
    } else if (record.op == kConnection) {
      TakeConnection(bytes, record);
    } else if (record.op == kIndex && chunk_lost()) {
      AddLost(NumberField(record.header, "conn").value_or(0), record.size / 12);  // time, place
    } else if (record.op == kBagHeader && !FieldOf(record.header, "encryptor").value_or("").empty()) {
      throw InputError(file().string() + ": is encrypted; decrypt it with 'rosbag decrypt'");
    }
  }

  void TakeMessage(const ByteSource& bytes, const Record& record, std::int32_t chunk) {
    const std::optional<std::uint32_t> connection = NumberField(record.header, "conn");
    MessageHead words = {};
    if (!connection || record.size < sizeof words) return;
    if (!ReadValue(bytes, record.begin, &words)) return;
    const std::optional<std::string_view> time = FieldOf(record.header, "time");  // seconds, nanoseconds
    const std::uint64_t received = time ? NumberIn<std::uint64_t>(*time).value_or(0) : 0;
    const double received_s =
        static_cast<double>(received & UINT32_MAX) + 1e-9 * static_cast<double>(received >> 32U);
    AddMessage({*connection, static_cast<std::uint32_t>(record.size), record.begin, chunk, 0, StampOf(words),
                received_s});
  }

  void TakeConnection(const ByteSource& bytes, const Record& record) {
    const std::optional<std::uint32_t> id = NumberField(record.header, "conn");
    const std::optional<std::string_view> topic = FieldOf(record.header, "topic");
    // The type stands in its data, beside the definition of the message, which may be long.
    std::string data(std::min<std::size_t>(record.size, 1U << 20U), '\0');
    if (!id || !topic || !bytes(record.begin, data.size(), data.data())) return;
    const std::optional<std::string_view> type = FieldOf(data, "type");
    if (type) AddConnection(*id, {std::string(*topic), std::string(*type), Serialization::kRos1});
  }

  std::optional<Chunk> ChunkOf(const ByteSource& /*bytes*/, const Record& record) const override {
    const std::string_view compression = FieldOf(record.header, "compression").value_or("");
    Chunk chunk;
    chunk.begin = record.begin;
    chunk.unpacked_size = NumberField(record.header, "size").value_or(0);
    chunk.packing = compression == "none"  ? Packing::kNone
                    : compression == "lz4" ? Packing::kLz4
                    : compression == "bz2" ? Packing::kBz2
                                           : Packing::kUnknown;
    return chunk;
  }
};

}  // namespace

std::unique_ptr<Bag> OpenRosBag(const std::filesystem::path& file) { return std::make_unique<RosBag>(file); }

}  // namespace tutti
