#include "frontend/dataset/ros_bag.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <string>

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

RosBag::RosBag(const std::filesystem::path& file) : ChunkedBag(file) {
  Walk(bytes(), kMagic.size(), file_size(), -1);
  ListTopics();
}

// Its kind; 0 if it does not end before `end`, or does not say.
unsigned char RosBag::ReadRecord(const ByteSource& bytes, std::uint64_t at, std::uint64_t end,
                                 Record* record) {
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

void RosBag::Walk(const ByteSource& bytes, std::uint64_t at, std::uint64_t end, std::int32_t chunk) {
  std::uint64_t chunk_end = 0;  // of the plain chunk that was entered last
  while (at < end) {
    const std::uint64_t limit = at < chunk_end ? std::min(chunk_end, end) : end;
    Record record;
    const unsigned char op = ReadRecord(bytes, at, limit, &record);
    // The chunk in which a recording was cut off is read as far as it goes.
    if (op == 0 || (op != kChunk && record.end() > limit)) {
      NoteNoRecord(at, chunk);
      if (limit == end) return;
      at = limit;
      continue;
    }
    if (op == kMessage) {
      TakeMessage(bytes, record, chunk);
    } else if (op == kConnection) {
      TakeConnection(bytes, record);
    } else if (op == kChunk && chunk < 0) {
      chunk_lost_ = false;
      if (FieldOf(record.header, "compression").value_or("") == "none") {
        chunk_end = record.end();
        at = record.begin;  // its records lie there like those between chunks
        continue;
      }
      TakeChunk(record);
    } else if (op == kIndex && chunk_lost_) {
      AddLost(record.Number("conn").value_or(0), record.size / 12);  // time, place
    } else if (op == kBagHeader && !FieldOf(record.header, "encryptor").value_or("").empty()) {
      throw InputError(file().string() + ": is encrypted; decrypt it with 'rosbag decrypt'");
    }
    at = record.end();
  }
}

void RosBag::TakeMessage(const ByteSource& bytes, const Record& record, std::int32_t chunk) {
  const std::optional<std::uint32_t> connection = record.Number("conn");
  MessageHead words = {};
  if (!connection || record.size < sizeof words) return;
  if (!bytes.Read(record.begin, sizeof words, reinterpret_cast<char*>(words.data()))) return;
  AddMessage({*connection, record.size, record.begin, chunk, 0, StampOf(words)});
}

void RosBag::TakeConnection(const ByteSource& bytes, const Record& record) {
  const std::optional<std::uint32_t> id = record.Number("conn");
  const std::optional<std::string_view> topic = FieldOf(record.header, "topic");
  // The type stands in its data, beside the definition of the message, which may be long.
  std::string data(std::min<std::size_t>(record.size, 1U << 20U), '\0');
  if (!id || !topic || !bytes.Read(record.begin, data.size(), data.data())) return;
  const std::optional<std::string_view> type = FieldOf(data, "type");
  if (type) AddConnection(*id, {std::string(*topic), std::string(*type), Serialization::kRos1});
}

void RosBag::TakeChunk(const Record& record) {
  const std::string_view compression = FieldOf(record.header, "compression").value_or("");
  Chunk chunk;
  chunk.begin = record.begin;
  chunk.size = std::min(record.end(), file_size()) - record.begin;
  chunk.unpacked_size = record.Number("size").value_or(0);
  chunk.packing = compression == "lz4"   ? Packing::kLz4
                  : compression == "bz2" ? Packing::kBz2
                                         : Packing::kUnknown;
  const std::optional<Unpacked> unpacked = Open(chunk);
  chunk_lost_ = !unpacked;
  if (unpacked) Walk(MemoryBytes(unpacked->bytes), 0, unpacked->bytes.size(), unpacked->number);
}

}  // namespace tutti
