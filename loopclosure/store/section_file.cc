#include "loopclosure/store/section_file.h"

#include <cstring>
#include <system_error>

#include "loopclosure/store/byte_stream.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

constexpr char kMagic[8] = {'T', 'U', 'T', 'T', 'I', 'L', 'C', '\n'};
constexpr std::uint32_t kVersion = 5;
constexpr std::uint32_t kByteOrder = 0x01020304;  // reads as another number on a machine of the other order

struct SectionHeader {
  std::uint32_t tag = 0;
  std::uint32_t crc = 0;
  std::uint64_t size = 0;
};

}  // namespace

SectionWriter::SectionWriter(const std::filesystem::path& file)
    : file_(file), part_(file.string() + ".part"), out_(part_, std::ios::binary | std::ios::trunc) {
  out_.write(kMagic, sizeof kMagic);
  out_.write(reinterpret_cast<const char*>(&kVersion), sizeof kVersion);
  out_.write(reinterpret_cast<const char*>(&kByteOrder), sizeof kByteOrder);
  Check();
}

SectionWriter::~SectionWriter() {
  if (finished_) return;
  out_.close();
  std::error_code ignored;
  std::filesystem::remove(part_, ignored);
}

void SectionWriter::Write(Section section, const std::string& bytes) {
  const SectionHeader header = {static_cast<std::uint32_t>(section), Crc32(bytes), bytes.size()};
  out_.write(reinterpret_cast<const char*>(&header), sizeof header);
  out_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  Check();
}

void SectionWriter::Finish() {
  Write(Section::kEnd, "");
  out_.close();
  Check();
  std::error_code error;
  std::filesystem::rename(part_, file_, error);
  if (error) throw InputError(file_.string() + ": can't be written (" + error.message() + ")");
  finished_ = true;
}

void SectionWriter::Check() const {
  if (!out_) {
    throw InputError(file_.string() +
                     ": can't be written (no such folder, no permission, or the disk is full); what was "
                     "there before is untouched");
  }
}

SectionReader::SectionReader(const std::filesystem::path& file)
    : name_(file.string()), in_(file, std::ios::binary) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error) || !in_) {
    throw InputError(name_ + ": can't be read (no such file, or no permission)");
  }
  left_ = std::filesystem::file_size(file, error);
  char magic[sizeof kMagic] = {};
  std::uint32_t version = 0;
  std::uint32_t order = 0;
  Read(magic, sizeof magic);
  if (std::memcmp(magic, kMagic, sizeof kMagic) != 0) {
    throw InputError(name_ + ": is no saved loop detector; give a file that LoopDetector::Save wrote");
  }
  Read(&version, sizeof version);
  Read(&order, sizeof order);
  if (order != kByteOrder) {
    throw InputError(name_ + ": was saved on a machine of another byte order; make it again on this one");
  }
  if (version != kVersion) {
    throw InputError(name_ + ": is a saved loop detector of version " + std::to_string(version) +
                     ", but this program reads version " + std::to_string(kVersion) + "; make it again");
  }
}

std::string SectionReader::Next(Section& section) {
  SectionHeader header;
  Read(&header, sizeof header);
  if (header.size > left_) Damaged("it ends too early");
  std::string bytes(static_cast<std::size_t>(header.size), '\0');
  Read(bytes.data(), bytes.size());
  if (Crc32(bytes) != header.crc) Damaged("a checksum is wrong");
  if (header.tag < 1 || header.tag > static_cast<std::uint32_t>(Section::kEnd)) Damaged("an unknown section");
  section = static_cast<Section>(header.tag);
  return bytes;
}

std::string SectionReader::Expect(Section wanted) {
  Section section;
  std::string bytes = Next(section);
  if (section != wanted) Damaged("a section is missing");
  return bytes;
}

void SectionReader::Damaged(const std::string& what) const { ByteReader("", name_).Damaged(what); }

void SectionReader::Read(void* data, std::size_t size) {
  if (size > left_) Damaged("it ends too early");
  in_.read(static_cast<char*>(data), static_cast<std::streamsize>(size));
  if (!in_) Damaged("it can't be read to its end");
  left_ -= size;
}

}  // namespace tutti::internal
