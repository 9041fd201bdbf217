#include "apps/run/progress.h"

#include <unistd.h>

#include <algorithm>
#include <utility>

namespace tutti {

Progress::Progress(std::string title, std::size_t total, std::FILE* out)
    : title_(std::move(title)),
      total_(total),
      out_(out),
      terminal_(out != nullptr && isatty(fileno(out)) != 0) {}

Progress::~Progress() { Finish(); }

std::string Progress::Line(std::size_t done, const std::string& status) const {
  const double seconds = since_begin_.Seconds();
  char text[256];
  const double share = total_ > 0 ? static_cast<double>(done) / static_cast<double>(total_) : 1.0;
  if (total_ == 0) {
    std::snprintf(text, sizeof text, " %zu frames  %.1f/s  %s", done,
                  seconds > 0 ? static_cast<double>(done) / seconds : 0.0, status.c_str());
    return title_ + text;
  }
  std::snprintf(text, sizeof text, " %3.0f%%  %zu/%zu frames  %.1f/s  %s", 100 * share, done, total_,
                seconds > 0 ? static_cast<double>(done) / seconds : 0.0, status.c_str());
  if (!terminal_) return title_ + text;
  constexpr std::size_t kWidth = 24;
  const std::size_t filled = std::min(kWidth, static_cast<std::size_t>(share * static_cast<double>(kWidth)));
  return title_ + " [" + std::string(filled, '#') + std::string(kWidth - filled, '.') + "]" + text;
}

void Progress::Update(std::size_t done, const std::string& status) {
  if (out_ == nullptr) return;
  if (terminal_) {
    if ((done < total_ || total_ == 0) && line_open_ && since_line_.Milliseconds() < 100) return;
    since_line_ = {};
    std::fprintf(out_, "\r%s\x1b[K", Line(done, status).c_str());
    line_open_ = true;
  } else {
    const std::size_t step = total_ > 0 ? total_ : 1000;  // unknown: a line for each 100 frames
    if (done * 10 < next_tenth_ * step) return;
    while (next_tenth_ * step <= done * 10) ++next_tenth_;
    std::fprintf(out_, "%s\n", Line(done, status).c_str());
  }
  std::fflush(out_);
}

void Progress::Note(const std::string& message) {
  if (out_ == nullptr) return;
  std::fprintf(out_, "%s%s\n", line_open_ ? "\r\x1b[K" : "", message.c_str());
  std::fflush(out_);
}

void Progress::Finish() {
  if (out_ != nullptr && line_open_) std::fputc('\n', out_);
  line_open_ = false;
}

}  // namespace tutti
