// MCAP files (mcap.dev/spec), as 'ros2 bag record' writes them: plain, LZ4 or Zstandard.
#include <algorithm>
#include <cstring>
#include <utility>

#include "core/byte_stream.h"
#include "frontend/dataset/chunked_bag.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr std::uint64_t kRecordHead = 9;  // kind, size of the content
constexpr std::size_t kMostTextBytes = 1U << 16U;

// The kinds of records.
enum McapOp : unsigned char {
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kData = 5,
  kPacked = 6,
  kMessageIndex = 7
};

std::string TextOf(internal::ByteReader& in) { return std::string(in.GetView(in.Get<std::uint32_t>())); }

class McapBag : public ChunkedBag {
 public:
  explicit McapBag(const std::filesystem::path& file) : ChunkedBag(file) {
    if (WalkFile(kMcapMagic.size())) NoteDamage("was cut off while recording");
    ListTopics();
  }

 private:
  std::optional<Record> RecordAt(const ByteSource& bytes, std::uint64_t at,
                                 std::uint64_t limit) const override {
    char head[kRecordHead];
    if (kRecordHead > limit - at || !bytes(at, kRecordHead, head) || head[0] == 0) return std::nullopt;
    Record record;
    record.op = static_cast<unsigned char>(head[0]);
    record.kind = record.op == kPacked   ? Record::Kind::kChunk
                  : record.op == kFooter ? Record::Kind::kLast
                                         : Record::Kind::kOther;
    record.begin = at + kRecordHead;
    std::memcpy(&record.size, head + 1, sizeof record.size);
    return record;
  }

  void Take(const ByteSource& bytes, const Record& record, std::int32_t chunk) override {
    if (record.op == kData) return TakeMessage(bytes, record, chunk);
    if (record.op != kSchema && record.op != kChannel && record.op != kMessageIndex) return;
    std::string content(std::min<std::uint64_t>(record.size, kMostTextBytes), '\0');
    if (!bytes(record.begin, content.size(), content.data())) return;
    try {
      internal::ByteReader in(content, "a record");
      if (record.op == kSchema) {
        const auto id = in.Get<std::uint16_t>();
        schemas_.emplace(id, NameOfType(TextOf(in)));
      } else if (record.op == kChannel) {
        TakeChannel(in);
      } else if (chunk_lost()) {
        const auto channel = in.Get<std::uint16_t>();
        const std::uint64_t bytes_of_it = in.Get<std::uint32_t>();
        AddLost(channel, std::min(bytes_of_it, record.size) / 16);  // time, place
      }
    } catch (const InputError&) {  // it ends too early: as if it were not there
    }
  }

  void TakeChannel(internal::ByteReader& in) {
    const auto id = in.Get<std::uint16_t>(), schema = in.Get<std::uint16_t>();
    std::string topic = TextOf(in);
    const std::string encoding = TextOf(in);
    const auto type = schemas_.find(schema);
    if (type == schemas_.end() || (encoding != "cdr" && encoding != "ros1")) return;
    AddConnection(
        id, {std::move(topic), type->second, encoding == "cdr" ? Serialization::kCdr : Serialization::kRos1});
  }

  void TakeMessage(const ByteSource& bytes, const Record& record, std::int32_t chunk) {
    constexpr std::uint64_t kMessageHead = 22;  // channel, number, times of recording and of sending
    std::uint16_t channel = 0;
    std::uint64_t received_ns = 0;
    MessageHead words = {};
    const std::uint64_t begin = record.begin + kMessageHead;
    if (record.size < kMessageHead + sizeof words || record.size - kMessageHead > UINT32_MAX) return;
    if (!ReadValue(bytes, record.begin, &channel) || !ReadValue(bytes, record.begin + 6, &received_ns) ||
        !ReadValue(bytes, begin, &words))
      return;
    AddMessage({channel, static_cast<std::uint32_t>(record.size - kMessageHead), begin, chunk, 0,
                StampOf(words), 1e-9 * static_cast<double>(received_ns)});
  }

  std::optional<Chunk> ChunkOf(const ByteSource& bytes, const Record& record) const override {
    Chunk chunk;
    std::string content(std::min<std::uint64_t>(record.size, 64), '\0');
    try {
      if (!bytes(record.begin, content.size(), content.data())) return std::nullopt;
      internal::ByteReader in(content, "a chunk");
      in.GetView(16);  // times of its first and last message
      chunk.unpacked_size = in.Get<std::uint64_t>();
      chunk.crc = in.Get<std::uint32_t>();
      const std::string packing = TextOf(in);
      in.Get<std::uint64_t>();  // size
      chunk.packing = packing.empty()     ? Packing::kNone
                      : packing == "lz4"  ? Packing::kLz4
                      : packing == "zstd" ? Packing::kZstd
                                          : Packing::kUnknown;
      chunk.begin = record.begin + content.size() - in.Left();
      return chunk;
    } catch (const InputError&) {  // it ends too early
      return std::nullopt;
    }
  }

  std::map<std::uint16_t, std::string> schemas_;  // names of types
};

}  // namespace

std::unique_ptr<Bag> OpenMcapBag(const std::filesystem::path& file) {
  return std::make_unique<McapBag>(file);
}

}  // namespace tutti
