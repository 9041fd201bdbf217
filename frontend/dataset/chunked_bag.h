// What bags of ROS 1 and MCAP have in common: records in a file, many of them in chunks that are compressed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "frontend/dataset/bag.h"

namespace tutti {

enum class Packing { kNone, kLz4, kBz2, kZstd, kUnknown };

/// The bytes that LZ4 (a frame, lz4frame.h), bzip2 or Zstandard packed, which must be `size`. They grow as
/// they come, so that a chunk that lies about its size costs no memory. Nothing: the bytes are damaged, or do
/// not become that many.
std::optional<std::string> Unpacked(Packing packing, std::string_view packed, std::uint64_t size);

/// Copies bytes from a place on, of a file or of an unpacked chunk. False: they are not all there.
using ByteSource = std::function<bool(std::uint64_t at, std::size_t size, char* out)>;
template <typename T>
bool ReadValue(const ByteSource& bytes, std::uint64_t at, T* value) {
  return bytes(at, sizeof *value, reinterpret_cast<char*>(value));
}

/// Memory, beside that of Bag: one chunk.
class ChunkedBag : public Bag {
 protected:
  struct Chunk {
    std::uint64_t begin = 0, size = 0;  // in the file
    std::uint64_t unpacked_size = 0;
    Packing packing = Packing::kUnknown;
    std::uint32_t crc = 0;  // of the unpacked bytes; 0: not known
  };
  struct Record {
    enum class Kind { kChunk, kLast, kOther };
    Kind kind = Kind::kOther;
    unsigned char op = 0;               // as the format says what it is
    std::string header;                 // of formats that have one
    std::uint64_t begin = 0, size = 0;  // of its content, which may be cut off
  };

  /// Throws InputError where the file can't be opened.
  explicit ChunkedBag(const std::filesystem::path& file);

  /// Gives Take() every record from a byte of the file on, and those of its chunks. False at the record that
  /// says that there are no more. For the constructor of a format.
  bool WalkFile(std::uint64_t begin) { return Walk(bytes_, begin, file_size_, -1); }
  /// The record at a byte, whose content begins before `limit`, or there; nothing where there is none.
  virtual std::optional<Record> RecordAt(const ByteSource& bytes, std::uint64_t at,
                                         std::uint64_t limit) const = 0;
  /// Where a record of chunks has its chunk; nothing where it does not say.
  virtual std::optional<Chunk> ChunkOf(const ByteSource& bytes, const Record& record) const = 0;
  /// Takes a record that is no chunk, and is all there. `chunk`: it lies in; -1: in the file.
  virtual void Take(const ByteSource& bytes, const Record& record, std::int32_t chunk) = 0;
  /// Whether the chunk before the record that is taken could not be read.
  bool chunk_lost() const { return chunk_lost_; }

 private:
  bool Walk(const ByteSource& bytes, std::uint64_t at, std::uint64_t end, std::int32_t chunk);
  void WalkPacked(const Chunk& chunk);
  void NoteNoRecord(std::uint64_t at, std::int32_t chunk);
  std::string ReadStored(const BagMessage& message) const override;
  void Unpack(std::int32_t number) const;

  std::uint64_t file_size_ = 0;
  std::vector<Chunk> chunks_;  // compressed ones
  mutable std::mutex mutex_;
  mutable std::ifstream in_;
  const ByteSource bytes_;  // of the file
  bool chunk_lost_ = false;
  mutable std::int32_t unpacked_ = -1;  // whose bytes these are
  mutable std::string unpacked_bytes_;
};

}  // namespace tutti
