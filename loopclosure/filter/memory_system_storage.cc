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

void StoreNodes(LocationMemory& memory, int number, const std::set<int>& slots, LocationStore& store) {
  for (const int slot : slots) {
    SharedObjectsOut none;
    StateWriter out(&none);
    memory.StateOfSlot(slot, out);
    store.Put(LocationStore::Kind::kNode, number, slot, out.Take());
  }
}

void LoadNodes(int number, LocationStore& store, LocationMemory& memory) {
  store.ForEach(LocationStore::Kind::kNode,
                [&](std::int64_t stored_number, std::int64_t slot, std::string_view bytes) {
                  if (stored_number != number) return;
                  SharedObjectsIn none;
                  StateReader in(bytes, store.name(), &none);
                  if (slot != memory.size()) {
                    in.Damaged("location " + std::to_string(memory.size()) + " is missing");
                  }
                  memory.StateOfSlot(memory.size(), in);
                  in.ExpectEnd();
                });
  memory.FinishLoading();
}

void StoreWord(const Vocabulary& vocabulary, std::size_t member, int word, LocationStore& store) {
  store.Put(LocationStore::Kind::kWord, static_cast<std::int64_t>(member), word,
            StateBytes(PackedMat(vocabulary.Descriptor(word))));
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
  if (!stored) store.Damaged("location " + std::to_string(memory_.id(slot)) + " is missing");
  const std::vector<UnitRecord> records = ReadRecord(*stored, store.name());
  // First everything that may fail, then the changes.
  std::vector<std::vector<int>> words(members_.size());
  std::vector<cv::Mat> descriptors(members_.size());
  for (std::size_t u = 0; u < units_.size(); ++u) {
    ForEachPart(units_[u], records[u].signature, [&](std::size_t k, const Signature& part) {
      words[k] = members_[k].vocabulary().Missing(part);
      for (const int word : words[k]) {
        if (word >= members_[k].vocabulary().created())
          store.Damaged("a word that " + members_[k].name() + " never made");
        ReadWord(k, word, store, descriptors[k]);
      }
    });
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
    PackedMat packed;
    ReadStateBytes(*record, store.name(), packed);
    row = packed.Unpacked();
  }
  const bool fits = descriptors.empty() || (row.cols == descriptors.cols && row.type() == descriptors.type());
  if (row.rows != 1 || !fits || !members_[member].vocabulary().Problem(row).empty())
    store.Damaged("word " + std::to_string(word) + " of " + members_[member].name());
  descriptors.push_back(row);
}

int MemorySystem::NextToTransfer(int best, const std::vector<int>& retrieved) const {
  std::set<int> immune(retrieved.begin(), retrieved.end());
  if (best >= 0) {
    immune.insert(best);
    for (const int slot : memory_.SlotsNear(best, kImmuneLevels)) immune.insert(slot);
  }
  return memory_.NextToTransfer(options_.recent_share, immune);
}

void MemorySystem::Store(int slot, LocationStore& store) const {
  StoreSignatures(slot, store);
  for (const FilterUnit& unit : units_) {
    ForEachPart(unit, unit.likelihood.signature(slot), [&](std::size_t k, const Signature& part) {
      const Vocabulary& vocabulary = members_[k].vocabulary();
      for (const int word : vocabulary.WordsOnlyIn(part)) StoreWord(vocabulary, k, word, store);
    });
  }
}

void MemorySystem::Leave(int slot) {
  Forget(slot);
  memory_.Transfer(slot);
  transition_.Update(memory_, {slot});
}

void MemorySystem::Replace(int slot, int into) {
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
    for (FilterUnit& unit : units_) {
      unit.likelihood.Add(Signature());
      unit.likelihood.Remove(slot);
      if (unit.is_dense) unit.dense.AddAbsent(memory_.state(slot) == LocationState::kMerged);
    }
    if (memory_.Holds(slot)) Restore(slot, store);
  }
  for (FilterUnit& unit : units_) {
    if (unit.is_dense) unit.dense.FinishLoading();
  }
  transition_.Update(memory_, memory_.working_memory());
}

std::string MemorySystem::Record(int slot) const {
  std::vector<UnitRecord> records;
  for (const FilterUnit& unit : units_) {
    records.push_back({unit.is_dense, unit.likelihood.signature(slot),
                       unit.is_dense ? unit.dense.descriptor(slot) : cv::Mat()});
  }
  SharedObjectsOut none;
  StateWriter out(&none);
  for (const UnitRecord& record : records) out(record);
  return out.Take();
}

std::vector<UnitRecord> MemorySystem::ReadRecord(std::string_view record, const std::string& source) const {
  SharedObjectsIn none;
  StateReader in(record, source, &none);
  std::vector<UnitRecord> records;
  for (const FilterUnit& unit : units_) {
    records.push_back({unit.is_dense, {}, {}});
    in(records.back());
    if (unit.is_dense && !unit.dense.Problem(records.back().descriptor).empty())
      in.Damaged("descriptors of several widths");
  }
  in.ExpectEnd();
  return records;
}

template <class Archive>
void MemorySystem::StateOfLevels(Archive& archive) {
  for (FilterUnit& unit : units_) {
    unit.alias.StateOfLevel(archive);
    archive(unit.weight);
  }
  if (!joint_) return;
  joint_->alias.StateOfLevel(archive);
  archive(overlap_);
  if constexpr (Archive::kReading) {
    if (overlap_.members() != 0 && overlap_.members() != units_.size())
      archive.Damaged("what members have in common");
  }
}

template <class Archive>
void MemorySystem::State(Archive& archive) {
  archive(memory_);
  for (FilterUnit& unit : units_) {
    archive(unit.likelihood);
    if (unit.is_dense) archive(unit.dense);
    archive(unit.filter, unit.alias, unit.weight);
    if constexpr (Archive::kReading) CheckUnit(unit, archive);
  }
  if (joint_) {
    archive(joint_->filter, joint_->alias, overlap_);
    if constexpr (Archive::kReading) {
      if (static_cast<int>(joint_->filter.posterior().places.size()) > memory_.size())
        archive.Damaged("locations are missing");
      if (overlap_.members() != 0 && overlap_.members() != units_.size())
        archive.Damaged("what members have in common");
    }
  }
  if constexpr (Archive::kReading) transition_.Update(memory_, memory_.working_memory());
}

void MemorySystem::CheckUnit(const FilterUnit& unit, const StateReader& in) const {
  if (unit.likelihood.size() != memory_.size() || (unit.is_dense && unit.dense.size() != memory_.size()) ||
      static_cast<int>(unit.filter.posterior().places.size()) > memory_.size()) {
    in.Damaged("locations are missing");
  }
  for (int slot = 0; slot < memory_.size(); ++slot) {
    const bool in_memory = memory_.Holds(slot);
    if (unit.likelihood.Has(slot) != in_memory || (unit.is_dense && unit.dense.Has(slot) != in_memory))
      in.Damaged("locations in memory without their words");
    ForEachPart(unit, unit.likelihood.signature(slot), [&](std::size_t member, const Signature& part) {
      if (!members_[member].vocabulary().Missing(part).empty()) in.Damaged("words are missing");
    });
  }
}

template void MemorySystem::State(StateWriter& archive);
template void MemorySystem::State(StateReader& archive);
template void MemorySystem::StateOfLevels(StateWriter& archive);
template void MemorySystem::StateOfLevels(StateReader& archive);

}  // namespace tutti::internal
