#include "frontend/dataset/chunked_bag.h"

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

std::optional<ChunkedBag::Unpacked> ChunkedBag::Open(const Chunk& chunk) {
  chunks_.push_back(chunk);
  const std::size_t number = chunks_.size() - 1;
  try {
    if (chunk.packing == Packing::kUnknown)
      throw InputError("the chunk at byte " + std::to_string(chunk.begin) +
                       " is compressed in an unknown way");
    unpacked_bytes_ = Unpack(number);
  } catch (const InputError& e) {
    unpacked_ = -1;
    NoteDamage(e.what());
    return std::nullopt;
  }
  unpacked_ = static_cast<std::int32_t>(number);
  return Unpacked{unpacked_, unpacked_bytes_};
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

std::string ChunkedBag::Read(const BagMessage& message) const {
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
