// Files of apps/report/web that CMake put into the program.
#pragma once

#include <string>

namespace tutti::assets {

std::string ReportTemplate();  ///< HTML with the marks @style@, @data@, @library@, @script@
std::string ReportStyle();
std::string ReportScript();
std::string ChartLibrary();  ///< plotly.js, gzip, base64; empty: left out

}  // namespace tutti::assets
