// For inner loops over whole arrays: a sanitizer would check each access, which was two thirds of the time of
// the loop detector's tests. They are checked as a whole instead. Internal.
#pragma once

#include <cstddef>

#if defined(__clang__)
#if __has_feature(address_sanitizer)
#define TUTTI_ADDRESS_SANITIZER
#include <sanitizer/asan_interface.h>
#elif __has_feature(thread_sanitizer)
#define TUTTI_THREAD_SANITIZER
extern "C" void __tsan_read_range(void* begin, unsigned long bytes);
extern "C" void __tsan_write_range(void* begin, unsigned long bytes);
#endif
/// A function whose arrays went through CheckReadable and CheckWritable.
#define TUTTI_CHECKED_AS_A_WHOLE __attribute__((no_sanitize("address", "thread", "undefined")))
#else
#define TUTTI_CHECKED_AS_A_WHOLE
#endif

namespace tutti::internal {

/// Under a sanitizer: reports `count` numbers from `begin` on that may not be read. Else nothing.
template <class T>
void CheckReadable([[maybe_unused]] const T* begin, [[maybe_unused]] std::size_t count) {
#if defined(TUTTI_ADDRESS_SANITIZER)
  const void* bad = __asan_region_is_poisoned(const_cast<T*>(begin), count * sizeof(T));
  if (bad != nullptr) static_cast<void>(*static_cast<const volatile char*>(bad));
#elif defined(TUTTI_THREAD_SANITIZER)
  __tsan_read_range(const_cast<T*>(begin), count * sizeof(T));
#endif
}

/// The same of a rectangle in an image, whose rows lie `step` numbers apart. An image is one block of memory,
/// in which nothing is poisoned: if the first and the last row may be read, so may those between them.
template <class T>
void CheckReadableRows(const T* first, int rows, int step, std::size_t count) {
  CheckReadable(first, count);
  CheckReadable(first + static_cast<std::ptrdiff_t>(rows - 1) * step, count);
}

/// The same of what will be written: to the address sanitizer there is no difference.
template <class T>
void CheckWritable(T* begin, std::size_t count) {
#if defined(TUTTI_THREAD_SANITIZER)
  __tsan_write_range(begin, count * sizeof(T));
#else
  CheckReadable(begin, count);
#endif
}

}  // namespace tutti::internal
