#include "loopclosure/memory/location_memory.h"

#include <algorithm>
#include <array>
#include <tuple>
#include <unordered_map>

#include "core/state_archive.h"

namespace tutti {

using internal::Index;

int LocationMemory::Add(std::int64_t id) {
  const int slot = size();
  nodes_.push_back({id, LocationState::kShortTerm, 0, 0, {}});
  changed_.insert(slot);
  slot_of_id_.emplace(id, slot);
  if (!short_term_.empty()) {
    AddLink(short_term_.back(), slot, LinkType::kOdometry);
  } else if (!working_.empty()) {
    AddLink(working_.back(), slot, LinkType::kOdometry);
  }
  short_term_.push_back(slot);
  return slot;
}

bool LocationMemory::AddLink(int a, int b, LinkType type) {
  if (a == b) return false;
  std::vector<Link>& links = nodes_[Index(a)].links;
  const bool known =
      std::any_of(links.begin(), links.end(), [b](const Link& link) { return link.slot == b; });
  if (known) return false;
  const LinkType bounded = Bounded(a, b, type);
  links.push_back({b, bounded});
  nodes_[Index(b)].links.push_back({a, bounded});
  changed_.insert({a, b});
  return true;
}

bool LocationMemory::RemoveLoop(int a, int b) {
  bool removed = false;
  for (const auto& [from, to] : {std::make_pair(a, b), std::make_pair(b, a)}) {
    std::vector<Link>& links = nodes_[Index(from)].links;
    const auto gone = std::remove_if(links.begin(), links.end(), [to = to](const Link& link) {
      return link.slot == to && link.type != LinkType::kOdometry;
    });
    removed = removed || gone != links.end();
    links.erase(gone, links.end());
  }
  if (removed) changed_.insert({a, b});
  return removed;
}

LocationMemory::LinkType LocationMemory::Bounded(int a, int b, LinkType type) const {
  if (type == LinkType::kOdometry) return type;
  for (const int slot : {a, b}) {
    const std::vector<Link>& near = links(slot);
    const auto loops = std::count_if(near.begin(), near.end(),
                                     [](const Link& link) { return link.type == LinkType::kLoop; });
    if (loops >= kMostLoops) return LinkType::kMoreLoop;
  }
  return LinkType::kLoop;
}

std::vector<int> LocationMemory::Settle(int most) {
  std::vector<int> moved;
  while (static_cast<int>(short_term_.size()) > most) {
    const int slot = short_term_.front();
    short_term_.pop_front();
    Enter(slot);
    moved.push_back(slot);
  }
  return moved;
}

void LocationMemory::Enter(int slot) {
  nodes_[Index(slot)].state = LocationState::kWorking;
  nodes_[Index(slot)].entered = entries_++;
  working_.insert(std::lower_bound(working_.begin(), working_.end(), slot), slot);
  changed_.insert(slot);
}

int LocationMemory::DropNewest() {
  return short_term_.size() < 2 ? -1 : Drop(1 + nodes_[Index(short_term_.back())].weight);
}

int LocationMemory::IgnoreNewest() { return short_term_.size() < 2 ? -1 : Drop(0); }

int LocationMemory::Drop(int weight) {
  const int newest = short_term_.back();
  short_term_.pop_back();
  const int old = short_term_.back();
  PassOn(newest, old, weight);
  return old;
}

// The slot is gone: another one has its links, its weight counts there, and its id names that one.
void LocationMemory::PassOn(int slot, int into, int weight) {
  nodes_[Index(into)].weight += weight;
  const std::vector<Link> passed_on = nodes_[Index(slot)].links;
  nodes_[Index(slot)].links.clear();
  nodes_[Index(slot)].state = LocationState::kMerged;
  changed_.insert({slot, into});
  for (const Link& link : passed_on) {
    std::vector<Link>& back = nodes_[Index(link.slot)].links;
    back.erase(std::remove_if(back.begin(), back.end(), [slot](const Link& l) { return l.slot == slot; }),
               back.end());
    changed_.insert(link.slot);
    AddLink(link.slot, into, link.type);
  }
  slot_of_id_[id(slot)] = into;
}

bool LocationMemory::CanMerge(int slot, int into) const {
  return into >= 0 && into < slot && state(into) != LocationState::kMerged &&
         state(slot) != LocationState::kMerged &&
         !(state(slot) == LocationState::kShortTerm && slot == short_term_.back());
}

void LocationMemory::Merge(int slot, int into) {
  const LocationState was = state(slot);
  if (was == LocationState::kShortTerm)
    short_term_.erase(std::lower_bound(short_term_.begin(), short_term_.end(), slot));
  if (was == LocationState::kWorking)
    working_.erase(std::lower_bound(working_.begin(), working_.end(), slot));
  if (was == LocationState::kLongTerm) --num_long_term_;
  PassOn(slot, into, 1 + nodes_[Index(slot)].weight);
  nodes_[Index(slot)].weight = 0;
  // Those that were merged into it before are newer.
  for (auto named = slot_of_id_.upper_bound(id(slot)); named != slot_of_id_.end(); ++named) {
    if (named->second != slot) continue;
    named->second = into;
    const auto at = std::lower_bound(nodes_.begin(), nodes_.end(), named->first,
                                     [](const Node& node, std::int64_t id) { return node.id < id; });
    changed_.insert(static_cast<int>(at - nodes_.begin()));
  }
}

int LocationMemory::NextToTransfer(double recent_share, const std::set<int>& immune) const {
  const auto recent = static_cast<std::size_t>(recent_share * static_cast<double>(working_.size()));
  std::vector<std::int64_t> entered;
  for (const int slot : working_) entered.push_back(nodes_[Index(slot)].entered);
  std::int64_t newest_allowed = entries_;  // entered before this
  if (recent > 0 && recent < entered.size()) {
    const auto bound = entered.end() - static_cast<std::ptrdiff_t>(recent);
    std::nth_element(entered.begin(), bound, entered.end());
    newest_allowed = *bound;
  }
  int next = -1;
  const auto key = [this](int slot) {
    const Node& node = nodes_[Index(slot)];
    return std::make_tuple(node.weight, node.entered, slot);
  };
  for (const int slot : working_) {
    if (nodes_[Index(slot)].entered >= newest_allowed || immune.count(slot) > 0) continue;
    if (next >= 0 && key(next) < key(slot)) continue;
    const std::vector<Link>& near = links(slot);
    const bool in_use = std::any_of(near.begin(), near.end(), [this](const Link& link) {
      return state(link.slot) == LocationState::kShortTerm;
    });
    if (!in_use) next = slot;
  }
  return next;
}

bool LocationMemory::Transfer(int slot) {
  if (state(slot) != LocationState::kWorking) return false;
  nodes_[Index(slot)].state = LocationState::kLongTerm;
  working_.erase(std::lower_bound(working_.begin(), working_.end(), slot));
  ++num_long_term_;
  changed_.insert(slot);
  return true;
}

bool LocationMemory::Retrieve(int slot) {
  if (state(slot) != LocationState::kLongTerm) return false;
  --num_long_term_;
  Enter(slot);
  return true;
}

std::vector<int> LocationMemory::LongTermNeighbours(int slot, int levels, int count) const {
  std::vector<int> found;
  for (const auto& [near, level, loops] : Walk(slot, levels, [](LocationState) { return true; })) {
    if (static_cast<int>(found.size()) == count) break;
    if (state(near) == LocationState::kLongTerm) found.push_back(near);
  }
  return found;
}

std::vector<int> LocationMemory::TakeChanged() {
  std::vector<int> slots(changed_.begin(), changed_.end());
  changed_.clear();
  return slots;
}

void LocationMemory::TransferWeight(int newer, int older) {
  nodes_[Index(newer)].weight += nodes_[Index(older)].weight;
  nodes_[Index(older)].weight = 0;
  changed_.insert({newer, older});
}

int LocationMemory::Find(std::int64_t id) const {
  const auto found = slot_of_id_.find(id);
  return found == slot_of_id_.end() ? -1 : found->second;
}

std::vector<LocationMemory::Neighbour> LocationMemory::Neighbours(int slot, int levels) const {
  return Walk(slot, levels, [](LocationState state) { return state == LocationState::kWorking; });
}

std::vector<int> LocationMemory::SlotsNear(int slot, int levels) const {
  std::vector<int> slots;
  for (const Neighbour& near : Neighbours(slot, levels)) slots.push_back(near.slot);
  std::sort(slots.begin(), slots.end());
  return slots;
}

template <typename Walkable>
std::vector<LocationMemory::Neighbour> LocationMemory::Walk(int slot, int levels,
                                                            const Walkable& walkable) const {
  std::vector<Neighbour> found;
  if (!walkable(state(slot))) return found;
  // Level by level; the places of a ring by how many loop links their paths have taken.
  using Ring = std::array<std::vector<int>, kMostLoopsOfAWalk + 1>;
  std::unordered_map<int, std::size_t> fewest_loops;
  Ring ring, next;  // these and what is reached keep their storage from level to level
  std::vector<int> reached;
  ring[0] = {slot};
  for (int level = 0; level <= levels; ++level) {
    for (std::vector<int>& of_next : next) of_next.clear();
    reached.clear();
    for (std::size_t loops = 0; loops < ring.size(); ++loops) {
      for (const int node : ring[loops]) {
        const auto [known, is_new] = fewest_loops.emplace(node, loops);
        if (is_new) {
          reached.push_back(node);
        } else if (known->second <= loops) {
          continue;
        }
        known->second = loops;
        for (const Link& link : links(node)) {
          if (!walkable(state(link.slot))) continue;
          if (link.type == LinkType::kOdometry) next[loops].push_back(link.slot);
          if (link.type == LinkType::kLoop && loops + 1 < ring.size()) ring[loops + 1].push_back(link.slot);
        }
      }
    }
    std::sort(reached.begin(), reached.end());
    for (const int node : reached) found.push_back({node, level, static_cast<int>(fewest_loops.at(node))});
    ring.swap(next);
  }
  return found;
}

template <class Archive>
void LocationMemory::StateOfSlot(int slot, Archive& archive) {
  if constexpr (Archive::kReading) nodes_.emplace_back();
  Node& node = nodes_[Index(slot)];
  int names = Archive::kReading ? 0 : Find(node.id);  // of a merged location: which one it was merged into
  archive(node.id, node.state, node.weight, node.entered, names, node.links);
  if constexpr (Archive::kReading) {
    if (node.state > LocationState::kLongTerm) archive.Damaged("a location in an unknown state");
    for (const Link& link : node.links) {
      if (link.type > LinkType::kMoreLoop) archive.Damaged("a link of an unknown type");
    }
    // One that was merged names the location that it was merged into, any other itself.
    const bool merged = node.state == LocationState::kMerged;
    if (names < 0 || names > slot || merged != (names < slot) ||
        (merged && state(names) == LocationState::kMerged)) {
      archive.Damaged("a location merged into one that is not there");
    }
    if (node.id < 0 || (slot > 0 && node.id <= id(slot - 1))) archive.Damaged("locations out of order");
    constexpr std::int64_t kMostEntries = std::int64_t{1} << 62;
    if (node.weight < 0 || node.entered < 0 || node.entered > kMostEntries) {
      archive.Damaged("a location with an impossible weight or age");
    }
    slot_of_id_.emplace(node.id, names);
  }
}

void LocationMemory::FinishLoading() {
  short_term_.clear();
  working_.clear();
  num_long_term_ = 0;
  entries_ = 0;
  for (int slot = 0; slot < size(); ++slot) {
    Node& node = nodes_[Index(slot)];
    // A link to a location that is not there: the process died before that one was stored.
    node.links.erase(std::remove_if(node.links.begin(), node.links.end(),
                                    [&](const Link& link) {
                                      return link.slot < 0 || link.slot >= size() || link.slot == slot;
                                    }),
                     node.links.end());
    entries_ = std::max(entries_, node.entered + 1);
    if (node.state == LocationState::kShortTerm) short_term_.push_back(slot);
    if (node.state == LocationState::kWorking) working_.push_back(slot);
    if (node.state == LocationState::kLongTerm) ++num_long_term_;
  }
  changed_.clear();
}

template <class Archive>
void LocationMemory::State(Archive& archive) {
  int count = size();
  archive(count);
  for (int slot = 0; slot < count; ++slot) StateOfSlot(slot, archive);
  if constexpr (Archive::kReading) {
    FinishLoading();
    // A weight counts the locations that were merged into one, so all together are no more than there are.
    std::int64_t weights = 0;
    for (const Node& node : nodes_) weights += node.weight;
    if (weights > size()) archive.Damaged("locations with impossible weights");
    int newest = size() - 1;
    while (newest >= 0 && state(newest) == LocationState::kMerged) --newest;
    if (newest >= 0 && !short_term_.empty() && state(newest) != LocationState::kShortTerm) {
      archive.Damaged("the newest location is not in short-term memory");
    }
  }
}

template void LocationMemory::StateOfSlot(int slot, internal::StateWriter& archive);
template void LocationMemory::StateOfSlot(int slot, internal::StateReader& archive);
template void LocationMemory::State(internal::StateWriter& archive);
template void LocationMemory::State(internal::StateReader& archive);

}  // namespace tutti
