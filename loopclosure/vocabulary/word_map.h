// A map by word id whose cost for each access does not grow with the number of words.
#pragma once

#include <bitset>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "core/numbers.h"

namespace tutti {

/// Values by word id. Ids are handed out one after the other and leave memory in much the same order, so
/// values lie in pages of neighbouring ids: a page comes with its first value and goes with its last. Unlike
/// in a hash map, no insertion ever moves all the others, and words of one image lie side by side.
template <typename T>
class WordMap {
 public:
  /// The value of a word; nullptr if there is none.
  const T* Find(int word) const {
    const Page* page = PageOf(word);
    return page != nullptr && page->present[Offset(word)] ? &page->values[Offset(word)] : nullptr;
  }
  T* Find(int word) { return const_cast<T*>(std::as_const(*this).Find(word)); }

  /// The value of a word (an id, not negative); it is made if there is none.
  T& operator[](int word) {
    const std::size_t number = Number(word);
    if (number >= pages_.size()) pages_.resize(number + 1);
    if (!pages_[number]) pages_[number] = std::make_unique<Page>();
    Page& page = *pages_[number];
    if (!page.present[Offset(word)]) {
      page.present.set(Offset(word));
      ++size_;
    }
    return page.values[Offset(word)];
  }

  /// Takes a word's value out. Words that have none are left alone.
  void Erase(int word) {
    if (Find(word) == nullptr) return;
    std::unique_ptr<Page>& page = pages_[Number(word)];
    page->present.reset(Offset(word));
    page->values[Offset(word)] = T();
    --size_;
    if (page->present.none()) page.reset();
  }

  /// Calls call(word, value) for every word that has a value, ascending.
  template <typename Call>
  void ForEach(const Call& call) const {
    for (std::size_t number = 0; number < pages_.size(); ++number) {
      if (!pages_[number]) continue;
      for (std::size_t i = 0; i < kPage; ++i) {
        if (pages_[number]->present[i]) call(static_cast<int>(number * kPage + i), pages_[number]->values[i]);
      }
    }
  }

  /// Words that have a value.
  std::size_t size() const { return size_; }

 private:
  static constexpr std::size_t kPage = 128;  // ids
  struct Page {
    std::bitset<kPage> present;
    T values[kPage] = {};
  };
  static std::size_t Number(int word) { return internal::Index(word) / kPage; }
  static std::size_t Offset(int word) { return internal::Index(word) % kPage; }
  const Page* PageOf(int word) const {
    const std::size_t number = Number(word);
    return number < pages_.size() ? pages_[number].get() : nullptr;
  }

  std::vector<std::unique_ptr<Page>> pages_;
  std::size_t size_ = 0;
};

}  // namespace tutti
