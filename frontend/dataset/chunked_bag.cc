#include "frontend/dataset/chunked_bag.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "core/byte_stream.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

enum class UnpackStep { kMore, kEnd, kDamaged };

// `step(in, taken, out, given)` unpacks from `in` to `out`, and sets how many bytes of either it used.
template <class Step>
std::optional<std::string> UnpackedBy(const Step& step, std::string_view packed, std::uint64_t size) {
  std::string out;
  std::vector<char> buffer(1U << 16U);
  for (UnpackStep state = UnpackStep::kMore; state != UnpackStep::kEnd;) {
    std::size_t taken = packed.size(), given = buffer.size();
    state = step(packed.data(), &taken, buffer.data(), &given);
    if (state == UnpackStep::kDamaged || given > size - out.size()) return std::nullopt;
    out.append(buffer.data(), given);
    if (taken == 0 && given == 0 && state != UnpackStep::kEnd) return std::nullopt;  // ends too early
    packed.remove_prefix(taken);
  }
  return out.size() == size ? std::optional<std::string>(std::move(out)) : std::nullopt;
}

std::optional<std::string> UnpackedLz4(std::string_view packed, std::uint64_t size) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0) return std::nullopt;
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      made, LZ4F_freeDecompressionContext);
  const auto step = [&](const char* in, std::size_t* taken, char* out, std::size_t* given) {
    const std::size_t hint = LZ4F_decompress(context.get(), out, given, in, taken, nullptr);
    if (LZ4F_isError(hint) != 0) return UnpackStep::kDamaged;
    return hint == 0 ? UnpackStep::kEnd : UnpackStep::kMore;
  };
  return UnpackedBy(step, packed, size);
}

std::optional<std::string> UnpackedBz2(std::string_view packed, std::uint64_t size) {
  bz_stream stream = {};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return std::nullopt;
  const std::unique_ptr<bz_stream, decltype(&BZ2_bzDecompressEnd)> end(&stream, BZ2_bzDecompressEnd);
  const auto step = [&](const char* in, std::size_t* taken, char* out, std::size_t* given) {
    stream.next_in = const_cast<char*>(in);
    stream.avail_in = static_cast<unsigned>(*taken);
    stream.next_out = out;
    stream.avail_out = static_cast<unsigned>(*given);
    const int state = BZ2_bzDecompress(&stream);
    *taken -= stream.avail_in;
    *given -= stream.avail_out;
    return state == BZ_STREAM_END ? UnpackStep::kEnd
           : state == BZ_OK       ? UnpackStep::kMore
                                  : UnpackStep::kDamaged;
  };
  return UnpackedBy(step, packed, size);
}

std::optional<std::string> UnpackedZstd(std::string_view packed, std::uint64_t size) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), ZSTD_freeDCtx);
  if (context == nullptr) return std::nullopt;
  const auto step = [&](const char* in, std::size_t* taken, char* out, std::size_t* given) {
    ZSTD_inBuffer from = {in, *taken, 0};
    ZSTD_outBuffer to = {out, *given, 0};
    const std::size_t hint = ZSTD_decompressStream(context.get(), &to, &from);
    *taken = from.pos;
    *given = to.pos;
    if (ZSTD_isError(hint) != 0) return UnpackStep::kDamaged;
    return hint == 0 ? UnpackStep::kEnd : UnpackStep::kMore;
  };
  return UnpackedBy(step, packed, size);
}

ByteSource BytesIn(std::string_view memory) {
  return [memory](std::uint64_t at, std::size_t size, char* out) {
    if (at > memory.size() || size > memory.size() - at) return false;
    if (size > 0) std::memcpy(out, memory.data() + at, size);
    return true;
  };
}

}  // namespace

std::optional<std::string> Unpacked(Packing packing, std::string_view packed, std::uint64_t size) {
  if (packing == Packing::kLz4) return UnpackedLz4(packed, size);
  return packing == Packing::kBz2 ? UnpackedBz2(packed, size) : UnpackedZstd(packed, size);
}

ChunkedBag::ChunkedBag(const std::filesystem::path& path)
    : Bag(path), bytes_([this](std::uint64_t at, std::size_t size, char* out) {
        in_.clear();
        in_.seekg(static_cast<std::streamoff>(at));
        return static_cast<bool>(in_.read(out, static_cast<std::streamsize>(size)));
      }) {
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
    Unpack(number);
  } catch (const InputError& e) {
    chunk_lost_ = true;
    NoteDamage(e.what());
    return;
  }
  Walk(BytesIn(unpacked_bytes_), 0, unpacked_bytes_.size(), number);
}

void ChunkedBag::NoteNoRecord(std::uint64_t at, std::int32_t chunk) {
  NoteDamage((chunk < 0 ? "is damaged, or was cut off while recording, at byte "
                        : "compressed chunk " + std::to_string(chunk) + " is damaged at its byte ") +
             std::to_string(at) + "; what follows there is not read");
}

void ChunkedBag::Unpack(std::int32_t number) const {
  if (number == unpacked_) return;
  unpacked_ = -1;
  const Chunk& chunk = chunks_[static_cast<std::size_t>(number)];
  const std::string at = "the chunk at byte " + std::to_string(chunk.begin);
  if (chunk.size > kMostMessageBytes || chunk.unpacked_size > kMostMessageBytes)
    throw InputError(at + " is too large (at most " + std::to_string(kMostMessageBytes) + " bytes are read)");
  std::string packed(chunk.size, '\0');
  if (!bytes_(chunk.begin, packed.size(), packed.data())) throw InputError(at + " can't be read");
  std::optional<std::string> out = Unpacked(chunk.packing, packed, chunk.unpacked_size);
  if (!out || (chunk.crc != 0 && internal::Crc32(*out) != chunk.crc))
    throw InputError(at + " can't be unpacked: it is damaged");
  unpacked_bytes_ = *std::move(out);
  unpacked_ = number;
}

std::string ChunkedBag::ReadStored(const BagMessage& message) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (message.size > kMostMessageBytes)
    throw InputError("the message is too large (" + std::to_string(message.size / 1000000) + " MB)");
  std::string bytes(message.size, '\0');
  if (message.chunk >= 0) Unpack(message.chunk);
  const ByteSource source = message.chunk < 0 ? bytes_ : BytesIn(unpacked_bytes_);
  if (!source(message.begin, bytes.size(), bytes.data()))
    throw InputError("a message can't be read (any more)");
  return bytes;
}

}  // namespace tutti
