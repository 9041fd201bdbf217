// In place of the live view where cpp-httplib is absent.
#include "apps/view/live_view.h"
#include "tutti/core/error.h"

namespace tutti {

class LiveView::Impl {};

std::string LiveViewOptions::Validate() const { return {}; }
bool LiveViewAvailable() { return false; }
LiveView::LiveView(const LiveViewOptions&) {
  throw InputError(
      "--view: this tutti was built without cpp-httplib (Debian: apt-get install libcpp-httplib-dev "
      "pkg-config). Then configure and build it again");
}
LiveView::~LiveView() = default;
std::string LiveView::Url() const { return {}; }
void LiveView::OnStart(const CameraRig&, std::size_t) {}
void LiveView::OnFrame(const InputFrame&, const TrackResult&, const RunState&) {}
void LiveView::OnKeyframe(const InputFrame&, int, const RunState&) {}
void LiveView::OnDetection(const LoopResult&) {}
void LiveView::OnEnd(const RunState&) {}

}  // namespace tutti
