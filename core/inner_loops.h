// For inner loops over whole arrays. Internal.
//
// A sanitizer would check each access, which was two thirds of the time of the loop detector's tests: arrays
// are checked as a whole instead. Functions are compiled for plain x86-64 and once more with newer
// instructions, chosen at run time; none of these sets of instructions fuses a multiplication with an
// addition: results are the same bits.
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

// Sanitizers do not get along with the resolvers that choose.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define TUTTI_CLONES(...) __attribute__((target_clones("default", __VA_ARGS__)))
#else
#define TUTTI_CLONES(...)
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

/// Checks a rectangle in an image, whose rows lie `step` numbers apart. An image is one block of memory,
/// in which nothing is poisoned: if the first and the last row may be read, so may those between them.
template <class T>
void CheckReadableRows(const T* first, int rows, int step, std::size_t count) {
  CheckReadable(first, count);
  CheckReadable(first + static_cast<std::ptrdiff_t>(rows - 1) * step, count);
}

/// Checks what will be written: to the address sanitizer there is no difference.
template <class T>
void CheckWritable(T* begin, std::size_t count) {
#if defined(TUTTI_THREAD_SANITIZER)
  __tsan_write_range(begin, count * sizeof(T));
#else
  CheckReadable(begin, count);
#endif
}

}  // namespace tutti::internal
