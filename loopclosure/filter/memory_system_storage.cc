// What a memory keeps elsewhere: in long-term memory, and in a detector's file.
#include <set>

#include "loopclosure/filter/memory_system.h"
#include "loopclosure/store/packed_mat.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

constexpr int kRetrievalLevels = 10;  // LTM is searched this far from the hypothesis
constexpr int kImmuneLevels = 2;      // what is so near to the hypothesis stays in WM

}  // namespace

void StoreNodes(const LocationMemory& memory, int number, const std::set<int>& slots, LocationStore& store) {
  for (const int slot : slots) {
    ByteWriter record;
    memory.SaveSlot(slot, record);
    store.Put(LocationStore::Kind::kNode, number, slot, record.bytes());
  }
}

void LoadNodes(int number, LocationStore& store, LocationMemory& memory) {
  store.ForEach(LocationStore::Kind::kNode,
                [&](std::int64_t stored_number, std::int64_t slot, std::string_view bytes) {
                  if (stored_number != number) return;
                  ByteReader in(bytes, store.name());
                  if (slot != memory.size()) {
                    in.Damaged("location " + std::to_string(memory.size()) + " is missing");
                  }
                  memory.LoadSlot(in);
                });
  memory.FinishLoading();
}

void StoreWord(const Vocabulary& vocabulary, std::size_t member, int word, LocationStore& store) {
  ByteWriter record;
  PackedMat(vocabulary.Descriptor(word)).Put(record);
  store.Put(LocationStore::Kind::kWord, static_cast<std::int64_t>(member), word, record.bytes());
}

std::vector<int> MemorySystem::Retrieve(int best, LocationStore& store, std::string& warning) {
  if (best < 0 || memory_.num_long_term() == 0 || options_.retrieval == 0) return {};
  std::vector<int> retrieved;
  for (const int slot : memory_.LongTermNeighbours(best, kRetrievalLevels, options_.retrieval)) {
    try {
      Restore(slot, store);
    } catch (const InputError& error) {
      warning = error.what();
      continue;
    }
    memory_.Retrieve(slot);
    transition_.Update(memory_, {slot});
    retrieved.push_back(slot);
  }
  return retrieved;
}

void MemorySystem::Restore(int slot, LocationStore& store) {
  const auto stored = store.Get(LocationStore::Kind::kSignature, number_, slot);
  if (!stored) {
    throw InputError(store.name() + ": is damaged (location " + std::to_string(memory_.id(slot)) +
                     " is missing); give another file, or an older copy");
  }
  const std::vector<UnitRecord> records = ReadRecord(*stored, store.name());
  // First everything that may fail, then the changes.
  std::vector<std::vector<int>> words(members_.size());
  std::vector<cv::Mat> descriptors(members_.size());
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const std::vector<Signature> parts =
        records[u].signature.Split(static_cast<int>(units_[u].members.size()));
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const std::size_t k = units_[u].members[p];
      words[k] = members_[k].vocabulary().Missing(parts[p]);
      for (const int word : words[k]) {
        if (word >= members_[k].vocabulary().created()) {
          throw InputError(store.name() + ": is damaged (a word that " + members_[k].name() +
                           " never made); give another file, or an older copy");
        }
        ReadWord(k, word, store, descriptors[k]);
      }
    }
  }
  for (std::size_t k = 0; k < members_.size(); ++k) {
    members_[k].vocabulary().Restore(words[k], descriptors[k]);
  }
  for (std::size_t u = 0; u < units_.size(); ++u) {
    units_[u].likelihood.Restore(slot, records[u].signature);
    if (units_[u].is_dense) units_[u].dense.Restore(slot, records[u].descriptor);
    Reference(units_[u], records[u].signature);
  }
}

// Appends a stored word's descriptor.
void MemorySystem::ReadWord(std::size_t member, int word, LocationStore& store, cv::Mat& descriptors) const {
  const auto record = store.Get(LocationStore::Kind::kWord, static_cast<std::int64_t>(member), word);
  cv::Mat row;
  if (record) {
    ByteReader in(*record, store.name());
    row = PackedMat::Get(in).Unpacked();
  }
  const bool fits = descriptors.empty() || (row.cols == descriptors.cols && row.type() == descriptors.type());
  if (row.rows != 1 || !fits || !members_[member].vocabulary().Problem(row).empty()) {
    throw InputError(store.name() + ": is damaged (word " + std::to_string(word) + " of " +
                     members_[member].name() + "); give another file, or an older copy");
  }
  descriptors.push_back(row);
}

int MemorySystem::NextToTransfer(int best, const std::vector<int>& retrieved) const {
  std::set<int> immune(retrieved.begin(), retrieved.end());
  if (best >= 0) {
    immune.insert(best);
    for (const auto& [slot, level, loops] : memory_.Neighbours(best, kImmuneLevels)) immune.insert(slot);
  }
  return memory_.NextToTransfer(options_.recent_share, immune);
}

void MemorySystem::Store(int slot, LocationStore& store) const {
  StoreSignatures(slot, store);
  for (const FilterUnit& unit : units_) {
    const std::vector<Signature> parts =
        unit.likelihood.signature(slot).Split(static_cast<int>(unit.members.size()));
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const std::size_t k = unit.members[p];
      for (const int word : members_[k].vocabulary().WordsOnlyIn(parts[p])) {
        StoreWord(members_[k].vocabulary(), k, word, store);
      }
    }
  }
}

void MemorySystem::Leave(int slot) {
  Forget(slot);
  memory_.Transfer(slot);
  transition_.Update(memory_, {slot});
}

void MemorySystem::Merge(int slot, int into) {
  std::vector<int> changed = {slot, into};
  for (const LocationMemory::Link& link : memory_.links(slot)) changed.push_back(link.slot);
  memory_.Merge(slot, into);
  Forget(slot);
  transition_.Update(memory_, changed);
}

// What the location looked like, and that the camera may be there.
void MemorySystem::Forget(int slot) {
  for (FilterUnit& unit : units_) {
    const Signature signature = unit.likelihood.signature(slot);
    unit.likelihood.Remove(slot);
    if (unit.is_dense) unit.dense.Remove(slot);
    Release(unit, signature);
    unit.filter.Forget(slot);
  }
  if (joint_) joint_->filter.Forget(slot);
}

void MemorySystem::StoreSignatures(int slot, LocationStore& store) const {
  store.Put(LocationStore::Kind::kSignature, number_, slot, Record(slot));
}

void MemorySystem::Reopen(LocationStore& store) {
  LoadNodes(number_, store, memory_);
  for (int slot = 0; slot < memory_.size(); ++slot) {
    const LocationMemory::State state = memory_.state(slot);
    for (FilterUnit& unit : units_) {
      unit.likelihood.Add(Signature());
      unit.likelihood.Remove(slot);
      if (unit.is_dense) unit.dense.AddAbsent(state == LocationMemory::State::kMerged);
    }
    if (state != LocationMemory::State::kShortTerm && state != LocationMemory::State::kWorking) continue;
    Restore(slot, store);
  }
  for (FilterUnit& unit : units_) {
    if (unit.is_dense) unit.dense.FinishLoading();
  }
  transition_.Update(memory_, memory_.working_memory());
}

std::string MemorySystem::Record(int slot) const {
  ByteWriter out;
  for (const FilterUnit& unit : units_) {
    if (unit.is_dense) {
      SaveDescriptor(unit.dense.descriptor(slot), out);
    } else {
      unit.likelihood.signature(slot).Save(out);
    }
  }
  return out.bytes();
}

std::vector<UnitRecord> MemorySystem::ReadRecord(std::string_view record, const std::string& source) const {
  ByteReader in(record, source);
  std::vector<UnitRecord> records(units_.size());
  for (std::size_t u = 0; u < units_.size(); ++u) {
    if (!units_[u].is_dense) {
      records[u].signature = Signature::Load(in);
      continue;
    }
    records[u].descriptor = LoadDescriptor(in);
    if (!units_[u].dense.Problem(records[u].descriptor).empty()) in.Damaged("descriptors of several widths");
  }
  return records;
}

void MemorySystem::Save(ByteWriter& out) const {
  memory_.Save(out);
  for (const FilterUnit& unit : units_) {
    unit.likelihood.Save(out);
    if (unit.is_dense) unit.dense.Save(out);
    unit.filter.Save(out);
    unit.alias.Save(out);
    unit.weight.Save(out);
  }
  if (!joint_) return;
  joint_->filter.Save(out);
  joint_->alias.Save(out);
  overlap_.Save(out);
}

void MemorySystem::LoadOverlap(ByteReader& in) {
  overlap_.Load(in);
  if (overlap_.members() != 0 && overlap_.members() != units_.size())
    in.Damaged("what members have in common");
}

void MemorySystem::SaveLevels(ByteWriter& out) const {
  for (const FilterUnit& unit : units_) {
    unit.alias.SaveLevel(out);
    unit.weight.Save(out);
  }
  if (!joint_) return;
  joint_->alias.SaveLevel(out);
  overlap_.Save(out);
}

void MemorySystem::LoadLevels(ByteReader& in) {
  for (FilterUnit& unit : units_) {
    unit.alias.LoadLevel(in);
    unit.weight.Load(in);
  }
  if (!joint_) return;
  joint_->alias.LoadLevel(in);
  LoadOverlap(in);
}

void MemorySystem::Load(ByteReader& in) {
  memory_.Load(in);
  for (FilterUnit& unit : units_) {
    unit.likelihood.Load(in);
    if (unit.is_dense) unit.dense.Load(in);
    unit.filter.Load(in);
    unit.alias.Load(in);
    unit.weight.Load(in);
    if (unit.likelihood.size() != memory_.size() || (unit.is_dense && unit.dense.size() != memory_.size()) ||
        static_cast<int>(unit.filter.posterior().places.size()) > memory_.size()) {
      in.Damaged("locations are missing");
    }
    for (int slot = 0; slot < memory_.size(); ++slot) {
      const LocationMemory::State state = memory_.state(slot);
      const bool in_memory =
          state == LocationMemory::State::kShortTerm || state == LocationMemory::State::kWorking;
      if (unit.likelihood.Has(slot) != in_memory || (unit.is_dense && unit.dense.Has(slot) != in_memory))
        in.Damaged("locations in memory without their words");
      const std::vector<Signature> parts =
          unit.likelihood.signature(slot).Split(static_cast<int>(unit.members.size()));
      for (std::size_t p = 0; p < parts.size(); ++p) {
        if (!members_[unit.members[p]].vocabulary().Missing(parts[p]).empty())
          in.Damaged("words are missing");
      }
    }
  }
  if (joint_) {
    joint_->filter.Load(in);
    joint_->alias.Load(in);
    LoadOverlap(in);
    if (static_cast<int>(joint_->filter.posterior().places.size()) > memory_.size()) {
      in.Damaged("locations are missing");
    }
  }
  transition_.Update(memory_, memory_.working_memory());
}

}  // namespace tutti::internal
