#include "loopclosure/detector/detector_file.h"

#include <string_view>

#include "loopclosure/geometry/view_bytes.h"
#include "loopclosure/store/byte_stream.h"
#include "tutti/core/error.h"

namespace tutti::internal {

using Kind = LocationStore::Kind;
using State = LocationMemory::State;

namespace {

// True for a record that memory does not hold; those of other locations may be stored as well.
bool OnlyInStore(const DetectorState& state, Kind kind, std::int64_t a, std::int64_t b) {
  const std::size_t number = static_cast<std::size_t>(a);
  const int index = static_cast<int>(b);
  if (kind == Kind::kWord) {
    return number < state.members().size() && !state.members()[number].vocabulary().Has(index);
  }
  const auto& systems = state.reasoner().systems();
  if (number >= systems.size() || index < 0 || index >= state.memory().size()) return false;
  if (kind == Kind::kView) return !state.reasoner().InMemory(index);
  return systems[number]->memory().state(index) == State::kLongTerm;
}

void SaveLongTerm(const DetectorState& state, LocationStore& store, SectionWriter& out) {
  for (const Kind kind : {Kind::kSignature, Kind::kView, Kind::kWord}) {
    store.ForEach(kind, [&](std::int64_t a, std::int64_t b, std::string_view bytes) {
      if (!OnlyInStore(state, kind, a, b)) return;
      ByteWriter record;
      record.Put(static_cast<std::int32_t>(kind));
      record.Put(a);
      record.Put(b);
      record.PutString(bytes);
      out.Write(Section::kRecord, record.bytes());
    });
  }
}

void LoadRecord(ByteReader& in, LocationStore& store) {
  const auto kind = in.Get<std::int32_t>();
  const auto a = in.Get<std::int64_t>();
  const auto b = in.Get<std::int64_t>();
  const bool known = kind >= static_cast<int>(Kind::kSignature) && kind <= static_cast<int>(Kind::kWord);
  if (!known || a < 0 || b < 0) in.Damaged("an unknown record");
  store.Put(static_cast<Kind>(kind), a, b, in.GetString());
}

template <typename Save>
void Write(Section section, SectionWriter& out, const Save& save) {
  ByteWriter bytes;
  save(bytes);
  out.Write(section, bytes.bytes());
}

}  // namespace

void SaveDetector(const DetectorState& state, LongTermMemory& long_term, const std::filesystem::path& file) {
  SectionWriter out(file);
  const PlaceReasoner& reasoner = state.reasoner();
  Write(Section::kOptions, out, [&](ByteWriter& bytes) {
    bytes.PutString(reasoner.Fingerprint());
    bytes.Put(state.options().seed);
  });
  out.Write(Section::kStatistics, state.Statistics());
  for (const Member& member : state.members()) {
    Write(Section::kMember, out, [&](ByteWriter& bytes) { member.vocabulary().Save(bytes); });
  }
  for (const auto& system : reasoner.systems()) {
    Write(Section::kMemory, out, [&](ByteWriter& bytes) { system->Save(bytes); });
  }
  Write(Section::kUnion, out, [&](ByteWriter& bytes) { reasoner.union_of_all().Save(bytes); });
  for (int slot = 0; slot < state.memory().size(); ++slot) {
    if (!reasoner.InMemory(slot)) continue;
    Write(Section::kView, out, [&](ByteWriter& bytes) {
      bytes.Put<std::int32_t>(slot);
      SaveView(state.view(slot), bytes);
    });
  }
  if (long_term.has_store()) SaveLongTerm(state, long_term.store(), out);
  out.Finish();
}

SavedDetector::SavedDetector(const std::filesystem::path& file) : in_(file) {
  const std::string options = in_.Expect(Section::kOptions);
  ByteReader bytes(options, in_.name());
  fingerprint_ = bytes.GetString();
  seed_ = bytes.Get<std::uint64_t>();
}

template <typename Read>
void SavedDetector::Load(Section section, const Read& read) {
  const std::string content = in_.Expect(section);
  ByteReader bytes(content, in_.name());
  read(bytes);
  if (!bytes.AtEnd()) bytes.Damaged("a section is too long");
}

void SavedDetector::LoadInto(DetectorState& state, LongTermMemory& long_term) {
  PlaceReasoner& reasoner = state.reasoner();
  if (fingerprint_ != reasoner.Fingerprint()) {
    throw InputError(in_.name() + ": was saved with another configuration (" + fingerprint_ +
                     "; here: " + reasoner.Fingerprint() + "); load it with the same members and memory");
  }
  Load(Section::kStatistics, [&](ByteReader& bytes) { state.LoadStatistics(bytes); });
  for (Member& member : state.ensemble().members()) {
    Load(Section::kMember, [&](ByteReader& bytes) { member.vocabulary().Load(bytes); });
  }
  for (auto& system : reasoner.systems()) {
    Load(Section::kMemory, [&](ByteReader& bytes) { system->Load(bytes); });
  }
  Load(Section::kUnion, [&](ByteReader& bytes) { reasoner.union_of_all().Load(bytes); });
  state.CheckMemories(in_.name());
  LoadViewsAndRecords(state, long_term);
}

void SavedDetector::LoadViewsAndRecords(DetectorState& state, LongTermMemory& long_term) {
  bool writing = false;
  Section section;
  for (std::string content = in_.Next(section); section != Section::kEnd; content = in_.Next(section)) {
    ByteReader bytes(content, in_.name());
    if (section == Section::kView) {
      const int slot = bytes.GetIndex(state.memory().size());
      state.LoadView(slot, bytes);
      continue;
    }
    if (section != Section::kRecord) in_.Damaged("a section out of place");
    if (!writing) long_term.store().Begin();
    writing = true;
    LoadRecord(bytes, long_term.store());
  }
  if (writing) long_term.store().Commit();
  for (int slot = 0; slot < state.memory().size(); ++slot) {
    if (state.reasoner().InMemory(slot) && !state.HasView(slot))
      in_.Damaged("features of a location are missing");
  }
}

}  // namespace tutti::internal
