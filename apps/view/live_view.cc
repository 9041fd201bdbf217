#include "apps/view/live_view.h"

#include "apps/view/live_server.h"
#include "apps/view/live_state.h"

namespace tutti {

class LiveView::Impl {
 public:
  explicit Impl(const LiveViewOptions& options) : options_(options), server_(options, state_) {}

  LiveViewOptions options_;
  view::LiveState state_;
  view::LiveServer server_;  // last: serves the rest
};

std::string LiveViewOptions::Validate() const {
  if (address.empty()) return "the address to listen at must not be empty";
  if (port < 0 || port > 65535) return "the port must be 0 to 65535";
  if (!(abandoned_s >= 0)) return "abandoned_s must be 0 s or more";
  if (!(idle_s >= 0)) return "the time to wait for a viewer must be 0 s or more";
  return {};
}

LiveView::LiveView(const LiveViewOptions& options) : impl_(std::make_unique<Impl>(options)) {}
LiveView::~LiveView() = default;

bool LiveViewAvailable() { return true; }
std::string LiveView::Url() const { return impl_->server_.Url(); }
void LiveView::OnStart(const CameraRig&, std::size_t frames) {
  impl_->state_.SetTotal(frames);
  impl_->state_.WaitForViewer(impl_->options_.idle_s);
}
void LiveView::OnFrame(const InputFrame& frame, const TrackResult& track, const RunState& state) {
  impl_->state_.SetFrame(frame, track, state);
  impl_->state_.WaitWhilePaused(impl_->options_.abandoned_s);
}
void LiveView::OnKeyframe(const InputFrame&, int keyframe, const RunState& state) {
  impl_->state_.SetKeyframe(keyframe, state);
}
void LiveView::OnDetection(const LoopResult& result) { impl_->state_.AddDetection(result); }
void LiveView::OnEnd(const RunState&) { impl_->state_.Finish(); }

}  // namespace tutti
