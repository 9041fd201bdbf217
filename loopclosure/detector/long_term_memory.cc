#include "loopclosure/detector/long_term_memory.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tutti/core/error.h"

namespace tutti::internal {

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
