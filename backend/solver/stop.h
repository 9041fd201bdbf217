// How a long solution is given up from outside. Private to the back end.
#pragma once

#include <functional>

namespace tutti::internal {

/// True when the caller does not want the result any more; empty: never.
using StopRequest = std::function<bool()>;

/// Thrown out of the solvers, to whoever has taken the request from the caller. Nobody else sees it.
struct Stopped {};

inline void ThrowIfStopped(const StopRequest& stop) {
  if (stop && stop()) throw Stopped();
}

}  // namespace tutti::internal
