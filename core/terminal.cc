#include "core/terminal.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdarg>

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

std::FILE* StandardError() {
  static std::FILE* const first = stderr;
  return first;
}

std::string Message(std::string_view text, std::FILE* out) {
  if (!text.empty() && text.back() == '\n') text.remove_suffix(1);
  constexpr std::size_t kNarrowest = 20;
  const bool terminal = out != nullptr && isatty(fileno(out)) != 0;
  // Behind a full line some terminals would show an empty one.
  const std::size_t columns = terminal ? std::max(kNarrowest, TerminalColumns(out) - 1) : std::string::npos;
  std::string all;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line = text.substr(at, end - at);
    at = end + 1;
    if (line.size() <= columns) {
      all.append(line) += "\n";
      continue;
    }
    const std::size_t first = std::min(line.find_first_not_of(' '), columns / 2);
    const std::size_t more = std::min(first + 2, columns / 2);
    std::string indent(first, ' ');
    for (const std::string& part : WrapText(line, columns - more)) {
      all += indent + part + "\n";
      indent.resize(more, ' ');
    }
  }
  return all;
}

void Say(const char* format, ...) {
  std::va_list arguments, again;
  va_start(arguments, format);
  va_copy(again, arguments);
  std::vector<char> text(
      static_cast<std::size_t>(std::max(0, std::vsnprintf(nullptr, 0, format, arguments))) + 1);
  std::vsnprintf(text.data(), text.size(), format, again);
  va_end(again);
  va_end(arguments);
  std::fputs(Message(std::string("tutti: ") + text.data()).c_str(), StandardError());
}

}  // namespace tutti::internal
