#include "core/terminal.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdarg>

#include "tutti/core/text.h"

namespace tutti::internal {
namespace {

// Bytes of the character that begins here; 0: it is none of UTF-8. `code`: its number.
std::size_t CharacterSize(std::string_view text, unsigned* code) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned first = byte(0);
  const std::size_t size = first < 0x80 ? 1 : first >= 0xf0 && first < 0xf5 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first >= 0x80 && (first < 0xc2 || first >= 0xf5 || size > text.size())) return 0;
  *code = size == 1 ? first : first & (0x7fu >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
    *code = *code << 6 | (byte(i) & 0x3f);
  }
  return size;
}

bool ActsOnTerminals(unsigned code) {
  const bool control = code < 0x20 || (code >= 0x7f && code < 0xa0);
  const bool direction = (code >= 0x202a && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069) ||
                         code == 0x200e || code == 0x200f;
  return control || direction || code == 0x2028 || code == 0x2029;
}

}  // namespace

std::string Printable(std::string_view text, Breaks breaks) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    unsigned code = 0;
    const std::size_t size = CharacterSize(text, &code);
    const bool is_break = code == '\n' && size == 1 &&
                          (breaks == Breaks::kAll || text.size() == 1 || text.substr(1, 2) == "  ");
    char spelled[16] = {};
    if (size == 0 || (code < 0x80 && ActsOnTerminals(code) && !is_break)) {
      std::snprintf(spelled, sizeof spelled, "\\x%02x", static_cast<unsigned char>(text[0]));
    } else if (ActsOnTerminals(code) && !is_break) {
      std::snprintf(spelled, sizeof spelled, "\\u%04x", code);
    }
    if (code == '\n' && spelled[0] != 0) {
      out += "\\n";
    } else if (spelled[0] != 0) {
      out += spelled;
    } else {
      out += text.substr(0, size);
    }
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  return out;
}

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

std::string Message(std::string_view raw, std::FILE* out, Breaks breaks) {
  const std::string printable = Printable(raw, breaks);
  std::string_view text = printable;
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
