#include "apps/report/page.h"

#include <algorithm>
#include <system_error>

#include "core/replaced_file.h"

namespace tutti {

namespace assets {             // files of apps/report/web that CMake put into the program
std::string ReportTemplate();  // HTML with the marks @style@, @data@, @library@, @script@
std::string ReportStyle();
std::string ReportScript();
std::string ChartLibrary();  // plotly.js, gzip, base64; empty: left out
}  // namespace assets

namespace {

// JSON that can stand within <script>: no '<' can end the element or open a comment.
std::string ForScript(const nlohmann::ordered_json& data) {
  const std::string text = data.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::string out;
  out.reserve(text.size() + text.size() / 16);
  for (const char c : text) c == '<' ? out.append("\\u003c") : out.append(1, c);
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

std::string Base64(const void* bytes, std::size_t size) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto* in = static_cast<const unsigned char*>(bytes);
  std::string out;
  out.reserve((size + 2) / 3 * 4);
  for (std::size_t i = 0; i < size; i += 3) {
    const std::size_t left = std::min<std::size_t>(3, size - i);
    const unsigned long word = static_cast<unsigned long>(in[i]) << 16 |
                               (left > 1 ? static_cast<unsigned long>(in[i + 1]) << 8 : 0) |
                               (left > 2 ? static_cast<unsigned long>(in[i + 2]) : 0);
    for (std::size_t k = 0; k < 4; ++k) out += k <= left ? kDigits[word >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

}  // namespace tutti
