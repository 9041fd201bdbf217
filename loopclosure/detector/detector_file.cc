#include "loopclosure/detector/detector_file.h"

#include <string_view>
#include <utility>
#include <vector>

#include "core/numbers.h"
#include "core/parallel.h"
#include "core/state_archive.h"
#include "tutti/core/error.h"

namespace tutti::internal {

using Kind = LocationStore::Kind;

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
  if (kind == Kind::kView) return state.memory().state(index) == LocationState::kLongTerm;
  return systems[number]->memory().state(index) == LocationState::kLongTerm;
}

std::uint32_t Tag(Section section) { return static_cast<std::uint32_t>(section); }

void SaveLongTerm(const DetectorState& state, LocationStore& store, const SectionSink& out) {
  for (const Kind kind : {Kind::kSignature, Kind::kView, Kind::kWord}) {
    store.ForEach(kind, [&](std::int64_t a, std::int64_t b, std::string_view bytes) {
      if (!OnlyInStore(state, kind, a, b)) return;
      out(Tag(Section::kRecord), StateBytes(kind, a, b, std::string(bytes)));
    });
  }
}

// The descriptors of a member's features in views, in their order: most of its words are among them.
std::vector<PackedMat> DescriptorsOf(std::size_t member, const std::vector<const View*>& views) {
  std::vector<PackedMat> all;
  for (const View* view : views) {
    if (member < view->members.size()) all.push_back(view->members[member].descriptors);
  }
  return all;
}

}  // namespace

void SaveDetector(DetectorState& state, LongTermMemory& long_term, const std::filesystem::path& file) {
  SectionWriter out(file, kDetectorFile);
  SaveDetector(state, long_term, Positions::kForget,
               [&out](std::uint32_t tag, std::string_view bytes) { out.Write(tag, bytes); });
  out.Finish();
}

void SaveDetector(DetectorState& state, LongTermMemory& long_term, Positions positions,
                  const SectionSink& out) {
  PlaceReasoner& reasoner = state.reasoner();
  const auto write = [&out](Section section, const auto&... values) {
    out(Tag(section), StateBytes(values...));
  };
  write(Section::kOptions, reasoner.Fingerprint(), state.options().seed);
  write(Section::kStatistics, state);
  std::vector<const View*> views;
  for (int slot = 0; slot < state.memory().size(); ++slot) {
    if (!reasoner.InMemory(slot)) continue;
    views.push_back(&state.view(slot));
    write(Section::kView, slot, state.view(slot));
  }
  std::vector<Member>& members = state.ensemble().members();
  for (std::size_t m = 0; m < members.size(); ++m)
    write(Section::kMember, Vocabulary::Beside{&members[m].vocabulary(), DescriptorsOf(m, views)});
  for (const auto& system : reasoner.systems()) write(Section::kMemory, *system);
  write(Section::kUnion, reasoner.union_of_all());
  if (positions == Positions::kKeep) write(Section::kPositions, reasoner.track());
  write(Section::kSecondWord, reasoner.second_word());
  if (long_term.has_store()) SaveLongTerm(state, long_term.store(), out);
  write(Section::kEndOfDetector);
}

SavedDetector::SavedDetector(const std::filesystem::path& file)
    : own_(std::make_unique<SectionReader>(file, kDetectorFile)), in_(*own_) {
  ReadOptions();
}

SavedDetector::SavedDetector(SectionReader* in) : in_(*in) { ReadOptions(); }

void SavedDetector::ReadOptions() {
  ReadStateBytes(in_.Expect(Section::kOptions), in_.name(), fingerprint_, seed_);
}

void SavedDetector::LoadInto(DetectorState& state, LongTermMemory& long_term) {
  PlaceReasoner& reasoner = state.reasoner();
  if (fingerprint_ != reasoner.Fingerprint()) {
    throw InputError(in_.name() + ": was saved with another configuration (" + fingerprint_ +
                     "; here: " + reasoner.Fingerprint() + "); load it with the same members and memory");
  }
  const auto read = [this](Section section, auto& value) {
    ReadStateBytes(in_.Expect(section), in_.name(), value);
  };
  read(Section::kStatistics, state);
  std::map<int, View> views = LoadViews();
  std::vector<const View*> in_order;
  in_order.reserve(views.size());
  for (const auto& [slot, view] : views) in_order.push_back(&view);
  std::vector<Member>& members = state.ensemble().members();
  std::vector<std::string> vocabularies;
  for (std::size_t m = 0; m < members.size(); ++m) vocabularies.push_back(in_.Expect(Section::kMember));
  RunParallel(static_cast<int>(members.size()), state.options().threads, [&](int member) {
    const auto m = Index(member);
    ReadStateBytes(vocabularies[m], in_.name(),
                   Vocabulary::Beside{&members[m].vocabulary(), DescriptorsOf(m, in_order)});
  });
  for (auto& system : reasoner.systems()) read(Section::kMemory, *system);
  read(Section::kUnion, reasoner.union_of_all());
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
    int slot = 0;
    View view;
    ReadStateBytes(in_.Expect(Section::kView), in_.name(), slot, view);
    if (slot < 0 || (!views.empty() && slot <= views.rbegin()->first)) in_.Damaged("features out of order");
    views.emplace_hint(views.end(), slot, std::move(view));
  }
  return views;
}

void SavedDetector::LoadRest(DetectorState& state, LongTermMemory& long_term) {
  bool writing = false;
  std::string content;
  for (std::uint32_t tag = in_.Next(&content); tag != Tag(Section::kEndOfDetector);
       tag = in_.Next(&content)) {
    SharedObjectsIn none;
    StateReader in(content, in_.name(), &none);
    if (tag == Tag(Section::kPositions)) {
      in(state.reasoner().track());
    } else if (tag == Tag(Section::kSecondWord)) {
      in(state.reasoner().second_word());
      state.reasoner().second_word().Check(state.memory(), in);
    } else if (tag == Tag(Section::kRecord)) {
      Kind kind = Kind::kMeta;
      std::int64_t a = 0, b = 0;
      std::string record;
      in(kind, a, b, record);
      if (kind < Kind::kSignature || kind > Kind::kWord || a < 0 || b < 0) in.Damaged("an unknown record");
      if (!writing) long_term.store().Begin();
      writing = true;
      long_term.store().Put(kind, a, b, record);
    } else {
      in_.Damaged("a section out of place");
    }
    in.ExpectEnd();
  }
  if (writing) long_term.store().Commit();
  if (own_) own_->Expect(kEndOfSections);
}

}  // namespace tutti::internal
