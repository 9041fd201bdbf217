// Bundle adjustment of a whole map, beside the tracking.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

#pragma GCC visibility push(default)
namespace tutti {

/// Bundle adjustment over all keyframes of a map as it was at one moment. Made by
/// Odometry::BeginGlobalAdjustment, brought in by Odometry::Enter; in between the odometry goes on. Copies
/// share the work.
class GlobalAdjustment {
 public:
  class Work;
  explicit GlobalAdjustment(std::shared_ptr<Work> work);
  GlobalAdjustment(const GlobalAdjustment&);
  GlobalAdjustment& operator=(const GlobalAdjustment&);
  GlobalAdjustment(GlobalAdjustment&&) noexcept;
  GlobalAdjustment& operator=(GlobalAdjustment&&) noexcept;
  /// That of the last copy waits until the work has stopped.
  ~GlobalAdjustment();

  /// It and its copies are not wanted any more; returns at once, while the work ends with its present
  /// iteration.
  void Cancel();
  /// Keyframes that it moves.
  int Keyframes() const;
  /// Waits for the result, and gives it to `sink` as a section of a file (Odometry::LoadGlobalAdjustment).
  /// Safe on another thread than the one that uses a copy.
  void SaveSections(const std::function<void(std::uint32_t tag, std::string_view bytes)>& sink) const;

 private:
  friend class Odometry;
  std::shared_ptr<Work> work_;
};

}  // namespace tutti
#pragma GCC visibility pop
