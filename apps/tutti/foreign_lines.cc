#include "apps/tutti/foreign_lines.h"

#include <sys/types.h>

#include <cctype>
#include <iostream>

#if defined(__GLIBC__) && defined(__GLIBCXX__)
#define TUTTI_STDERR_CAN_BE_SET  // elsewhere stderr may not be assigned to
#include <ext/stdio_sync_filebuf.h>
#endif

#include "core/terminal.h"

namespace tutti::cli {
namespace {

constexpr std::size_t kMostAlike = 5, kMostKinds = 100, kMostLine = 1000;

std::string WithoutNumbers(const std::string& line) {
  std::string out;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (std::isdigit(static_cast<unsigned char>(line[i])) == 0) {
      out += line[i];
      continue;
    }
    while (i + 1 < line.size() && (std::isxdigit(static_cast<unsigned char>(line[i + 1])) != 0 ||
                                   line[i + 1] == 'x' || line[i + 1] == '.'))
      ++i;
    out += '#';
  }
  return out;
}

}  // namespace

ForeignLines::ForeignLines(bool quiet) : quiet_(quiet) {
  internal::StandardError();  // what it was before
#ifdef TUTTI_STDERR_CAN_BE_SET
  cookie_io_functions_t functions = {};
  functions.write = [](void* self, const char* text, std::size_t size) {
    static_cast<ForeignLines*>(self)->Take(text, size);
    return static_cast<ssize_t>(size);
  };
  stream_ = fopencookie(this, "w", functions);
  if (stream_ == nullptr) return;
  std::setvbuf(stream_, nullptr, _IONBF, 0);
  before_ = stderr;
  stderr = stream_;
  buffer_ = std::make_unique<__gnu_cxx::stdio_sync_filebuf<char>>(stream_);
  cerr_ = std::cerr.rdbuf(buffer_.get());
#endif
}

ForeignLines::~ForeignLines() {
  if (stream_ == nullptr) return;
  std::cerr.rdbuf(cerr_);
#ifdef TUTTI_STDERR_CAN_BE_SET
  stderr = before_;
#endif
  std::fclose(stream_);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!line_.empty()) EndLine();
  for (const auto& [kind, lines] : kinds_) {
    if (lines.count > kMostAlike && !quiet_)
      internal::Say("%zu more lines of a library like '%s'", lines.count - kMostAlike, lines.first.c_str());
  }
}

void ForeignLines::Take(const char* text, std::size_t size) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t i = 0; i < size; ++i) {
    if (text[i] == '\n' || line_.size() >= kMostLine) EndLine();
    if (text[i] != '\n') line_ += text[i];
  }
}

void ForeignLines::EndLine() {
  std::string kind = WithoutNumbers(line_);
  if (kinds_.size() >= kMostKinds && kinds_.count(kind) == 0) kind = "...";
  Kind& lines = kinds_[kind];
  if (lines.count == 0) lines.first = line_;
  if (++lines.count <= kMostAlike && !quiet_)
    std::fprintf(internal::StandardError(), "%s\n", internal::Printable(line_).c_str());
  line_.clear();
}

}  // namespace tutti::cli
