// LoopDetector's long-term memory: retrieval, transfer, and the file that outlives the process.
#include <algorithm>

#include "loopclosure/detector/detector_impl.h"
#include "loopclosure/geometry/view_bytes.h"
#include "loopclosure/store/byte_stream.h"
#include "tutti/core/error.h"

namespace tutti {

using internal::ByteReader;
using internal::ByteWriter;
using internal::LocationStore;
using internal::MemorySystem;
using Kind = internal::LocationStore::Kind;
using State = LocationMemory::State;

namespace {

// Meta records: what the file belongs to, and the members' running figures.
constexpr int kFingerprint = 0;
constexpr int kStatistics = 1;

}  // namespace

LocationStore& LoopDetector::Impl::store() {
  if (!store_) store_ = std::make_unique<LocationStore>("");
  return *store_;
}

// Step 7 of section 1.
void LoopDetector::Impl::Retrieve(int best, LoopResult& result) {
  if (!store_) return;  // nothing has ever left
  std::set<int> retrieved;
  for (auto& system : systems()) {
    for (const int slot : system->Retrieve(best, store(), result.warning)) retrieved.insert(slot);
  }
  for (const int slot : retrieved) {
    result.retrieved.push_back(memory().id(slot));
    if (!Shared()) union_of_all().Retrieve(slot);
    if (!views_[Index(slot)].members.empty()) continue;  // another member's memory still had it
    try {
      FetchView(slot);
    } catch (const InputError& error) {
      result.warning = error.what();  // its words are there; it can't be verified
      View& without_features = views_[Index(slot)];
      without_features.id = memory().id(slot);
      without_features.size = {1, 1};
      without_features.members.resize(members_.size());
    }
  }
}

void LoopDetector::Impl::FetchView(int slot) {
  const auto record = store().Get(Kind::kView, 0, slot);
  if (!record) {
    throw InputError(store().name() + ": is damaged (the features of location " +
                     std::to_string(memory().id(slot)) +
                     " are missing); give another file, or an older copy");
  }
  ByteReader in(*record, store().name());
  LoadView(slot, in);
}

// Features of a stored location.
void LoopDetector::Impl::LoadView(int slot, ByteReader& in) {
  View view = internal::LoadView(in);
  if (view.id != memory().id(slot)) in.Damaged("features of another location");
  if (view.members.size() != members_.size()) in.Damaged("features of other members");
  const cv::Mat& own = view.caller.descriptors;
  if (!own.empty() && (own.type() != caller_type_ || own.cols != caller_width_)) {
    in.Damaged("features of another kind");
  }
  views_[Index(slot)] = std::move(view);
}

void LoopDetector::Impl::PutView(int slot) {
  ByteWriter record;
  internal::SaveView(views_[Index(slot)], record);
  store().Put(Kind::kView, 0, slot, record.bytes());
}

// Step 8 of section 1.
void LoopDetector::Impl::Shrink(int best, double elapsed_ms, LoopResult& result) {
  std::vector<int> retrieved;
  for (const std::int64_t id : result.retrieved) retrieved.push_back(memory().Find(id));
  for (auto& system : systems()) {
    int surplus = 0;
    if (options_.wm_limit > 0) {
      surplus = static_cast<int>(system->memory().working_memory().size()) - options_.wm_limit;
    }
    // Over the time budget more must go than came: this image and what was retrieved.
    if (options_.time_budget_ms > 0 && elapsed_ms > options_.time_budget_ms) {
      surplus = std::max(surplus, 2 + static_cast<int>(retrieved.size()));
    }
    for (; surplus > 0; --surplus) {
      const int slot = system->NextToTransfer(best, retrieved);
      if (slot < 0 || !Transfer(*system, slot, result)) break;
    }
  }
}

// One location from WM to LTM. It stays where it is if it can't be stored.
bool LoopDetector::Impl::Transfer(MemorySystem& system, int slot, LoopResult& result) {
  if (store().durable()) {
    if (unstored_slots_.count(slot) > 0) return false;  // the journal could not be written: see there
  } else {
    try {
      store().Begin();
      system.Store(slot, store());
      PutView(slot);
      store().Commit();
    } catch (const InputError& error) {
      store().Rollback();
      result.warning = error.what();
      return false;
    }
  }
  system.Leave(slot);
  if (!InMemory(slot)) {
    views_[Index(slot)] = View();
    if (!Shared()) union_of_all().Transfer(slot);
    result.transferred.push_back(memory().id(slot));
  }
  return true;
}

// A durable store learns of every image before Detect returns, in one step.
void LoopDetector::Impl::Journal(int new_slot, LoopResult& result) {
  const std::vector<int> changed_union = union_of_all().TakeChanged();
  std::vector<std::vector<int>> changed;
  for (auto& system : systems()) changed.push_back(system->memory().TakeChanged());
  if (!store_ || !store_->durable()) return;

  unstored_slots_.insert(new_slot);
  for (std::size_t s = 0; s < systems().size(); ++s) {
    unstored_nodes_[s].insert(changed[s].begin(), changed[s].end());
  }
  unstored_nodes_.back().insert(changed_union.begin(), changed_union.end());
  try {
    store_->Begin();
    WriteUnstored();
    store_->Commit();
  } catch (const InputError& error) {
    store_->Rollback();
    result.warning = std::string(error.what()) + " (everything is still in memory, and is tried again)";
    return;
  }
  MarkStored();
}

void LoopDetector::Impl::WriteUnstored() {
  for (const int slot : unstored_slots_) {
    if (!InMemory(slot)) continue;  // merged away
    for (auto& system : systems()) system->StoreSignatures(slot, *store_);
    PutView(slot);
  }
  WriteWords();
  for (std::size_t s = 0; s < systems().size(); ++s) {
    internal::StoreNodes(systems()[s]->memory(), static_cast<int>(s), unstored_nodes_[s], *store_);
  }
  internal::StoreNodes(union_of_all(), UnionNumber(), unstored_nodes_.back(), *store_);
  store_->Put(Kind::kMeta, kStatistics, 0, Statistics());
}

void LoopDetector::Impl::MarkStored() {
  unstored_slots_.clear();
  for (std::set<int>& nodes : unstored_nodes_) nodes.clear();
  for (std::size_t k = 0; k < members_.size(); ++k) stored_words_[k] = members_[k].vocabulary().created();
}

void LoopDetector::Impl::WriteWords() {
  for (std::size_t k = 0; k < members_.size(); ++k) {
    const Vocabulary& vocabulary = members_[k].vocabulary();
    for (int word = stored_words_[k]; word < vocabulary.created(); ++word) {
      if (!vocabulary.Has(word)) continue;  // gone again with a location that was merged
      internal::StoreWord(vocabulary, k, word, *store_);
    }
  }
}

void LoopDetector::Impl::MoveInto(std::unique_ptr<LocationStore>& target) {
  std::swap(store_, target);
  for (int slot = 0; slot < memory().size(); ++slot) {
    unstored_slots_.insert(slot);
    for (std::set<int>& nodes : unstored_nodes_) nodes.insert(slot);
  }
  if (Shared()) unstored_nodes_.back().clear();
  try {
    store_->Begin();
    store_->Clear();
    store_->Put(Kind::kMeta, kFingerprint, 0, reasoner_.Fingerprint());
    for (const Kind kind : {Kind::kSignature, Kind::kView, Kind::kWord}) {
      if (!target) break;
      target->ForEach(kind, [&](std::int64_t a, std::int64_t b, std::string_view bytes) {
        store_->Put(kind, a, b, bytes);
      });
    }
    WriteUnstored();
    store_->Commit();
  } catch (const InputError&) {
    store_->Rollback();
    std::swap(store_, target);
    throw;
  }
  MarkStored();
}

std::string LoopDetector::Impl::Statistics() const {
  ByteWriter out;
  out.Put(last_id_);
  out.Put<std::int32_t>(caller_type_);
  out.Put<std::int32_t>(caller_width_);
  for (const Member& member : members_) member.SaveStatistics(out);
  reasoner_.SaveStatistics(out);
  return out.bytes();
}

void LoopDetector::Impl::LoadStatistics(ByteReader& in) {
  last_id_ = in.Get<std::int64_t>();
  caller_type_ = in.Get<std::int32_t>();
  caller_width_ = in.Get<std::int32_t>();
  const bool known_type = caller_type_ == -1 || caller_type_ == CV_8U || caller_type_ == CV_32F;
  if (last_id_ < -1 || !known_type) in.Damaged("the detector's statistics");
  for (Member& member : members_) member.LoadStatistics(in);
  reasoner_.LoadStatistics(last_id_, in);
}

void LoopDetector::Impl::Reopen() {
  const auto fingerprint = store_->Get(Kind::kMeta, kFingerprint, 0);
  if (!fingerprint) {
    store_->Put(Kind::kMeta, kFingerprint, 0, reasoner_.Fingerprint());
    return;
  }
  if (*fingerprint != reasoner_.Fingerprint()) {
    throw InputError(store_->name() + ": belongs to another configuration (" + *fingerprint + "; here: " +
                     reasoner_.Fingerprint() + "); give another file, or the same members and memory");
  }
  const auto statistics = store_->Get(Kind::kMeta, kStatistics, 0);
  if (!statistics) return;  // nothing was detected yet
  ByteReader in(*statistics, store_->name());
  LoadStatistics(in);
  for (auto& system : systems()) system->Reopen(*store_);
  if (!Shared()) internal::LoadNodes(UnionNumber(), *store_, union_of_all());
  for (const auto& system : systems()) {
    if (system->memory().size() != memory().size()) in.Damaged("the memories are of different lengths");
  }
  views_.resize(Index(memory().size()));
  for (int slot = 0; slot < memory().size(); ++slot) {
    if (InMemory(slot)) FetchView(slot);
  }
  for (std::size_t k = 0; k < members_.size(); ++k) stored_words_[k] = members_[k].vocabulary().created();
}

}  // namespace tutti
