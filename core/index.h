// Slots, rows and members are counted by int; containers want std::size_t.
#pragma once

#include <cstddef>

namespace tutti::internal {

inline std::size_t Index(int i) { return static_cast<std::size_t>(i); }

}  // namespace tutti::internal
