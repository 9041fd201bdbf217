// What bags of ROS 1 and MCAP have in common: records in a file, many of them in chunks that are compressed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "frontend/dataset/bag.h"

namespace tutti {

/// Bytes that are looked at here and there: those of a file, or of an unpacked chunk.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  /// False: they are not all there.
  virtual bool Read(std::uint64_t at, std::size_t size, char* out) const = 0;
};

/// Memory, beside that of Bag: one chunk.
class ChunkedBag : public Bag {
 public:
  std::string Read(const BagMessage& message) const override;

 protected:
  enum class Packing { kNone, kLz4, kBz2, kZstd, kUnknown };
  struct Chunk {
    std::uint64_t begin = 0, size = 0;  // in the file
    std::uint64_t unpacked_size = 0;
    Packing packing = Packing::kUnknown;
    std::uint32_t crc = 0;  // of the unpacked bytes; 0: not known
  };

  /// Throws InputError where the file can't be opened.
  explicit ChunkedBag(const std::filesystem::path& file);

  std::uint64_t file_size() const { return file_size_; }
  const ByteSource& bytes() const { return bytes_; }
  /// Unpacks a chunk, whose number and bytes it gives; nothing, with damage noted, where it can't be. The
  /// bytes are there until the next one is unpacked.
  struct Unpacked {
    std::int32_t number;
    std::string_view bytes;
  };
  std::optional<Unpacked> Open(const Chunk& chunk);
  /// Notes that no record can be read at a byte of the file, or of a chunk (below 0: of none).
  void NoteNoRecord(std::uint64_t at, std::int32_t chunk);

 private:
  class FileBytes : public ByteSource {
   public:
    explicit FileBytes(std::ifstream* in) : in_(in) {}
    bool Read(std::uint64_t at, std::size_t size, char* out) const override;

   private:
    std::ifstream* in_;
  };

  std::string Unpack(std::size_t chunk) const;

  std::uint64_t file_size_ = 0;
  std::vector<Chunk> chunks_;  // compressed ones
  mutable std::mutex mutex_;
  mutable std::ifstream in_;
  FileBytes bytes_;
  mutable std::int32_t unpacked_ = -1;  // whose bytes these are
  mutable std::string unpacked_bytes_;
};

class MemoryBytes : public ByteSource {
 public:
  explicit MemoryBytes(std::string_view bytes) : bytes_(bytes) {}
  bool Read(std::uint64_t at, std::size_t size, char* out) const override;

 private:
  std::string_view bytes_;
};

}  // namespace tutti
