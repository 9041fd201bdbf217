// A vector whose copies share what neither of them has changed.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#if defined(__SANITIZE_THREAD__)
#define TUTTI_UNDER_TSAN 1
#elif defined(__has_feature)
#define TUTTI_UNDER_TSAN __has_feature(thread_sanitizer)
#else
#define TUTTI_UNDER_TSAN 0
#endif

#pragma GCC visibility push(default)
namespace tutti {
namespace internal {

/// Whether nobody else holds it. If so, whatever other threads have read before they let go of it has
/// happened.
template <class T>
bool IsAlone(const std::shared_ptr<T>& object) {
#if TUTTI_UNDER_TSAN  // which does not know fences
  const std::shared_ptr<T> again = object;
  return again.use_count() == 2;
#else
  const bool alone = object.use_count() == 1;
  std::atomic_thread_fence(std::memory_order_acquire);
  return alone;
#endif
}

}  // namespace internal

/// Elements live in chunks of `kChunk`. A copy costs a pointer per chunk; the first write to a chunk that is
/// shared copies that chunk. Copies may be used, and destroyed, on different threads.
template <class T, std::size_t kChunk>
class SharedVector {
 public:
  std::size_t size() const { return size_; }
  const T& operator[](std::size_t i) const { return (*chunks_[i / kChunk])[i % kChunk]; }

  /// For writing. References that were got for reading show the old value if the chunk was shared.
  T& Mutable(std::size_t i) { return Own(i / kChunk)[i % kChunk]; }

  T& Append(T value) {
    if (size_ % kChunk == 0) {
      chunks_.push_back(std::make_shared<Chunk>());
      chunks_.back()->reserve(kChunk);
    }
    Chunk& last = Own(size_++ / kChunk);
    last.push_back(std::move(value));
    return last.back();
  }

 private:
  using Chunk = std::vector<T>;

  Chunk& Own(std::size_t c) {
    std::shared_ptr<Chunk>& chunk = chunks_[c];
    if (!internal::IsAlone(chunk)) {
      auto copy = std::make_shared<Chunk>();
      copy->reserve(kChunk);  // references stay good while it grows
      copy->insert(copy->end(), chunk->begin(), chunk->end());
      chunk = std::move(copy);
    }
    return *chunk;
  }

  std::vector<std::shared_ptr<Chunk>> chunks_;
  std::size_t size_ = 0;
};

}  // namespace tutti
#pragma GCC visibility pop
