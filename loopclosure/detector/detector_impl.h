// LoopDetector's inside: detector.cc holds what happens to an image, detector_query.cc what it must be,
// detector_memory.cc long-term memory, detector_file.cc saving and loading.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "loopclosure/features/member.h"
#include "loopclosure/filter/hypothesis_search.h"
#include "loopclosure/filter/place_reasoner.h"
#include "loopclosure/geometry/verification.h"
#include "loopclosure/store/location_store.h"
#include "tutti/loopclosure/detector.h"

namespace tutti {

class LoopDetector::Impl {
 public:
  /// With a store of its own, or (for loading) the one that is given, whose contents are left alone.
  explicit Impl(const LoopDetectorOptions& options, std::unique_ptr<internal::LocationStore> store = nullptr);

  LoopResult Detect(const LoopQuery& query);
  LoopResult Locate(const LoopQuery& query) const;
  void AddLink(std::int64_t a, std::int64_t b) { reasoner_.AddLink(a, b); }
  void Unlink(std::int64_t a, std::int64_t b) { reasoner_.Unlink(a, b); }
  void Save(const std::filesystem::path& file) const;
  /// A new Impl with what the file holds, long-term memory in a temporary store.
  static std::unique_ptr<Impl> Load(const std::filesystem::path& file, const LoopDetectorOptions& options);
  /// Puts all that this object knows into a store that has a name, in place of what is there, and goes on
  /// with it. On failure `target` is left with what it had.
  void MoveInto(std::unique_ptr<internal::LocationStore>& target);
  bool has_durable_store() const { return store_ && store_->durable(); }
  std::unique_ptr<internal::LocationStore>& store_pointer() { return store_; }

  const LocationMemory& memory() const { return reasoner_.memory(); }
  std::int64_t last_id() const { return last_id_; }
  const LoopDetectorOptions& options() const { return options_; }

 private:
  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }
  bool Shared() const { return reasoner_.Shared(); }
  std::vector<std::unique_ptr<internal::MemorySystem>>& systems() { return reasoner_.systems(); }
  const std::vector<std::unique_ptr<internal::MemorySystem>>& systems() const { return reasoner_.systems(); }
  LocationMemory& union_of_all() { return reasoner_.union_of_all(); }
  const LocationMemory& union_of_all() const { return reasoner_.union_of_all(); }
  // Of the union of all memories in the store: the one after those of the systems.
  int UnionNumber() const { return static_cast<int>(systems().size()); }

  // What happens to an image.
  void CheckQuery(const LoopQuery& query) const;
  void CheckContent(const LoopQuery& query) const;
  void CheckCallersFeatures(const LoopQuery& query, const std::string& which) const;
  void CheckFeaturesOf(const std::string& name, const Features& features, const std::string& which) const;
  void CheckMemberFeatures(const LoopQuery& query, const std::string& which) const;
  std::vector<Features> Extract(const LoopQuery& query) const;
  std::vector<std::vector<TwoNearest>> SearchWords(const std::vector<Features>& features,
                                                   const std::vector<char>& usable) const;
  std::vector<SeenWords> Quantise(const std::vector<Features>& features, const cv::Size& size);
  int Remember(const LoopQuery& query, View view, const std::vector<SeenWords>& words);
  void FillCounts(const std::vector<Features>& features, LoopResult& result) const;
  void Decide(int slot, const CombinedBelief& combined, LoopResult& result);
  void Verify(const View& query, const Belief& belief, LoopResult& result) const;

  // Long-term memory.
  internal::LocationStore& store();
  void Retrieve(int best, LoopResult& result);
  void Shrink(int best, double elapsed_ms, LoopResult& result);
  bool Transfer(internal::MemorySystem& system, int slot, LoopResult& result);
  bool InMemory(int slot) const { return reasoner_.InMemory(slot); }
  void PutView(int slot);
  void FetchView(int slot);
  void LoadView(int slot, internal::ByteReader& in);
  void Journal(int new_slot, LoopResult& result);
  void WriteUnstored();
  void WriteWords();
  void MarkStored();
  void Reopen();
  std::string Statistics() const;
  void LoadStatistics(internal::ByteReader& in);

  // Saving and loading.
  void SaveLongTerm(const std::function<void(const std::string&)>& write) const;
  void CheckMemories(const std::string& source) const;
  void LoadViewsAndRecords(const std::function<bool(bool&, std::string&)>& next, const std::string& source);

  LoopDetectorOptions options_;
  std::vector<Member> members_;
  internal::PlaceReasoner reasoner_;
  GeometricVerifier verifier_;
  std::vector<View> views_;  // by slot; empty where the location is in no memory
  View dropped_view_;        // of a query that rehearsal has just merged away
  std::int64_t last_id_ = -1;
  int caller_type_ = -1;
  int caller_width_ = 0;

  std::unique_ptr<internal::LocationStore> store_;
  // What a durable store has still to learn.
  std::set<int> unstored_slots_;
  std::vector<std::set<int>> unstored_nodes_;  // by system, then those of union_
  std::vector<int> stored_words_;              // by member: words below this are stored
};

}  // namespace tutti
