#include "core/terminal.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>

#include "tutti/core/text.h"

namespace tutti::internal {

std::size_t TerminalColumns(std::FILE* out) {
  constexpr std::size_t kUsual = 80;
  if (out == nullptr || isatty(fileno(out)) == 0) return kUsual;
  winsize size{};
  return ioctl(fileno(out), TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : kUsual;
}

std::vector<std::string> WrapText(std::string_view text, std::size_t columns) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    lines.emplace_back();
    for (const std::string& word : SplitText(text.substr(at, end - at), " ")) {
      if (!lines.back().empty() && lines.back().size() + 1 + word.size() > columns) lines.emplace_back();
      lines.back() += (lines.back().empty() ? "" : " ") + word;
    }
    at = end + 1;
  }
  return lines;
}

}  // namespace tutti::internal
