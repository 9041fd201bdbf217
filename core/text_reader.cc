#include "core/text_reader.h"

#include <cstring>
#include <system_error>
#include <utility>

#include "tutti/core/error.h"

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

}  // namespace tutti::internal
