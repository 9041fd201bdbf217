#include "frontend/dataset/mcap_bag.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/byte_stream.h"
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

}  // namespace

McapBag::McapBag(const std::filesystem::path& file) : ChunkedBag(file) {
  if (WalkFile(kMagic.size())) NoteDamage("was cut off while recording");
  ListTopics();
}

std::optional<McapBag::Record> McapBag::RecordAt(const ByteSource& bytes, std::uint64_t at,
                                                 std::uint64_t limit) const {
  char head[kRecordHead];
  if (kRecordHead > limit - at || !bytes.Read(at, kRecordHead, head) || head[0] == 0) return std::nullopt;
  Record record;
  record.op = static_cast<unsigned char>(head[0]);
  record.kind = record.op == kPacked   ? Record::Kind::kChunk
                : record.op == kFooter ? Record::Kind::kLast
                                       : Record::Kind::kOther;
  record.begin = at + kRecordHead;
  std::memcpy(&record.size, head + 1, sizeof record.size);
  return record;
}

void McapBag::Take(const ByteSource& bytes, const Record& record, std::int32_t chunk) {
  if (record.op == kData) return TakeMessage(bytes, record, chunk);
  if (record.op != kSchema && record.op != kChannel && record.op != kMessageIndex) return;
  std::string content(std::min<std::uint64_t>(record.size, kMostTextBytes), '\0');
  if (!bytes.Read(record.begin, content.size(), content.data())) return;
  try {
    if (record.op == kSchema) return TakeSchema(content);
    if (record.op == kChannel) return TakeChannel(content);
    if (!chunk_lost()) return;
    internal::ByteReader in(content, "an index");
    const auto channel = in.Get<std::uint16_t>();
    const std::uint64_t bytes_of_it = in.Get<std::uint32_t>();
    AddLost(channel, std::min(bytes_of_it, record.size) / 16);  // time, place
  } catch (const InputError&) {                                 // it ends too early: as if it were not there
  }
}

void McapBag::TakeSchema(const std::string& content) {
  internal::ByteReader in(content, "a schema");
  const auto id = in.Get<std::uint16_t>();
  schemas_.emplace(id, NameOfType(TextOf(in)));
}

void McapBag::TakeChannel(const std::string& content) {
  internal::ByteReader in(content, "a channel");
  const auto id = in.Get<std::uint16_t>(), schema = in.Get<std::uint16_t>();
  std::string topic = TextOf(in);
  const std::string encoding = TextOf(in);
  const auto type = schemas_.find(schema);
  if (type == schemas_.end() || (encoding != "cdr" && encoding != "ros1")) return;
  AddConnection(
      id, {std::move(topic), type->second, encoding == "cdr" ? Serialization::kCdr : Serialization::kRos1});
}

void McapBag::TakeMessage(const ByteSource& bytes, const Record& record, std::int32_t chunk) {
  constexpr std::uint64_t kMessageHead = 22;  // channel, number, times of recording and of sending
  std::uint16_t channel = 0;
  std::uint64_t received_ns = 0;
  MessageHead words = {};
  const std::uint64_t begin = record.begin + kMessageHead;
  if (record.size < kMessageHead + sizeof words || record.size - kMessageHead > UINT32_MAX) return;
  if (!bytes.Read(record.begin, sizeof channel, reinterpret_cast<char*>(&channel)) ||
      !bytes.Read(record.begin + 6, sizeof received_ns, reinterpret_cast<char*>(&received_ns)) ||
      !bytes.Read(begin, sizeof words, reinterpret_cast<char*>(words.data())))
    return;
  AddMessage({channel, static_cast<std::uint32_t>(record.size - kMessageHead), begin, chunk, 0,
              StampOf(words), 1e-9 * static_cast<double>(received_ns)});
}

std::optional<McapBag::Chunk> McapBag::ChunkOf(const ByteSource& bytes, const Record& record) const {
  Chunk chunk;
  std::string content(std::min<std::uint64_t>(record.size, 64), '\0');
  try {
    if (!bytes.Read(record.begin, content.size(), content.data())) return std::nullopt;
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

}  // namespace tutti
