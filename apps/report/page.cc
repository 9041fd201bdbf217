#include "apps/report/page.h"

#include <system_error>

#include "apps/report/assets.h"
#include "apps/report/build_info.h"
#include "core/replaced_file.h"

namespace tutti {
namespace {

// JSON that can stand within <script>: no '<' can end the element or open a comment.
std::string ForScript(const nlohmann::ordered_json& data) {
  const std::string text = data.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::string out;
  out.reserve(text.size() + text.size() / 16);
  for (const char c : text) {
    if (c == '<') {
      out += "\\u003c";
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace

bool ReportsAvailable() { return !assets::ChartLibrary().empty(); }

std::string ReportsMissing() {
  return "no report.html: this tutti was built without the chart library (" + ChartLibraryMissing() +
         "). Then configure and build it again. The plots are there as SVG and PNG";
}

std::string ReportPage(const nlohmann::ordered_json& data) {
  const std::string library = assets::ChartLibrary();
  if (library.empty()) return {};
  // One pass over the template alone: what is put in is not searched for marks.
  const std::string page = assets::ReportTemplate();
  std::string out;
  std::size_t at = 0;
  while (true) {
    const std::size_t begin = page.find('@', at);
    const std::size_t end = begin == std::string::npos ? begin : page.find('@', begin + 1);
    if (end == std::string::npos) break;
    const std::string mark = page.substr(begin + 1, end - begin - 1);
    out += page.substr(at, begin - at);
    if (mark == "style") out += assets::ReportStyle();
    if (mark == "data") out += ForScript(data);
    if (mark == "library") out += library;
    if (mark == "script") out += assets::ReportScript();
    at = end + 1;
  }
  return out + page.substr(at);
}

void WriteReportPage(const std::filesystem::path& file, const nlohmann::ordered_json& data) {
  std::error_code ignored;
  if (!ReportsAvailable()) {
    std::filesystem::remove(file, ignored);
    return;
  }
  internal::WriteFile(file, ReportPage(data));
}

}  // namespace tutti
