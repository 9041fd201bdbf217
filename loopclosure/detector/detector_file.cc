#include "loopclosure/detector/detector_file.h"

#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "core/byte_stream.h"
#include "core/parallel.h"
#include "loopclosure/geometry/view_bytes.h"
#include "tutti/core/error.h"

namespace tutti::internal {

using Kind = LocationStore::Kind;
using State = LocationMemory::State;

namespace {

enum class Section : std::uint32_t {
  kOptions = 1,
  kMember = kMemberSection,
  kMemory,
  kUnion,
  kView = kViewSection,
  kRecord,
  kStatistics,
  kEndOfDetector,
  kPositions,  // in a file that holds more
  kSecondWord
};

// True for a record that memory does not hold; those of other locations may be stored as well.
bool OnlyInStore(const DetectorState& state, Kind kind, std::int64_t a, std::int64_t b) {
  const std::size_t number = static_cast<std::size_t>(a);
  const int index = static_cast<int>(b);
  if (kind == Kind::kWord) {
    return number < state.members().size() && !state.members()[number].vocabulary().Has(index);
  }
  const auto& systems = state.reasoner().systems();
  if (number >= systems.size() || index < 0 || index >= state.memory().size()) return false;
  if (kind == Kind::kView) return state.memory().state(index) == State::kLongTerm;
  return systems[number]->memory().state(index) == State::kLongTerm;
}

std::uint32_t Tag(Section section) { return static_cast<std::uint32_t>(section); }

void SaveLongTerm(const DetectorState& state, LocationStore& store, const SectionSink& out) {
  for (const Kind kind : {Kind::kSignature, Kind::kView, Kind::kWord}) {
    store.ForEach(kind, [&](std::int64_t a, std::int64_t b, std::string_view bytes) {
      if (!OnlyInStore(state, kind, a, b)) return;
      ByteWriter record;
      record.Put(static_cast<std::int32_t>(kind));
      record.Put(a);
      record.Put(b);
      record.PutString(bytes);
      out(Tag(Section::kRecord), record.bytes());
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

// The descriptors of a member's features in views, in their order: most of its words are among them.
std::vector<PackedMat> DescriptorsOf(std::size_t member, const std::vector<const View*>& views) {
  std::vector<PackedMat> all;
  for (const View* view : views) {
    if (member < view->members.size()) all.push_back(view->members[member].descriptors);
  }
  return all;
}

template <typename Save>
void Write(Section section, const SectionSink& out, const Save& save) {
  ByteWriter bytes;
  save(bytes);
  out(Tag(section), bytes.bytes());
}

}  // namespace

void SaveDetector(const DetectorState& state, LongTermMemory& long_term, const std::filesystem::path& file) {
  SectionWriter out(file, kDetectorFile);
  SaveDetector(state, long_term, Positions::kForget,
               [&out](std::uint32_t tag, std::string_view bytes) { out.Write(tag, bytes); });
  out.Finish();
}

void SaveDetector(const DetectorState& state, LongTermMemory& long_term, Positions positions,
                  const SectionSink& out) {
  const PlaceReasoner& reasoner = state.reasoner();
  Write(Section::kOptions, out, [&](ByteWriter& bytes) {
    bytes.PutString(reasoner.Fingerprint());
    bytes.Put(state.options().seed);
  });
  out(Tag(Section::kStatistics), state.Statistics());
  std::vector<const View*> views;
  for (int slot = 0; slot < state.memory().size(); ++slot) {
    if (!reasoner.InMemory(slot)) continue;
    views.push_back(&state.view(slot));
    Write(Section::kView, out, [&](ByteWriter& bytes) {
      bytes.Put<std::int32_t>(slot);
      SaveView(state.view(slot), bytes);
    });
  }
  for (std::size_t m = 0; m < state.members().size(); ++m) {
    Write(Section::kMember, out,
          [&](ByteWriter& bytes) { state.members()[m].vocabulary().Save(DescriptorsOf(m, views), bytes); });
  }
  for (const auto& system : reasoner.systems()) {
    Write(Section::kMemory, out, [&](ByteWriter& bytes) { system->Save(bytes); });
  }
  Write(Section::kUnion, out, [&](ByteWriter& bytes) { reasoner.union_of_all().Save(bytes); });
  if (positions == Positions::kKeep) {
    Write(Section::kPositions, out, [&](ByteWriter& bytes) { reasoner.track().Save(bytes); });
  }
  Write(Section::kSecondWord, out, [&](ByteWriter& bytes) { reasoner.second_word().Save(bytes); });
  if (long_term.has_store()) SaveLongTerm(state, long_term.store(), out);
  out(Tag(Section::kEndOfDetector), "");
}

SavedDetector::SavedDetector(const std::filesystem::path& file)
    : own_(std::make_unique<SectionReader>(file, kDetectorFile)), in_(*own_) {
  ReadOptions();
}

SavedDetector::SavedDetector(SectionReader* in) : in_(*in) { ReadOptions(); }

void SavedDetector::ReadOptions() {
  const std::string options = in_.Expect(Section::kOptions);
  ByteReader bytes(options, in_.name());
  fingerprint_ = bytes.GetString();
  seed_ = bytes.Get<std::uint64_t>();
}

template <typename Take>
void SavedDetector::Read(const std::string& content, const Take& take) const {
  ByteReader bytes(content, in_.name());
  take(bytes);
  if (!bytes.AtEnd()) bytes.Damaged("a section is too long");
}

template <typename Take>
void SavedDetector::Load(std::uint32_t section, const Take& take) {
  Read(in_.Expect(section), take);
}

void SavedDetector::LoadInto(DetectorState& state, LongTermMemory& long_term) {
  PlaceReasoner& reasoner = state.reasoner();
  if (fingerprint_ != reasoner.Fingerprint()) {
    throw InputError(in_.name() + ": was saved with another configuration (" + fingerprint_ +
                     "; here: " + reasoner.Fingerprint() + "); load it with the same members and memory");
  }
  Load(Tag(Section::kStatistics), [&](ByteReader& bytes) { state.LoadStatistics(bytes); });
  std::map<int, View> views = LoadViews();
  std::vector<const View*> in_order;
  in_order.reserve(views.size());
  for (const auto& [slot, view] : views) in_order.push_back(&view);
  std::vector<Member>& members = state.ensemble().members();
  std::vector<std::string> vocabularies;
  for (std::size_t m = 0; m < members.size(); ++m) vocabularies.push_back(in_.Expect(Section::kMember));
  RunParallel(static_cast<int>(members.size()), state.options().threads, [&](int member) {
    const auto m = static_cast<std::size_t>(member);
    Read(vocabularies[m],
         [&](ByteReader& bytes) { members[m].vocabulary().Load(DescriptorsOf(m, in_order), bytes); });
  });
  for (auto& system : reasoner.systems()) {
    Load(Tag(Section::kMemory), [&](ByteReader& bytes) { system->Load(bytes); });
  }
  Load(Tag(Section::kUnion), [&](ByteReader& bytes) { reasoner.union_of_all().Load(bytes); });
  state.CheckMemories(in_.name());
  for (auto& [slot, view] : views) {
    if (slot >= state.memory().size()) in_.Damaged("features of no location");
    state.LoadView(slot, std::move(view), in_.name());
  }
  for (int slot = 0; slot < state.memory().size(); ++slot) {
    if (reasoner.InMemory(slot) && !state.HasView(slot)) in_.Damaged("features of a location are missing");
  }
  LoadRest(state, long_term);
}

std::map<int, View> SavedDetector::LoadViews() {
  std::map<int, View> views;
  while (in_.Peek() == Tag(Section::kView)) {
    Load(Tag(Section::kView), [&](ByteReader& bytes) {
      const int slot = bytes.GetIndex(std::numeric_limits<int>::max());
      if (!views.empty() && slot <= views.rbegin()->first) bytes.Damaged("features out of order");
      views.emplace_hint(views.end(), slot, LoadView(bytes));
    });
  }
  return views;
}

void SavedDetector::LoadRest(DetectorState& state, LongTermMemory& long_term) {
  bool writing = false;
  std::string content;
  for (std::uint32_t tag = in_.Next(&content); tag != Tag(Section::kEndOfDetector);
       tag = in_.Next(&content)) {
    ByteReader bytes(content, in_.name());
    if (tag == Tag(Section::kPositions)) {
      state.reasoner().track().Load(bytes);
      continue;
    }
    if (tag == Tag(Section::kSecondWord)) {
      state.reasoner().second_word().Load(state.memory(), bytes);
      continue;
    }
    if (tag != Tag(Section::kRecord)) in_.Damaged("a section out of place");
    if (!writing) long_term.store().Begin();
    writing = true;
    LoadRecord(bytes, long_term.store());
  }
  if (writing) long_term.store().Commit();
  if (own_) own_->Expect(kEndOfSections);
}

}  // namespace tutti::internal
