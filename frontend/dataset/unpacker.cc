#include "frontend/dataset/unpacker.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include <memory>

namespace tutti {

bool Unpacker::Lz4(std::string_view packed) {
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

bool Unpacker::Bz2(std::string packed) {
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

bool Unpacker::Zstd(std::string_view packed) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), ZSTD_freeDCtx);
  if (context == nullptr) return false;
  ZSTD_inBuffer in = {packed.data(), packed.size(), 0};
  for (std::size_t hint = 1; hint != 0;) {
    ZSTD_outBuffer out = {buffer_.data(), buffer_.size(), 0};
    const std::size_t before = in.pos;
    hint = ZSTD_decompressStream(context.get(), &out, &in);
    if (ZSTD_isError(hint) != 0 || !Append(out.pos)) return false;
    if (in.pos == before && out.pos == 0 && hint != 0) return false;  // ends too early
  }
  return out_->size() == size_;
}

std::optional<std::string> UnpackedFrame(std::string_view packed, std::uint64_t most) {
  const unsigned long long size = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (size > most) return std::nullopt;  // so are the numbers for errors, and for sizes that it does not say
  std::string out;
  if (!Unpacker(size, &out).Zstd(packed)) return std::nullopt;
  return out;
}

bool Unpacker::Append(std::size_t given) {
  if (given > size_ - out_->size()) return false;
  out_->append(buffer_.data(), given);
  return true;
}

}  // namespace tutti
