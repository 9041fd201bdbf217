#include "frontend/dataset/chunked_bag.h"

#include <algorithm>
#include <cstring>

#include "core/byte_stream.h"
#include "frontend/dataset/unpacker.h"
#include "tutti/core/error.h"

namespace tutti {

bool ChunkedBag::FileBytes::Read(std::uint64_t at, std::size_t size, char* out) const {
  in_->clear();
  in_->seekg(static_cast<std::streamoff>(at));
  return static_cast<bool>(in_->read(out, static_cast<std::streamsize>(size)));
}

bool MemoryBytes::Read(std::uint64_t at, std::size_t size, char* out) const {
  if (at > bytes_.size() || size > bytes_.size() - at) return false;
  if (size > 0) std::memcpy(out, bytes_.data() + at, size);
  return true;
}

ChunkedBag::ChunkedBag(const std::filesystem::path& path) : Bag(path), bytes_(&in_) {
  in_.rdbuf()->pubsetbuf(nullptr, 0);  // a few bytes here and there
  in_.open(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = in_.is_open() ? std::streamoff(in_.tellg()) : -1;
  if (size < 0) throw InputError(path.string() + ": can't be read as a ROS bag: it can't be opened");
  file_size_ = static_cast<std::uint64_t>(size);
}

bool ChunkedBag::Walk(const ByteSource& bytes, std::uint64_t at, std::uint64_t end, std::int32_t chunk) {
  std::uint64_t chunk_end = 0;  // of the plain chunk that was entered last
  while (at < end) {
    const std::uint64_t limit = at < chunk_end ? std::min(chunk_end, end) : end;
    const std::optional<Record> record = RecordAt(bytes, at, limit);
    const bool is_chunk = record && record->kind == Record::Kind::kChunk;
    // The chunk in which a recording was cut off is read as far as it goes.
    if (!record || (!is_chunk && record->size > limit - record->begin)) {
      NoteNoRecord(at, chunk);
      if (limit == end) return true;
      at = limit;
      continue;
    }
    if (record->kind == Record::Kind::kLast) return false;
    const std::uint64_t record_end = record->begin + std::min(record->size, limit - record->begin);
    if (is_chunk && chunk < 0) {
      std::optional<Chunk> found = ChunkOf(bytes, *record);
      chunk_lost_ = !found;
      if (!found) {
        NoteNoRecord(at, chunk);
      } else if (found->packing == Packing::kNone) {
        chunk_end = record_end;
        at = found->begin;  // its records lie there like those between chunks
        continue;
      } else {
        found->size = record_end - found->begin;
        WalkPacked(*found);
      }
    } else if (!is_chunk) {
      Take(bytes, *record, chunk);
    }
    at = record_end;
  }
  return true;
}

void ChunkedBag::WalkPacked(const Chunk& chunk) {
  const auto number = static_cast<std::int32_t>(chunks_.size());
  chunks_.push_back(chunk);
  try {
    if (chunk.packing == Packing::kUnknown)
      throw InputError("the chunk at byte " + std::to_string(chunk.begin) +
                       " is compressed in an unknown way");
    unpacked_ = -1;
    unpacked_bytes_ = Unpack(chunks_.size() - 1);
    unpacked_ = number;
  } catch (const InputError& e) {
    chunk_lost_ = true;
    NoteDamage(e.what());
    return;
  }
  Walk(MemoryBytes(unpacked_bytes_), 0, unpacked_bytes_.size(), number);
}

void ChunkedBag::NoteNoRecord(std::uint64_t at, std::int32_t chunk) {
  NoteDamage((chunk < 0 ? "is damaged, or was cut off while recording, at byte "
                        : "compressed chunk " + std::to_string(chunk) + " is damaged at its byte ") +
             std::to_string(at) + "; what follows there is not read");
}

std::string ChunkedBag::Unpack(std::size_t number) const {
  const Chunk& chunk = chunks_[number];
  const std::string at = "the chunk at byte " + std::to_string(chunk.begin);
  if (chunk.size > kMostMessageBytes || chunk.unpacked_size > kMostMessageBytes)
    throw InputError(at + " is too large (at most " + std::to_string(kMostMessageBytes) + " bytes are read)");
  std::string packed(chunk.size, '\0'), out;
  if (!bytes_.Read(chunk.begin, packed.size(), packed.data())) throw InputError(at + " can't be read");
  Unpacker unpacker(chunk.unpacked_size, &out);
  const bool whole = chunk.packing == Packing::kLz4   ? unpacker.Lz4(packed)
                     : chunk.packing == Packing::kBz2 ? unpacker.Bz2(std::move(packed))
                                                      : unpacker.Zstd(packed);
  if (!whole || (chunk.crc != 0 && internal::Crc32(out) != chunk.crc))
    throw InputError(at + " can't be unpacked: it is damaged");
  return out;
}

std::string ChunkedBag::ReadStored(const BagMessage& message) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (message.size > kMostMessageBytes)
    throw InputError("the message is too large (" + std::to_string(message.size / 1000000) + " MB)");
  std::string bytes(message.size, '\0');
  if (message.chunk >= 0 && message.chunk != unpacked_) {
    unpacked_ = -1;
    unpacked_bytes_ = Unpack(static_cast<std::size_t>(message.chunk));
    unpacked_ = message.chunk;
  }
  const bool read = message.chunk < 0
                        ? bytes_.Read(message.begin, bytes.size(), bytes.data())
                        : MemoryBytes(unpacked_bytes_).Read(message.begin, bytes.size(), bytes.data());
  if (!read) throw InputError("a message can't be read (any more)");
  return bytes;
}

}  // namespace tutti
