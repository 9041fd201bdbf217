#include "apps/slam/global_adjuster.h"

#include <utility>

namespace tutti {
namespace {
constexpr int kLeastFrames = 20;       // that an adjustment has
constexpr int kKeyframesPerFrame = 4;  // and one more for so many keyframes
constexpr std::size_t kCancelled = 2;  // that may still be ending
}  // namespace

void GlobalAdjuster::Cancel() {
  if (!running_) return;
  running_->Cancel();
  cancelled_.push_back(std::move(*running_));
  running_.reset();
  if (cancelled_.size() > kCancelled) cancelled_.erase(cancelled_.begin());  // long since at its end
}

void GlobalAdjuster::MapMoved(const Odometry& odometry, int piece, std::int64_t frame) {
  Cancel();
  running_.emplace(AdjustGlobally(odometry, piece));
  due_ = frame + kLeastFrames + running_->Keyframes() / kKeyframesPerFrame;
}

void GlobalAdjuster::Converge(const Odometry& odometry, int piece) {
  constexpr int kIterations = 100;
  Cancel();
  running_.emplace(AdjustGlobally(odometry, piece, kIterations));
  due_ = 0;
}

GlobalAdjustment GlobalAdjuster::Take() {
  GlobalAdjustment taken = std::move(*running_);
  running_.reset();
  cancelled_.clear();
  return taken;
}

}  // namespace tutti
