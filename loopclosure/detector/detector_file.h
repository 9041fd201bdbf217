// A detector as one file: LoopDetector's Save and Load.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "core/byte_stream.h"
#include "core/section_file.h"
#include "loopclosure/detector/detector_state.h"
#include "loopclosure/detector/long_term_memory.h"

namespace tutti::internal {

inline constexpr SectionFileKind kDetectorFile = {
    {'T', 'U', 'T', 'T', 'I', 'L', 'C', '\n'}, 10, "saved loop detector", "LoopDetector::Save"};

/// Writes all that a detector knows, its long-term memory with it; a file that is there is replaced only by a
/// complete one. Throws InputError if it can't be written.
void SaveDetector(DetectorState& state, LongTermMemory& long_term, const std::filesystem::path& file);

/// Whether the positions that came with queries (PosePrior) are kept: they mean nothing without the odometry
/// that gave them.
enum class Positions { kForget, kKeep };
/// Gives what it would write as sections of a file that holds more.
void SaveDetector(DetectorState& state, LongTermMemory& long_term, Positions positions,
                  const SectionSink& out);

/// Tags of a section that holds the vocabulary of a member, and of one that holds the view of a location.
inline constexpr std::uint32_t kMemberSection = 2, kViewSection = 5;
/// The id of the location that a view is of.
inline std::int64_t LocationOfView(std::string_view section) {
  ByteReader bytes(section, "a view");
  bytes.Get<std::int32_t>();  // slot
  return bytes.Get<std::int64_t>();
}

/// What SaveDetector wrote, opened. Every function throws InputError, with the name of the file: it is no
/// such file, of another version, of other members, or damaged.
class SavedDetector {
 public:
  explicit SavedDetector(const std::filesystem::path& file);
  /// From the next sections of a file that holds more.
  explicit SavedDetector(SectionReader* in);

  /// options.seed of the detector that was saved: what is to load it must have the same.
  std::uint64_t seed() const { return seed_; }
  /// Takes up everything, once, into objects that are empty. After an error they are of no use.
  void LoadInto(DetectorState& state, LongTermMemory& long_term);

 private:
  void ReadOptions();
  std::map<int, View> LoadViews();  // by slot
  void LoadRest(DetectorState& state, LongTermMemory& long_term);

  std::unique_ptr<SectionReader> own_;  // null: somebody else's
  SectionReader& in_;
  std::string fingerprint_;
  std::uint64_t seed_ = 0;
};

}  // namespace tutti::internal
