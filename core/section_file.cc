#include "core/section_file.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>

#include "core/byte_stream.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kByteOrder = 0x01020304;  // reads as another number on a machine of the other order

// What writers left that were killed.
void RemoveOldParts(const fs::path& file) {
  const std::string start = PartPrefix(file);
  std::error_code ignored;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  for (fs::directory_iterator entry(folder, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    const std::string name = entry->path().filename().string();
    if (name.compare(0, start.size(), start) != 0) continue;
    const int process = std::atoi(name.c_str() + start.size());
    if (process > 0 && kill(process, 0) != 0 && errno == ESRCH) fs::remove(entry->path(), ignored);
  }
}

// 0, or what kept the disk from taking all of a file or folder.
int Sync(const fs::path& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return errno;
  const int status = fsync(descriptor), error = errno;
  close(descriptor);
  return status == 0 || error == EINVAL || error == EROFS ? 0 : error;
}

}  // namespace

std::uint32_t SectionChecksum(const SectionHeader& header, std::string_view stored) {
  const std::uint64_t start[4] = {header.tag, header.size, header.stored, header.like};
  return Crc32(stored, Crc32({reinterpret_cast<const char*>(start), sizeof start}));
}

SectionWriter::SectionWriter(const fs::path& file, const SectionFileKind& kind)
    : name_(file.string()), file_(file), packer_(std::make_unique<SectionPacker>()) {
  RemoveOldParts(file_.target());
  errno = 0;
  out_.open(file_.part(), std::ios::binary | std::ios::in | std::ios::out);
  out_.write(kind.magic, sizeof kind.magic);
  out_.write(reinterpret_cast<const char*>(&kind.version), sizeof kind.version);
  out_.write(reinterpret_cast<const char*>(&kByteOrder), sizeof kByteOrder);
  end_ = sizeof kind.magic + sizeof kind.version + sizeof kByteOrder;
  Check();
}

SectionWriter::~SectionWriter() = default;

std::uint64_t SectionWriter::Write(std::uint32_t tag, std::string_view bytes, std::uint64_t like) {
  errno = 0;
  std::string before;
  if (like != 0 && likened_.insert(like).second) {
    before = ReadBack(like);
  } else {
    like = 0;
  }
  std::string_view stored = packer_->Pack(bytes, before, kMostSectionGain);
  if (stored.size() >= bytes.size()) {
    stored = bytes;
    like = 0;
  }
  SectionHeader header = {tag, 0, bytes.size(), stored.size(), like};
  header.checksum = SectionChecksum(header, stored);
  out_.write(reinterpret_cast<const char*>(&header), sizeof header);
  out_.write(stored.data(), static_cast<std::streamsize>(stored.size()));
  Check();
  return std::exchange(end_, end_ + sizeof header + stored.size());
}

// The content of a section that was written; "" if that was like another.
std::string SectionWriter::ReadBack(std::uint64_t place) {
  SectionHeader header;
  out_.seekg(static_cast<std::streamoff>(place));
  out_.read(reinterpret_cast<char*>(&header), sizeof header);
  std::string stored(header.stored, '\0'), bytes(header.size, '\0');
  out_.read(stored.data(), static_cast<std::streamsize>(stored.size()));
  out_.seekp(static_cast<std::streamoff>(end_));
  Check();
  if (header.stored == header.size) return stored;
  if (header.like != 0 || !packer_->Unpack(stored, "", &bytes)) return {};
  return bytes;
}

void SectionWriter::Finish() {
  Write(kEndOfSections, "");
  errno = 0;
  out_.close();
  Check();
  if (const int error = Sync(file_.part()); error != 0) FailToWrite(name_, error);
  file_.Commit();
  Sync(file_.target().has_parent_path() ? file_.target().parent_path() : fs::path("."));
}

void SectionWriter::Check() {
  if (!out_) FailToWrite(name_, errno);
}

SectionReader::SectionReader(const fs::path& file, const SectionFileKind& kind)
    : name_(file.string()), packer_(std::make_unique<SectionPacker>()) {
  std::error_code error;  // nothing else is opened: one waits at a pipe without end
  if (fs::is_regular_file(file, error)) in_.open(file, std::ios::binary);
  if (!in_.is_open()) {
    throw InputError(name_ + ": can't be read (no such file, or no permission)");
  }
  size_ = left_ = fs::file_size(file, error);
  char magic[sizeof kind.magic] = {};
  std::uint32_t version = 0;
  std::uint32_t order = 0;
  Read(magic, sizeof magic);
  const std::string what = kind.name;
  if (std::memcmp(magic, kind.magic, sizeof magic) != 0) {
    throw InputError(name_ + ": is no " + what + "; give a file that " + kind.writer + " wrote");
  }
  Read(&version, sizeof version);
  Read(&order, sizeof order);
  if (order != kByteOrder) {
    throw InputError(name_ + ": was saved on a machine of another byte order; make it again on this one");
  }
  if (version != kind.version) {
    throw InputError(name_ + ": is a " + what + " of version " + std::to_string(version) +
                     ", but this program reads version " + std::to_string(kind.version) +
                     (version > kind.version ? "; take a newer tutti, or make it again" : "; make it again"));
  }
}

SectionReader::~SectionReader() = default;

SectionHeader SectionReader::ReadHeader() {
  SectionHeader header;
  Read(&header, sizeof header);
  if (header.stored > left_) Damaged("it ends too early");
  if (header.size < header.stored || header.size / kMostSectionGain > header.stored)
    Damaged("a section of an impossible size");
  return header;
}

void SectionReader::ReadContent(const SectionHeader& header, std::string_view like, std::string* bytes) {
  const bool packed = header.stored < header.size;
  std::string& stored = packed ? stored_ : *bytes;
  stored.resize(static_cast<std::size_t>(header.stored));
  Read(stored.data(), stored.size());
  if (SectionChecksum(header, stored) != header.checksum) Damaged("a checksum is wrong");
  if (!packed) return;
  bytes->resize(static_cast<std::size_t>(header.size));
  if (!packer_->Unpack(stored, like, bytes)) Damaged("a section that can't be unpacked");
}

// The content of an earlier section, which is like no other.
std::string SectionReader::ReadLike(std::uint64_t place) {
  if (!likened_.insert(place).second) Damaged("a section like one that is nowhere");
  const std::ifstream::pos_type here = in_.tellg();
  const std::uint64_t left = left_;
  in_.seekg(static_cast<std::streamoff>(place));
  left_ = size_ - place;
  const SectionHeader header = ReadHeader();
  if (header.like != 0) Damaged("a section like one that is like another");
  std::string bytes;
  ReadContent(header, "", &bytes);
  in_.seekg(here);
  left_ = left;
  return bytes;
}

std::uint32_t SectionReader::Next(std::string* bytes) {
  const std::uint64_t place = size_ - left_;
  const SectionHeader header = ReadHeader();
  if (header.like != 0 && header.like >= place) Damaged("a section like one that is nowhere");
  ReadContent(header, header.like != 0 ? ReadLike(header.like) : std::string(), bytes);
  if (header.tag == kEndOfSections && (left_ > 0 || !bytes->empty())) Damaged("bytes behind its end");
  return header.tag;
}

std::string SectionReader::Expect(std::uint32_t tag) {
  std::string bytes;
  if (Next(&bytes) != tag) Damaged("a section is missing");
  return bytes;
}

std::uint32_t SectionReader::Peek() {
  const std::ifstream::pos_type here = in_.tellg();
  const std::uint64_t left = left_;
  const SectionHeader header = ReadHeader();
  in_.seekg(here);
  left_ = left;
  return header.tag;
}

void SectionReader::SkipTo(std::uint32_t tag) {
  while (Peek() != tag) {
    const std::uint64_t stored = ReadHeader().stored;
    in_.seekg(static_cast<std::streamoff>(stored), std::ios::cur);
    left_ -= stored;
  }
}

void SectionReader::Damaged(const std::string& what) const { ByteReader("", name_).Damaged(what); }

void SectionReader::Read(void* data, std::size_t size) {
  if (size > left_) Damaged("it ends too early");
  in_.read(static_cast<char*>(data), static_cast<std::streamsize>(size));
  if (!in_) Damaged("it can't be read to its end");
  left_ -= size;
}

}  // namespace tutti::internal
