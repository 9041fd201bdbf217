#include "core/text_reader.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <optional>
#include <system_error>
#include <utility>

#include "core/numbers.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::internal {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBlockBytes = std::size_t{64} << 10;
constexpr char kByteOrderMark[] = "\xEF\xBB\xBF";

// /dev/fd/63 is what a shell makes of <(command); somebody writes there.
bool IsOfThisProcess(const fs::path& file) {
  return file.native().rfind("/dev/", 0) == 0 || file.native().rfind("/proc/", 0) == 0;
}

}  // namespace

void RequireFile(const fs::path& file, const std::string& advice) {
  std::error_code ignored;
  const fs::file_status status = fs::status(file, ignored);
  if (fs::is_directory(status)) throw InputError(file.string() + ": is a folder; " + advice);
  if ((fs::is_fifo(status) && !IsOfThisProcess(file)) || fs::is_socket(status))
    throw InputError(file.string() + ": is a pipe, not a file; " + advice);
  if (!fs::exists(status)) throw InputError(file.string() + ": can't be opened; " + advice);
}

TextReader::TextReader(fs::path file, const std::string& advice) : file_(std::move(file)) {
  RequireFile(file_, advice);
  in_.open(file_, std::ios::binary);
  if (!in_) throw InputError(file_.string() + ": can't be opened; " + advice);
}

void TextReader::Fail(const std::string& what) const {
  throw InputError(file_.string() + ":" + std::to_string(number_) + ": " + what);
}

bool TextReader::Fill() {
  block_.resize(kBlockBytes);
  in_.read(block_.data(), static_cast<std::streamsize>(block_.size()));
  begin_ = 0;
  end_ = static_cast<std::size_t>(in_.gcount());
  if (in_.bad()) throw InputError(file_.string() + ": could not be read to its end");
  return end_ > 0;
}

bool TextReader::Next(std::string& line) {
  line.clear();
  if (begin_ == end_ && !Fill()) return false;
  ++number_;
  for (bool whole = false; !whole && (begin_ < end_ || Fill());) {
    const char* const begin = block_.data() + begin_;
    const std::size_t left = end_ - begin_;
    const void* const feed = std::memchr(begin, '\n', left);
    whole = feed != nullptr;
    const std::size_t size = whole ? static_cast<std::size_t>(static_cast<const char*>(feed) - begin) : left;
    if (std::memchr(begin, '\0', size) != nullptr) {
      Fail(
          "holds zero bytes, which no text in UTF-8 does; is it a binary file, or UTF-16? (iconv -f UTF-16 "
          "-t UTF-8)");
    }
    if (line.size() + size > kMostLineBytes)
      Fail("this line is longer than " + std::to_string(kMostLineBytes >> 20) + " MiB; is it a text file?");
    line.append(begin, size);
    begin_ += size + (whole ? 1 : 0);
  }
  if (number_ == 1 && line.rfind(kByteOrderMark, 0) == 0) line.erase(0, sizeof kByteOrderMark - 1);
  return true;
}

std::string ReadText(const fs::path& file, const std::string& advice, std::size_t most_bytes) {
  TextReader in(file, advice);
  std::string text, line;
  while (in.Next(line)) {
    if (text.size() + line.size() >= most_bytes) {
      throw InputError(file.string() + ": is larger than " + std::to_string(most_bytes / 1000000) + " MB; " +
                       advice);
    }
    text += line;
    text += '\n';
  }
  return text;
}

std::string Excerpt(const std::string& word) {
  constexpr std::size_t kMost = 40;
  return word.size() <= kMost ? word : word.substr(0, kMost) + "...";
}

std::string DecimalComma(const std::string& line) {
  if (line.find(',') == std::string::npos) return {};  // nearly all lines
  const std::vector<std::string> words = SplitText(line, " \t\r;");
  if (words.size() < 2) return {};
  const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  for (const std::string& word : words) {
    const std::size_t comma = word.find(',');
    if (comma == std::string::npos) continue;
    const bool between =
        comma > 0 && comma + 1 < word.size() && digit(word[comma - 1]) && digit(word[comma + 1]);
    if (between && std::count(word.begin(), word.end(), ',') == 1) return word;
    return {};
  }
  return {};
}

void FailAt(const std::filesystem::path& file, std::size_t line, const std::string& what) {
  throw InputError(file.string() + ":" + std::to_string(line) + ": " + what);
}

bool IsComment(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  return first != std::string::npos && (text[first] == '#' || text[first] == '%');
}

void ForEachLine(const std::filesystem::path& file,
                 const std::function<void(std::size_t, const std::vector<std::string>&)>& use,
                 const TakesLine& names) {
  TextReader in(file);
  std::string text;
  while (in.Next(text)) {
    const std::size_t line = in.number();
    if (names(text)) continue;
    const std::size_t comment = text.find('#');
    if (comment != std::string::npos) text.resize(comment);
    const std::string comma = DecimalComma(text);
    if (!comma.empty())
      FailAt(file, line, "'" + Excerpt(comma) + "' has a decimal comma; write decimal points");
    const std::vector<std::string> words = SplitText(text, " \t\r,;");
    if (!words.empty()) use(line, words);
  }
}

double NumberAt(const std::filesystem::path& file, std::size_t line, const std::string& word) {
  const std::optional<double> value = ParseDouble(word);
  if (!value) FailAt(file, line, "'" + Excerpt(word) + "' is not a number");
  if (!std::isfinite(*value))
    FailAt(file, line, "'" + word + "' is not finite; remove this pose or repair the file");
  constexpr double kLargest = 1e100;  // squares of what is beyond it overflow
  if (std::abs(*value) > kLargest)
    FailAt(file, line,
           "'" + Excerpt(word) + "' is too large to compute with; remove this pose or repair the file");
  return *value;
}

MotionSigma SigmaAt(const std::filesystem::path& file, std::size_t line, const std::string& translation,
                    const std::string& rotation) {
  const double metres = NumberAt(file, line, translation), degrees = NumberAt(file, line, rotation);
  if (metres < 0 || degrees < 0) FailAt(file, line, "a standard deviation is below 0");
  return {metres, degrees * kRadians};
}

}  // namespace tutti::internal
