// A file of sections, each with its length and a checksum: what saved maps and detectors are written in. Not
// installed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "core/replaced_file.h"

#pragma GCC visibility push(default)  // used across libraries
struct ZSTD_CCtx_s;
struct ZSTD_DCtx_s;

namespace tutti {

/// Tags; those of other modules have other hundreds.
enum class OdometrySection : std::uint32_t {
  kHead = 100,        ///< what it was made with, and how much follows
  kKeyframe,          ///< one each
  kLandmarks,         ///< so many together
  kTracking,          ///< all that is no map
  kTimes,             ///< milliseconds by stage, the only thing that varies from run to run
  kGlobalAdjustment,  ///< GlobalAdjustment::SaveSections
  kImage,             ///< of the keyframe that follows, if it has it still
  kImu,               ///< measurements, before kTimes; absent without an IMU
  kEndOfOdometry = 199
};

inline std::uint32_t Tag(OdometrySection section) { return static_cast<std::uint32_t>(section); }

namespace internal {

/// What a file of sections is, for its first bytes and for messages.
struct SectionFileKind {
  char magic[8];
  std::uint32_t version;
  const char* name;    ///< "saved loop detector"
  const char* writer;  ///< "LoopDetector::Save"
};

/// Takes a section: its tag and its bytes.
using SectionSink = std::function<void(std::uint32_t tag, std::string_view bytes)>;

/// Ends every file; no other section has this tag.
inline constexpr std::uint32_t kEndOfSections = 0xffffffff;

/// Stands in front of each section. What follows it in the file is the content itself, or where that is
/// longer a frame of zstd.
struct SectionHeader {
  std::uint32_t tag = 0;
  std::uint32_t checksum = 0;  ///< SectionChecksum
  std::uint64_t size = 0;      ///< of the content [bytes]
  std::uint64_t stored = 0;    ///< of what follows in the file [bytes]
  std::uint64_t like = 0;      ///< 0, or where the section begins that zstd had seen before this one
};

/// Checksum of all of the header but the checksum, and of what follows it in the file.
std::uint32_t SectionChecksum(const SectionHeader& header, std::string_view stored);

/// A content is at most so many times as long as what is stored of it: what a file needs of memory is known
/// from its length.
inline constexpr std::uint64_t kMostSectionGain = 16;

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

/// Writes to a file beside the target (ReplacedFile), which takes the target's place in Finish; without it
/// nothing is left. So the target is always one complete file, whoever else writes it at the same time. Every
/// function throws InputError, with the name of the target, if that is not possible.
class SectionWriter {
 public:
  SectionWriter(const std::filesystem::path& file, const SectionFileKind& kind);
  ~SectionWriter();
  SectionWriter(const SectionWriter&) = delete;
  SectionWriter& operator=(const SectionWriter&) = delete;

  /// Returns the section's place. `like`: that of a section that much of this one repeats, which is then
  /// stored once, and which no other was like yet; 0: none.
  std::uint64_t Write(std::uint32_t tag, std::string_view bytes, std::uint64_t like = 0);
  template <typename Enum>
  std::uint64_t Write(Enum tag, std::string_view bytes, std::uint64_t like = 0) {
    return Write(static_cast<std::uint32_t>(tag), bytes, like);
  }
  /// Ends the file, waits until the disk has it, and puts it where the target is.
  void Finish();

 private:
  std::string ReadBack(std::uint64_t place);
  void Check();

  std::string name_;
  ReplacedFile file_;
  std::fstream out_;
  std::uint64_t end_ = 0;            // of the file, so far
  std::set<std::uint64_t> likened_;  // places that sections are like
  std::unique_ptr<SectionPacker> packer_;
};

/// Reads what SectionWriter wrote. Every function throws InputError, with the name of the file: it is not
/// there, is something else, of another version, or damaged.
class SectionReader {
 public:
  SectionReader(const std::filesystem::path& file, const SectionFileKind& kind);
  ~SectionReader();

  /// Tag of the next section, whose content goes into `bytes`.
  std::uint32_t Next(std::string* bytes);
  /// Content of the next section, which must have this tag.
  template <typename Enum>
  std::string Expect(Enum tag) {
    return Expect(static_cast<std::uint32_t>(tag));
  }
  std::string Expect(std::uint32_t tag);
  /// The tag of the next section, which is still to be read.
  std::uint32_t Peek();
  /// Leaves out, unread, what stands before the next section with this tag.
  template <typename Enum>
  void SkipTo(Enum tag) {
    SkipTo(static_cast<std::uint32_t>(tag));
  }
  void SkipTo(std::uint32_t tag);

  [[noreturn]] void Damaged(const std::string& what) const;
  const std::string& name() const { return name_; }

 private:
  void Read(void* data, std::size_t size);
  SectionHeader ReadHeader();
  void ReadContent(const SectionHeader& header, std::string_view like, std::string* bytes);
  std::string ReadLike(std::uint64_t place);

  std::string name_;
  std::ifstream in_;
  std::uint64_t size_ = 0, left_ = 0;  // of the file; of that, after what was read
  std::set<std::uint64_t>
      likened_;  // places that sections were like: one each, so that no file is endless work
  std::string stored_;
  std::unique_ptr<SectionPacker> packer_;
};

/// Throws InputError unless `index` is in [first, end).
inline void CheckIndex(int index, int first, int end, const SectionReader& file) {
  if (index < first || index >= end) file.Damaged("an index out of range");
}

}  // namespace internal
}  // namespace tutti
#pragma GCC visibility pop
