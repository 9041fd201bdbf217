// The one memory of locations that all members share: which exist, how they are linked, which may be
// candidates.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <set>
#include <vector>

#include "core/numbers.h"

namespace tutti {

/// Where a location is.
enum class LocationState : std::uint8_t {
  kShortTerm,  ///< in STM: no candidate yet
  kWorking,    ///< in WM: a candidate
  kMerged,     ///< nowhere: it was merged into an older one, which its id names from then on
  kLongTerm,   ///< in LTM: left WM, can be retrieved
};

/// Short-term memory (STM, a FIFO of the newest locations, which are no candidates) and working memory (WM,
/// the candidates), after Labbe & Michaud 2013, section III. Shared between the members (loop-closure.md
/// section 6), so that a location is in every member's WM or in none; or one for each member, as in the
/// paper. Locations that leave WM are in long-term memory (LTM): their links and weights stay here, what they
/// look like is kept elsewhere.
///
/// Locations are slots 0, 1, 2, ... in the order of adding; the caller's ids are kept beside them.
class LocationMemory {
 public:
  /// How two locations are linked.
  enum class LinkType : std::uint8_t {
    kOdometry,  ///< neighbours in time, one graph level apart
    kLoop,      ///< the same place, zero levels apart
    kMoreLoop,  ///< the same place, but one of them has kMostLoops already: known, and not walked
  };
  /// A location's link to another; the other has one back.
  struct Link {
    int slot = 0;                         ///< the other location
    LinkType type = LinkType::kOdometry;  ///< how they are linked

    template <class Archive>
    void State(Archive& archive) {
      archive(slot, type);
    }
  };

  /// Loop links of one location that are walked. With kMostLoopsOfAWalk it keeps the neighbourhood of a place
  /// that is seen over and over as large as that of a few laps. Both bounds are the same from either end, so
  /// that a is a neighbour of b whenever b is one of a.
  static constexpr int kMostLoops = 4;
  /// Loop links that one path takes at most.
  static constexpr int kMostLoopsOfAWalk = 2;

  /// A place that a walk over the links leads to.
  struct Neighbour {
    int slot = -1;
    int level = 0;  ///< odometry links on the way
    int loops = 0;  ///< loop links on it, the fewest of the shortest ways

    bool operator==(const Neighbour& other) const {
      return slot == other.slot && level == other.level && loops == other.loops;
    }
  };

  /// Empty. `stm_size`: locations that STM holds after Settle, at least 1.
  explicit LocationMemory(int stm_size) : stm_size_(stm_size) {}

  /// Adds a location at the end of STM, linked to the one before it; returns its slot. `id` must be greater
  /// than all before.
  int Add(std::int64_t id);
  /// Links two locations; links that exist already are left as they are. A loop link beyond kMostLoops of
  /// either becomes kMoreLoop. Returns false if nothing changed.
  bool AddLink(int a, int b, LinkType type);
  /// Takes a loop link back; odometry links stay. False if there is none.
  bool RemoveLoop(int a, int b);
  /// Moves the oldest locations of STM to WM while |STM| > stm_size; returns the slots moved.
  std::vector<int> Settle() { return Settle(stm_size_); }
  /// Does so while |STM| > `most`; 0: another recording begins, and nothing is too recent for it.
  std::vector<int> Settle(int most);
  /// Rehearsal (section 6): the newest location is merged into the one before it, weight_old += 1 +
  /// weight_new, and dropped; its id names the older one from now on. Returns the older slot, -1 if STM holds
  /// no older one (nothing changes then).
  int DropNewest();
  /// The newest location is dropped without a trace but its id, which names the one before it from now on
  /// (a bad signature under bad_signatures: ignore). Returns the older slot, -1 as DropNewest.
  int IgnoreNewest();
  /// True for a location that can be merged into `into`: an older one that is there, too, where it is not the
  /// newest of STM.
  bool CanMerge(int slot, int into) const;
  /// A location is merged into an older one, which takes over its links, its weight and its id. Only if
  /// CanMerge.
  void Merge(int slot, int into);
  /// On a loop: the newer location takes over the older one's weight.
  void TransferWeight(int newer, int older);

  /// The location in WM to transfer to LTM next: lowest weight, then longest since it entered WM, then
  /// smallest slot (section 6). Never one that is linked to STM, in `immune`, or of the newest
  /// `recent_share` of WM. -1 if there is none.
  int NextToTransfer(double recent_share, const std::set<int>& immune) const;
  /// WM -> LTM. False, and nothing happens, if the slot is not in WM.
  bool Transfer(int slot);
  /// LTM -> WM, as the newest there. False, and nothing happens, if the slot is not in LTM.
  bool Retrieve(int slot);
  /// Up to `count` locations in LTM near `slot` (any state) by graph level, nearest first, at most `levels`
  /// away. Walks the whole graph, LTM included.
  std::vector<int> LongTermNeighbours(int slot, int levels, int count) const;
  /// Locations in LTM.
  int num_long_term() const { return num_long_term_; }
  /// Slots whose state, weight or links changed since the last call, ascending.
  std::vector<int> TakeChanged();

  /// The record of one slot (id, state, weight, links), for the long-term memory's file. Slots are read in
  /// ascending order, each when size() is its number; then FinishLoading.
  template <class Archive>
  void StateOfSlot(int slot, Archive& archive);
  /// Makes a memory of the records: those that were in STM or WM are there again. Links to slots that were
  /// never loaded are dropped.
  void FinishLoading();
  template <class Archive>
  void State(Archive& archive);

  /// Slots in WM, ascending: the candidates.
  const std::vector<int>& working_memory() const { return working_; }
  /// Slots in STM, ascending; the newest location last.
  const std::deque<int>& short_term_memory() const { return short_term_; }
  /// Where a slot is. This and the next three: `slot` in 0 .. size() - 1.
  LocationState state(int slot) const { return nodes_[internal::Index(slot)].state; }
  /// True for a slot in STM or WM: what it looks like is in memory.
  bool Holds(int slot) const {
    return state(slot) == LocationState::kShortTerm || state(slot) == LocationState::kWorking;
  }
  /// A slot's links to others, in the order in which they were added.
  const std::vector<Link>& links(int slot) const { return nodes_[internal::Index(slot)].links; }
  /// How often a place was seen: the locations that rehearsal or a loop merged into it.
  int weight(int slot) const { return nodes_[internal::Index(slot)].weight; }
  /// The caller's id of a slot.
  std::int64_t id(int slot) const { return nodes_[internal::Index(slot)].id; }
  /// Slots ever added, whatever has become of them.
  int size() const { return static_cast<int>(nodes_.size()); }
  /// Slot of a caller's id, -1 if there is none.
  int Find(std::int64_t id) const;

  /// Slots in WM within `levels` graph levels of `slot` (itself included), each with its level, in order of
  /// level, then slot. Odometry links count 1, loop links 0, of which a walk takes kMostLoopsOfAWalk. Only WM
  /// is walked.
  std::vector<Neighbour> Neighbours(int slot, int levels) const;
  /// The slots of Neighbours, ascending.
  std::vector<int> SlotsNear(int slot, int levels) const;

 private:
  struct Node {
    std::int64_t id = 0;
    LocationState state = LocationState::kShortTerm;
    int weight = 0;
    std::int64_t entered = 0;  // WM, by the count of all entries
    std::vector<Link> links;
  };
  LinkType Bounded(int a, int b, LinkType type) const;
  int Drop(int weight);
  void PassOn(int slot, int into, int weight);
  void Enter(int slot);
  // (slot, level) of every location within `levels` that `walkable` admits, `slot` first.
  template <typename Walkable>
  std::vector<Neighbour> Walk(int slot, int levels, const Walkable& walkable) const;

  int stm_size_;
  std::vector<Node> nodes_;
  std::deque<int> short_term_;
  std::vector<int> working_;
  std::map<std::int64_t, int> slot_of_id_;
  std::int64_t entries_ = 0;
  int num_long_term_ = 0;
  std::set<int> changed_;
};

}  // namespace tutti
