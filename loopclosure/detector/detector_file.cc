// LoopDetector's Save and Load: one versioned file of sections, each with its length and checksum.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <system_error>

#include "loopclosure/detector/detector_impl.h"
#include "loopclosure/geometry/view_bytes.h"
#include "loopclosure/store/byte_stream.h"
#include "tutti/core/error.h"

namespace tutti {

using internal::ByteReader;
using internal::ByteWriter;
using Kind = internal::LocationStore::Kind;
using State = LocationMemory::State;

namespace {

constexpr char kMagic[8] = {'T', 'U', 'T', 'T', 'I', 'L', 'C', '\n'};
constexpr std::uint32_t kVersion = 5;
constexpr std::uint32_t kByteOrder = 0x01020304;  // reads as another number on a machine of the other order

enum class Tag : std::uint32_t { kOptions = 1, kMember, kMemory, kUnion, kView, kRecord, kStatistics, kEnd };

struct SectionHeader {
  std::uint32_t tag = 0;
  std::uint32_t crc = 0;
  std::uint64_t size = 0;
};

// Writes to a file beside the target, which takes its place when all is written.
class SectionWriter {
 public:
  explicit SectionWriter(const std::filesystem::path& file)
      : file_(file), part_(file.string() + ".part"), out_(part_, std::ios::binary | std::ios::trunc) {
    out_.write(kMagic, sizeof kMagic);
    out_.write(reinterpret_cast<const char*>(&kVersion), sizeof kVersion);
    out_.write(reinterpret_cast<const char*>(&kByteOrder), sizeof kByteOrder);
    Check();
  }
  ~SectionWriter() {
    if (finished_) return;
    out_.close();
    std::error_code ignored;
    std::filesystem::remove(part_, ignored);
  }
  SectionWriter(const SectionWriter&) = delete;
  SectionWriter& operator=(const SectionWriter&) = delete;

  void Write(Tag tag, const std::string& bytes) {
    const SectionHeader header = {static_cast<std::uint32_t>(tag), internal::Crc32(bytes), bytes.size()};
    out_.write(reinterpret_cast<const char*>(&header), sizeof header);
    out_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    Check();
  }

  void Finish() {
    Write(Tag::kEnd, "");
    out_.close();
    Check();
    std::error_code error;
    std::filesystem::rename(part_, file_, error);
    if (error) throw InputError(file_.string() + ": can't be written (" + error.message() + ")");
    finished_ = true;
  }

 private:
  void Check() const {
    if (!out_) {
      throw InputError(file_.string() +
                       ": can't be written (no such folder, no permission, or the disk is full); what was "
                       "there before is untouched");
    }
  }

  std::filesystem::path file_, part_;
  std::ofstream out_;
  bool finished_ = false;
};

class SectionReader {
 public:
  explicit SectionReader(const std::filesystem::path& file)
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

  // The next section's content.
  std::string Next(Tag& tag) {
    SectionHeader header;
    Read(&header, sizeof header);
    if (header.size > left_) Damaged("it ends too early");
    std::string bytes(static_cast<std::size_t>(header.size), '\0');
    Read(bytes.data(), bytes.size());
    if (internal::Crc32(bytes) != header.crc) Damaged("a checksum is wrong");
    if (header.tag < 1 || header.tag > static_cast<std::uint32_t>(Tag::kEnd)) Damaged("an unknown section");
    tag = static_cast<Tag>(header.tag);
    return bytes;
  }

  std::string Expect(Tag wanted) {
    Tag tag;
    std::string bytes = Next(tag);
    if (tag != wanted) Damaged("a section is missing");
    return bytes;
  }

  [[noreturn]] void Damaged(const std::string& what) const { ByteReader("", name_).Damaged(what); }
  const std::string& name() const { return name_; }

 private:
  void Read(void* data, std::size_t size) {
    if (size > left_) Damaged("it ends too early");
    in_.read(static_cast<char*>(data), static_cast<std::streamsize>(size));
    if (!in_) Damaged("it can't be read to its end");
    left_ -= size;
  }

  std::string name_;
  std::ifstream in_;
  std::uint64_t left_ = 0;
};

std::string RecordBytes(Kind kind, std::int64_t a, std::int64_t b, std::string_view bytes) {
  ByteWriter out;
  out.Put(static_cast<std::int32_t>(kind));
  out.Put(a);
  out.Put(b);
  out.PutString(bytes);
  return out.bytes();
}

}  // namespace

void LoopDetector::Impl::Save(const std::filesystem::path& file) const {
  SectionWriter out(file);
  ByteWriter options;
  options.PutString(reasoner_.Fingerprint());
  options.Put(options_.seed);
  out.Write(Tag::kOptions, options.bytes());
  out.Write(Tag::kStatistics, Statistics());
  for (const Member& member : members_) {
    ByteWriter bytes;
    member.vocabulary().Save(bytes);
    out.Write(Tag::kMember, bytes.bytes());
  }
  for (const auto& system : systems()) {
    ByteWriter bytes;
    system->Save(bytes);
    out.Write(Tag::kMemory, bytes.bytes());
  }
  ByteWriter graph;
  union_of_all().Save(graph);
  out.Write(Tag::kUnion, graph.bytes());
  for (int slot = 0; slot < memory().size(); ++slot) {
    if (!InMemory(slot)) continue;
    ByteWriter bytes;
    bytes.Put<std::int32_t>(slot);
    internal::SaveView(views_[Index(slot)], bytes);
    out.Write(Tag::kView, bytes.bytes());
  }
  if (store_) SaveLongTerm([&](const std::string& record) { out.Write(Tag::kRecord, record); });
  out.Finish();
}

// Records of locations that are in no memory; those of others may be there as well, but are not needed.
void LoopDetector::Impl::SaveLongTerm(const std::function<void(const std::string&)>& write) const {
  const auto needed = [this](Kind kind, std::int64_t a, std::int64_t b) {
    const std::size_t number = static_cast<std::size_t>(a);
    const int index = static_cast<int>(b);
    if (kind == Kind::kWord) {
      return number < members_.size() && !members_[number].vocabulary().Has(index);
    }
    if (number >= systems().size() || index < 0 || index >= memory().size()) return false;
    if (kind == Kind::kView) return !InMemory(index);
    return systems()[number]->memory().state(index) == State::kLongTerm;
  };
  for (const Kind kind : {Kind::kSignature, Kind::kView, Kind::kWord}) {
    store_->ForEach(kind, [&](std::int64_t a, std::int64_t b, std::string_view bytes) {
      if (needed(kind, a, b)) write(RecordBytes(kind, a, b, bytes));
    });
  }
}

std::unique_ptr<LoopDetector::Impl> LoopDetector::Impl::Load(const std::filesystem::path& file,
                                                             const LoopDetectorOptions& options) {
  SectionReader in(file);
  const std::string configuration = in.Expect(Tag::kOptions);
  ByteReader header(configuration, in.name());
  const std::string fingerprint = header.GetString();
  LoopDetectorOptions own = options;
  own.ltm_file.clear();
  own.seed = header.Get<std::uint64_t>();
  auto loaded = std::make_unique<Impl>(own);
  if (fingerprint != loaded->reasoner_.Fingerprint()) {
    throw InputError(in.name() + ": was saved with another configuration (" + fingerprint + "; here: " +
                     loaded->reasoner_.Fingerprint() + "); load it with the same members and memory");
  }
  loaded->options_.ltm_file = options.ltm_file;
  const auto section = [&](Tag tag, const std::function<void(ByteReader&)>& read) {
    const std::string bytes = in.Expect(tag);
    ByteReader reader(bytes, in.name());
    read(reader);
    if (!reader.AtEnd()) reader.Damaged("a section is too long");
  };
  section(Tag::kStatistics, [&](ByteReader& bytes) { loaded->LoadStatistics(bytes); });
  for (Member& member : loaded->members_) {
    section(Tag::kMember, [&](ByteReader& bytes) { member.vocabulary().Load(bytes); });
  }
  for (auto& system : loaded->systems()) {
    section(Tag::kMemory, [&](ByteReader& bytes) { system->Load(bytes); });
  }
  section(Tag::kUnion, [&](ByteReader& bytes) { loaded->union_of_all().Load(bytes); });
  loaded->LoadViewsAndRecords(
      [&](bool& is_view, std::string& bytes) {
        Tag tag;
        bytes = in.Next(tag);
        if (tag == Tag::kEnd) return false;
        if (tag != Tag::kView && tag != Tag::kRecord) in.Damaged("a section out of place");
        is_view = tag == Tag::kView;
        return true;
      },
      in.name());
  return loaded;
}

// The memories, and the one of what is in any of them, must be about the same locations.
void LoopDetector::Impl::CheckMemories(const std::string& source) const {
  const ByteReader in("", source);
  const int size = memory().size();
  const std::int64_t newest = size > 0 ? memory().id(size - 1) : -1;
  if (newest != last_id_) in.Damaged("the last location is missing");
  for (const auto& system : systems()) {
    if (system->memory().size() != size) in.Damaged("the memories are of different lengths");
    for (int slot = 0; slot < size; ++slot) {
      if (system->memory().id(slot) != memory().id(slot)) in.Damaged("memories of different locations");
    }
  }
  for (int slot = 0; slot < size; ++slot) {
    const State state = memory().state(slot);
    if (InMemory(slot) != (state == State::kShortTerm || state == State::kWorking)) {
      in.Damaged("a location that is in no memory");
    }
  }
}

// `next` gives one section after the other, and false at the end.
void LoopDetector::Impl::LoadViewsAndRecords(const std::function<bool(bool&, std::string&)>& next,
                                             const std::string& source) {
  const int size = memory().size();
  CheckMemories(source);
  views_.resize(Index(size));
  bool is_view = false;
  std::string section;
  bool writing = false;
  while (next(is_view, section)) {
    ByteReader bytes(section, source);
    if (is_view) {
      const int slot = bytes.GetIndex(size);
      LoadView(slot, bytes);
      continue;
    }
    const auto kind = bytes.Get<std::int32_t>();
    const auto a = bytes.Get<std::int64_t>();
    const auto b = bytes.Get<std::int64_t>();
    const bool known = kind >= static_cast<int>(Kind::kSignature) && kind <= static_cast<int>(Kind::kWord);
    if (!known || a < 0 || b < 0) bytes.Damaged("an unknown record");
    if (!writing) store().Begin();
    writing = true;
    store().Put(static_cast<Kind>(kind), a, b, bytes.GetString());
  }
  if (writing) store().Commit();
  for (int slot = 0; slot < size; ++slot) {
    if (InMemory(slot) && views_[Index(slot)].members.empty()) {
      ByteReader("", source).Damaged("features of a location are missing");
    }
  }
}

void LoopDetector::Load(const std::filesystem::path& file) {
  std::unique_ptr<Impl> loaded = Impl::Load(file, impl_->options());
  if (impl_->has_durable_store()) loaded->MoveInto(impl_->store_pointer());
  impl_ = std::move(loaded);
}

}  // namespace tutti
