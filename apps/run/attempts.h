// Goes on after a failure, and remembers the first one.
#pragma once

#include <exception>
#include <functional>
#include <string>

namespace tutti {

/// Steps of a run that go on after one has failed, so that what there is gets written.
class Attempts {
 public:
  void Try(const std::function<void()>& step) noexcept;
  bool Failed() const { return first_ != nullptr; }
  /// What the first failure was; empty for none.
  std::string Failure() const;
  /// Throws it on, if there is one.
  void Rethrow() const;

 private:
  std::exception_ptr first_;
};

}  // namespace tutti
