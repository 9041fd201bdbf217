#include "apps/run/attempts.h"

namespace tutti {

void Attempts::Try(const std::function<void()>& step) noexcept {
  try {
    step();
  } catch (...) {
    if (first_ == nullptr) first_ = std::current_exception();
  }
}

void Attempts::Rethrow() const {
  if (first_ != nullptr) std::rethrow_exception(first_);
}

std::string Attempts::Failure() const {
  try {
    Rethrow();
    return "";
  } catch (const std::exception& thrown) {
    return thrown.what();
  } catch (...) {
    return "unknown";
  }
}

}  // namespace tutti
