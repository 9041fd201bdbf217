// Memory that one image after the other is worked on in. Internal.
#pragma once

#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace tutti::internal {

/// Scratches that are not in use. Safe from several threads at once.
template <class Scratch>
class ScratchPool {
 public:
  /// One that nobody else uses until it is given back.
  std::unique_ptr<Scratch> Take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (free_.empty()) return std::make_unique<Scratch>();
    std::unique_ptr<Scratch> scratch = std::move(free_.back());
    free_.pop_back();
    return scratch;
  }
  void Give(std::unique_ptr<Scratch> scratch) {
    const std::lock_guard<std::mutex> lock(mutex_);
    free_.push_back(std::move(scratch));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<Scratch>> free_;
};

}  // namespace tutti::internal
