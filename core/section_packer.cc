#include "core/section_file.h"

#include <zstd.h>

#include <algorithm>
#include <cstdint>
#include <new>

namespace tutti::internal {
namespace {

constexpr int kLevel = 1;  // the fastest: what sections hold is packed by how it is laid out, or not at all
constexpr int kWindow = 22, kHashes = 17;  // [log2 bytes], [log2]: a view and its keyframe are well inside
constexpr std::size_t kBlock = 4 * 1024;  // [bytes] with a Huffman code of their own: kinds of numbers change
constexpr std::size_t kLeast = 256;       // [bytes] shorter ones are not worth the time

}  // namespace

void SectionPacker::Free::operator()(ZSTD_CCtx_s* context) const { ZSTD_freeCCtx(context); }
void SectionPacker::Free::operator()(ZSTD_DCtx_s* context) const { ZSTD_freeDCtx(context); }

// A frame that zstd skips, where there is too little.
void SectionPacker::Fill(std::size_t least) {
  constexpr std::uint32_t kSkipped = ZSTD_MAGIC_SKIPPABLE_START;
  constexpr std::size_t kHead = 2 * sizeof(std::uint32_t), kMost = std::size_t{1} << 31;
  while (packed_.size() < least) {
    const auto size =
        static_cast<std::uint32_t>(std::min(kMost, std::max(least - packed_.size(), kHead) - kHead));
    packed_.append(reinterpret_cast<const char*>(&kSkipped), sizeof kSkipped);
    packed_.append(reinterpret_cast<const char*>(&size), sizeof size);
    packed_.append(size, '\0');
  }
}

std::string_view SectionPacker::Pack(std::string_view bytes, std::string_view like, std::size_t most_gain) {
  const std::size_t least = (bytes.size() + most_gain - 1) / most_gain;
  if (!pack_) {
    pack_.reset(ZSTD_createCCtx());
    if (!pack_) throw std::bad_alloc();
    ZSTD_CCtx_setParameter(pack_.get(), ZSTD_c_compressionLevel, kLevel);
    ZSTD_CCtx_setParameter(pack_.get(), ZSTD_c_windowLog, kWindow);
    ZSTD_CCtx_setParameter(pack_.get(), ZSTD_c_hashLog, kHashes);
  }
  if (bytes.size() < kLeast) return bytes;
  ZSTD_CCtx_reset(pack_.get(), ZSTD_reset_session_only);
  ZSTD_CCtx_setPledgedSrcSize(pack_.get(), bytes.size());
  ZSTD_CCtx_refPrefix(pack_.get(), like.data(), like.size());
  constexpr std::size_t kBlockHead = 16;  // more than zstd puts before a block
  packed_.resize(ZSTD_compressBound(bytes.size()) + kBlockHead * (bytes.size() / kBlock + 2));
  ZSTD_outBuffer out = {packed_.data(), packed_.size(), 0};
  do {
    const std::string_view block = bytes.substr(0, kBlock);
    bytes.remove_prefix(block.size());
    ZSTD_inBuffer in = {block.data(), block.size(), 0};
    if (ZSTD_compressStream2(pack_.get(), &out, &in, bytes.empty() ? ZSTD_e_end : ZSTD_e_flush) != 0)
      throw std::bad_alloc();  // the only thing that can be wrong
  } while (!bytes.empty());
  packed_.resize(out.pos);
  Fill(least);
  return packed_;
}

bool SectionPacker::Unpack(std::string_view packed, std::string_view like, std::string* bytes) {
  if (!unpack_) {
    unpack_.reset(ZSTD_createDCtx());
    if (!unpack_) throw std::bad_alloc();
  }
  ZSTD_DCtx_reset(unpack_.get(), ZSTD_reset_session_only);
  ZSTD_DCtx_refPrefix(unpack_.get(), like.data(), like.size());
  return ZSTD_decompressDCtx(unpack_.get(), bytes->data(), bytes->size(), packed.data(), packed.size()) ==
         bytes->size();
}

}  // namespace tutti::internal
