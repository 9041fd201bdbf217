#include "tutti/loopclosure/location_memory.h"

#include <algorithm>

namespace tutti {

int LocationMemory::Add(std::int64_t id) {
  const int slot = size();
  nodes_.push_back({id, State::kShortTerm, 0, {}});
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
  links.push_back({b, type});
  nodes_[Index(b)].links.push_back({a, type});
  return true;
}

std::vector<int> LocationMemory::Settle() {
  std::vector<int> moved;
  while (static_cast<int>(short_term_.size()) > stm_size_) {
    const int slot = short_term_.front();
    short_term_.pop_front();
    nodes_[Index(slot)].state = State::kWorking;
    working_.push_back(slot);  // slots leave STM in ascending order
    moved.push_back(slot);
  }
  return moved;
}

int LocationMemory::DropNewest() {
  if (short_term_.size() < 2) return -1;
  const int newest = short_term_.back();
  short_term_.pop_back();
  const int old = short_term_.back();
  nodes_[Index(old)].weight += 1 + nodes_[Index(newest)].weight;
  const std::vector<Link> passed_on = nodes_[Index(newest)].links;
  nodes_[Index(newest)].links.clear();
  nodes_[Index(newest)].state = State::kMerged;
  for (const Link& link : passed_on) {
    std::vector<Link>& back = nodes_[Index(link.slot)].links;
    back.erase(std::remove_if(back.begin(), back.end(), [newest](const Link& l) { return l.slot == newest; }),
               back.end());
    AddLink(link.slot, old, link.type);
  }
  slot_of_id_[id(newest)] = old;
  return old;
}

void LocationMemory::TransferWeight(int newer, int older) {
  nodes_[Index(newer)].weight += nodes_[Index(older)].weight;
  nodes_[Index(older)].weight = 0;
}

int LocationMemory::Find(std::int64_t id) const {
  const auto found = slot_of_id_.find(id);
  return found == slot_of_id_.end() ? -1 : found->second;
}

std::vector<std::pair<int, int>> LocationMemory::Neighbours(int slot, int levels) const {
  std::vector<std::pair<int, int>> found;
  if (nodes_[Index(slot)].state != State::kWorking) return found;
  std::map<int, int> level_of;  // also marks the visited
  std::vector<int> ring = {slot};
  level_of[slot] = 0;
  for (int level = 0; level <= levels && !ring.empty(); ++level) {
    // Loop links cost nothing: close the ring under them before it counts as complete.
    for (std::size_t i = 0; i < ring.size(); ++i) {
      for (const Link& link : links(ring[i])) {
        if (link.type != LinkType::kLoop || state(link.slot) != State::kWorking) continue;
        if (level_of.emplace(link.slot, level).second) ring.push_back(link.slot);
      }
    }
    std::sort(ring.begin(), ring.end());
    std::vector<int> next;
    for (const int node : ring) {
      found.emplace_back(node, level);
      for (const Link& link : links(node)) {
        if (link.type != LinkType::kOdometry || state(link.slot) != State::kWorking) continue;
        if (level_of.emplace(link.slot, level + 1).second) next.push_back(link.slot);
      }
    }
    ring.swap(next);
  }
  return found;
}

}  // namespace tutti
