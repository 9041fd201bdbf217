// A detector as one file: LoopDetector's Save and Load.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "loopclosure/detector/detector_state.h"
#include "loopclosure/detector/long_term_memory.h"
#include "loopclosure/store/section_file.h"

namespace tutti::internal {

/// Writes all that a detector knows, its long-term memory with it; a file that is there is replaced only by a
/// complete one. Throws InputError if it can't be written.
void SaveDetector(const DetectorState& state, LongTermMemory& long_term, const std::filesystem::path& file);

/// What SaveDetector wrote, opened. Every function throws InputError, with the name of the file: it is no
/// such file, of another version, of other members, or damaged.
class SavedDetector {
 public:
  explicit SavedDetector(const std::filesystem::path& file);

  /// options.seed of the detector that was saved: what is to load it must have the same.
  std::uint64_t seed() const { return seed_; }
  /// Takes up everything, once, into objects that are empty. After an error they are of no use.
  void LoadInto(DetectorState& state, LongTermMemory& long_term);

 private:
  template <typename Read>
  void Load(Section section, const Read& read);
  void LoadViewsAndRecords(DetectorState& state, LongTermMemory& long_term);

  SectionReader in_;
  std::string fingerprint_;
  std::uint64_t seed_ = 0;
};

}  // namespace tutti::internal
