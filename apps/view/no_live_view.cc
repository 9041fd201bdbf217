// In place of the live view where cpp-httplib is absent.
#include "apps/view/live_view.h"
#include "tutti/core/error.h"

namespace tutti {

std::string LiveViewOptions::Validate() const { return {}; }

LiveView OpenLiveView(const LiveViewOptions&) {
  throw InputError(
      "--view: this tutti was built without cpp-httplib (Debian: apt-get install libcpp-httplib-dev "
      "pkg-config). Then configure and build it again");
}

}  // namespace tutti
