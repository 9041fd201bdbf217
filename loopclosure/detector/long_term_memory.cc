#include "loopclosure/detector/long_term_memory.h"

#include <algorithm>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/state_archive.h"
#include "tutti/core/error.h"

namespace tutti::internal {

using Kind = LocationStore::Kind;

namespace {

// Meta records: what the file belongs to, and the detector's running figures.
constexpr int kFingerprint = 0;
constexpr int kStatistics = 1;

}  // namespace

Journal::Journal(DetectorState& state)
    : state_(state), nodes_(Memories().size()), stored_words_(state.members().size(), 0) {}

// By their number in the store.
std::vector<LocationMemory*> Journal::Memories() const {
  std::vector<LocationMemory*> memories;
  for (auto& system : state_.reasoner().systems()) memories.push_back(&system->memory());
  memories.push_back(&state_.reasoner().union_of_all());
  return memories;
}

void Journal::Note() {
  slots_.insert(state_.memory().size() - 1);
  const std::vector<LocationMemory*> memories = Memories();
  for (std::size_t m = 0; m < memories.size(); ++m) {
    const std::vector<int> changed = memories[m]->TakeChanged();
    nodes_[m].insert(changed.begin(), changed.end());
  }
}

void Journal::Clear() {
  slots_.clear();
  for (std::set<int>& nodes : nodes_) nodes.clear();
  for (std::size_t k = 0; k < stored_words_.size(); ++k) {
    stored_words_[k] = state_.members()[k].vocabulary().created();
  }
}

void Journal::Write(LocationStore& store) {
  store.InOneStep([&] { PutNoted(store); });
  Clear();
}

void Journal::PutNoted(LocationStore& store) const {
  for (const int slot : slots_) {
    if (!state_.reasoner().InMemory(slot)) continue;  // merged away
    for (const auto& system : state_.reasoner().systems()) system->StoreSignatures(slot, store);
    state_.StoreView(slot, store);
  }
  PutWords(store);
  const std::vector<LocationMemory*> memories = Memories();
  for (std::size_t m = 0; m < memories.size(); ++m) {
    StoreNodes(*memories[m], static_cast<int>(m), nodes_[m], store);
  }
  store.Put(Kind::kMeta, kStatistics, 0, StateBytes(state_));
}

void Journal::PutWords(LocationStore& store) const {
  for (std::size_t k = 0; k < stored_words_.size(); ++k) {
    const Vocabulary& vocabulary = state_.members()[k].vocabulary();
    for (int word = stored_words_[k]; word < vocabulary.created(); ++word) {
      if (!vocabulary.Has(word)) continue;  // gone again with a location that was merged
      StoreWord(vocabulary, k, word, store);
    }
  }
}

void Journal::Rewrite(LocationStore& store, LocationStore* long_term) {
  const std::vector<LocationMemory*> memories = Memories();
  for (int slot = 0; slot < state_.memory().size(); ++slot) slots_.insert(slot);
  for (std::size_t m = 0; m < memories.size(); ++m) {
    for (int slot = 0; slot < memories[m]->size(); ++slot) nodes_[m].insert(slot);
  }
  stored_words_.assign(stored_words_.size(), 0);
  store.InOneStep([&] {
    store.Clear();
    store.Put(Kind::kMeta, kFingerprint, 0, state_.reasoner().Fingerprint());
    for (const Kind kind : {Kind::kSignature, Kind::kView, Kind::kWord}) {
      if (long_term == nullptr) break;
      long_term->ForEach(kind, [&](std::int64_t a, std::int64_t b, std::string_view bytes) {
        store.Put(kind, a, b, bytes);
      });
    }
    PutNoted(store);
  });
  Clear();
}

void Journal::Reopen(LocationStore& store) {
  const std::string own = state_.reasoner().Fingerprint();
  const auto fingerprint = store.Get(Kind::kMeta, kFingerprint, 0);
  if (!fingerprint) {
    store.Put(Kind::kMeta, kFingerprint, 0, own);
    return;
  }
  if (*fingerprint != own) {
    throw InputError(store.name() + ": belongs to another configuration (" + *fingerprint + "; here: " + own +
                     "); give another file, or the same members and memory");
  }
  const auto statistics = store.Get(Kind::kMeta, kStatistics, 0);
  if (!statistics) return;  // nothing was detected yet
  ReadStateBytes(*statistics, store.name(), state_);
  PlaceReasoner& reasoner = state_.reasoner();
  for (auto& system : reasoner.systems()) system->Reopen(store);
  if (!reasoner.Shared()) {
    LoadNodes(static_cast<int>(reasoner.systems().size()), store, reasoner.union_of_all());
  }
  state_.CheckMemories(store.name());
  for (int slot = 0; slot < state_.memory().size(); ++slot) {
    if (reasoner.InMemory(slot)) state_.FetchView(slot, store);
  }
  Clear();
}

LocationStore& LongTermMemory::store() {
  if (!store_) store_ = std::make_unique<LocationStore>("");
  return *store_;
}

void LongTermMemory::Open() {
  if (state_.options().ltm_file.empty()) return;
  store_ = std::make_unique<LocationStore>(state_.options().ltm_file);
  journal_.Reopen(*store_);
}

void LongTermMemory::TakeFile(LongTermMemory& other) {
  if (!other.store_ || !other.store_->durable()) return;
  journal_.Rewrite(*other.store_, store_.get());
  std::swap(store_, other.store_);
}

void LongTermMemory::Retrieve(int best, LoopResult& result) {
  if (!store_) return;  // nothing has ever left
  PlaceReasoner& reasoner = state_.reasoner();
  std::set<int> retrieved;
  for (auto& system : reasoner.systems()) {
    for (const int slot : system->Retrieve(best, *store_, result.warning)) retrieved.insert(slot);
  }
  for (const int slot : retrieved) {
    result.retrieved.push_back(state_.memory().id(slot));
    if (!reasoner.Shared()) reasoner.union_of_all().Retrieve(slot);
    if (state_.HasView(slot)) continue;  // another member's memory still had it
    try {
      state_.FetchView(slot, *store_);
    } catch (const InputError& error) {
      result.warning = error.what();  // its words are there; it can't be verified
      state_.PutViewWithoutFeatures(slot);
    }
  }
}

void LongTermMemory::Shrink(int best, double elapsed_ms, LoopResult& result) {
  const LoopDetectorOptions& options = state_.options();
  std::vector<int> retrieved;
  for (const std::int64_t id : result.retrieved) retrieved.push_back(state_.memory().Find(id));
  for (auto& system : state_.reasoner().systems()) {
    int surplus = 0;
    if (options.wm_limit > 0) {
      surplus = static_cast<int>(system->memory().working_memory().size()) - options.wm_limit;
    }
    // Over the time budget more must go than came: this image and what was retrieved.
    if (options.time_budget_ms > 0 && elapsed_ms > options.time_budget_ms) {
      surplus = std::max(surplus, 2 + static_cast<int>(retrieved.size()));
    }
    for (; surplus > 0; --surplus) {
      const int slot = system->NextToTransfer(best, retrieved);
      if (slot < 0 || !Transfer(*system, slot, result)) break;
    }
  }
}

// One location from WM to LTM. It stays where it is if it can't be stored.
bool LongTermMemory::Transfer(MemorySystem& system, int slot, LoopResult& result) {
  if (store().durable()) {
    if (!journal_.Holds(slot)) return false;  // it could not be written: see Record
  } else {
    try {
      store_->InOneStep([&] {
        system.Store(slot, *store_);
        state_.StoreView(slot, *store_);
      });
    } catch (const InputError& error) {
      result.warning = error.what();
      return false;
    }
  }
  system.Leave(slot);
  PlaceReasoner& reasoner = state_.reasoner();
  if (!reasoner.InMemory(slot)) {
    state_.DropView(slot);
    if (!reasoner.Shared()) reasoner.union_of_all().Transfer(slot);
    result.transferred.push_back(state_.memory().id(slot));
  }
  return true;
}

void LongTermMemory::Record(LoopResult& result) {
  journal_.Note();
  if (!store_ || !store_->durable()) {
    journal_.Clear();
    return;
  }
  try {
    journal_.Write(*store_);
  } catch (const InputError& error) {
    result.warning = std::string(error.what()) + " (everything is still in memory, and is tried again)";
  }
}

}  // namespace tutti::internal
