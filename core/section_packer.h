// Bytes as fewer bytes: zstd, for the sections of a file.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

struct ZSTD_CCtx_s;
struct ZSTD_DCtx_s;

namespace tutti::internal {

/// Packs and unpacks one after the other, without loss.
class SectionPacker {
 public:
  /// `like`: bytes that are known when it is unpacked: what repeats them costs next to nothing. `most_gain`:
  /// no less than this part of the bytes is left. Holds until the next call.
  std::string_view Pack(std::string_view bytes, std::string_view like, std::size_t most_gain);
  /// Fills `bytes`, which have their size, with what Pack made of them; false if that is not what it is.
  bool Unpack(std::string_view packed, std::string_view like, std::string* bytes);

 private:
  void Fill(std::size_t least);
  struct Free {
    void operator()(ZSTD_CCtx_s* context) const;
    void operator()(ZSTD_DCtx_s* context) const;
  };
  std::unique_ptr<ZSTD_CCtx_s, Free> pack_;  // made when they are needed
  std::unique_ptr<ZSTD_DCtx_s, Free> unpack_;
  std::string packed_;
};

}  // namespace tutti::internal
