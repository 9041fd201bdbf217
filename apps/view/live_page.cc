#include "apps/view/live_page.h"

namespace tutti {

namespace assets {  // made by CMake
std::string ViewHead();
std::string ViewScript();
}  // namespace assets

namespace view {

std::string LivePage() {
  return assets::ViewHead() + "<script>" + assets::ViewScript() + "</script>\n</body>\n</html>\n";
}

}  // namespace view
}  // namespace tutti
