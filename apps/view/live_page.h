// The page of the live view.
#pragma once

#include <string>

namespace tutti::view {

/// HTML with style and script in it.
std::string LivePage();

}  // namespace tutti::view
