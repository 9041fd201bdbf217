// FLANN's kd-forest without what every search of it pays for the size of the index.
//
// For each search FLANN 1.9 clears a bitset and reserves a heap of as many entries as there are points. Its
// headers keep the two in files of their own: here they are replaced by ones that cost what a search puts in.
// In a namespace of its own, so that FLANN as it is may be beside it. For bench/index_cost alone.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#define FLANN_HEAP_H_
#define FLANN_DYNAMIC_BITSET_H_
#define flann flann_light

namespace flann {

/// The few numbers that one search sets, in a hash table.
class DynamicBitset {
 public:
  DynamicBitset() = default;
  explicit DynamicBitset(std::size_t) : slots_(kSlots, 0) {}
  void resize(std::size_t) { slots_.assign(kSlots, 0); }
  void clear() { reset(); }
  void reset() { std::fill(slots_.begin(), slots_.end(), 0); }
  void reset(std::size_t) {}  // no word is ever removed here
  bool test(std::size_t number) const { return slots_[Slot(number)] != 0; }
  void set(std::size_t number) {
    if (4 * ++used_ > 3 * slots_.size()) Grow();
    slots_[Slot(number)] = static_cast<std::uint32_t>(number + 1);
  }
  template <typename Archive>
  void serialize(Archive& archive) {
    archive& slots_;
  }

 private:
  static constexpr std::size_t kSlots = 128;

  std::size_t Slot(std::size_t number) const {
    std::size_t at = (number * 0x9e3779b97f4a7c15ull >> 40) & (slots_.size() - 1);
    while (slots_[at] != 0 && slots_[at] != number + 1) at = (at + 1) & (slots_.size() - 1);
    return at;
  }
  void Grow() {
    std::vector<std::uint32_t> old(2 * slots_.size(), 0);
    old.swap(slots_);
    for (const std::uint32_t entry : old) {
      if (entry != 0) slots_[Slot(entry - 1)] = entry;
    }
  }

  std::vector<std::uint32_t> slots_;  // number + 1; 0: free
  std::size_t used_ = 0;
};

/// FLANN's heap that grows as it is filled.
template <typename T>
class Heap {
 public:
  explicit Heap(int) { values_.reserve(256); }
  void insert(const T& value) {
    values_.push_back(value);
    std::push_heap(values_.begin(), values_.end(), Later);
  }
  bool popMin(T& value) {
    if (values_.empty()) return false;
    value = values_.front();
    std::pop_heap(values_.begin(), values_.end(), Later);
    values_.pop_back();
    return true;
  }

 private:
  static bool Later(const T& a, const T& b) { return b < a; }
  std::vector<T> values_;
};

}  // namespace flann

#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_index.h>

#undef flann
#undef FLANN_HEAP_H_
#undef FLANN_DYNAMIC_BITSET_H_
