// A file of sections, each with its length and a checksum: what LoopDetector::Save writes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

namespace tutti::internal {

/// What a section holds (detector_file.cc). Every file ends with an empty kEnd.
enum class Section : std::uint32_t {
  kOptions = 1,
  kMember,
  kMemory,
  kUnion,
  kView,
  kRecord,
  kStatistics,
  kEnd
};

/// Writes to a file beside the target, which takes its place in Finish; without it nothing is left. Every
/// function throws InputError, with the name of the target, if that is not possible.
class SectionWriter {
 public:
  explicit SectionWriter(const std::filesystem::path& file);
  ~SectionWriter();
  SectionWriter(const SectionWriter&) = delete;
  SectionWriter& operator=(const SectionWriter&) = delete;

  void Write(Section section, const std::string& bytes);
  /// Adds kEnd, and puts the file where the target is.
  void Finish();

 private:
  void Check() const;

  std::filesystem::path file_, part_;
  std::ofstream out_;
  bool finished_ = false;
};

/// Reads what SectionWriter wrote. Every function throws InputError, with the name of the file: it is not
/// there, is something else, of another version, or damaged.
class SectionReader {
 public:
  explicit SectionReader(const std::filesystem::path& file);

  /// Content of the next section.
  std::string Next(Section& section);
  /// The same, which must be this one.
  std::string Expect(Section wanted);

  [[noreturn]] void Damaged(const std::string& what) const;
  const std::string& name() const { return name_; }

 private:
  void Read(void* data, std::size_t size);

  std::string name_;
  std::ifstream in_;
  std::uint64_t left_ = 0;
};

}  // namespace tutti::internal
