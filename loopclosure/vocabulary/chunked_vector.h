// A vector that grows without moving what it holds: no image pays for copying all of it.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace tutti::internal {

/// Elements in chunks of equal size. Indices are as in a std::vector.
template <typename T>
class ChunkedVector {
 public:
  T& operator[](std::size_t i) { return chunks_[i >> kBits][i & kMask]; }
  const T& operator[](std::size_t i) const { return chunks_[i >> kBits][i & kMask]; }

  /// Appends a value-initialised element.
  void Extend() {
    if (size_ >> kBits == chunks_.size()) chunks_.push_back(std::make_unique<T[]>(kMask + 1));
    ++size_;
  }
  std::size_t size() const { return size_; }

 private:
  static constexpr std::size_t kBits = 14;
  static constexpr std::size_t kMask = (std::size_t{1} << kBits) - 1;

  std::vector<std::unique_ptr<T[]>> chunks_;
  std::size_t size_ = 0;
};

}  // namespace tutti::internal
