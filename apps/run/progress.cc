#include "apps/run/progress.h"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include "core/terminal.h"

namespace tutti {
namespace {

constexpr std::size_t kMostAlike = 5;  // messages of one kind

// "45 s", "3:20", "2:05:00".
std::string TimeLeft(double seconds) {
  const auto all = static_cast<long long>(std::min(seconds + 0.5, 1e7));
  const long long h = all / 3600, m = all / 60 % 60, s = all % 60;
  char text[40];
  if (h > 0) {
    std::snprintf(text, sizeof text, "%lld:%02lld:%02lld", h, m, s);
  } else if (m > 0) {
    std::snprintf(text, sizeof text, "%lld:%02lld", m, s);
  } else {
    std::snprintf(text, sizeof text, "%lld s", s);
  }
  return text;
}

}  // namespace

Progress::Progress(std::string title, std::size_t total, std::FILE* out, std::size_t columns)
    : title_(std::move(title)),
      total_(total),
      out_(out),
      columns_(columns),
      terminal_(out != nullptr && isatty(fileno(out)) != 0) {}

Progress::~Progress() { Finish(); }

std::size_t Progress::Columns() const { return columns_ > 0 ? columns_ : internal::TerminalColumns(out_); }

std::string Progress::Line(std::size_t done, const std::string& status) const {
  const double seconds = since_begin_.Seconds();
  const double rate = seconds > 0 ? static_cast<double>(done) / seconds : 0.0;
  char text[256];
  if (total_ == 0) {
    std::snprintf(text, sizeof text, " %zu frames  %.1f/s  ", done, rate);
    return (title_ + text + status).substr(0, Columns() - 1);
  }
  const double share = static_cast<double>(done) / static_cast<double>(total_);
  std::snprintf(text, sizeof text, " %3.0f%%  %zu/%zu  %.1f/s  ", 100 * share, done, total_, rate);
  std::string line = text;
  if (rate > 0 && done < total_) line += TimeLeft(static_cast<double>(total_ - done) / rate) + " left  ";
  line += status;
  // A bar where there is room for one.
  constexpr std::size_t kWidest = 24, kNarrowest = 8;
  const std::size_t used = title_.size() + line.size() + 4;
  if (terminal_ && used + kNarrowest <= Columns()) {
    const std::size_t width = std::min(kWidest, Columns() - used);
    const std::size_t filled = std::min(width, static_cast<std::size_t>(share * static_cast<double>(width)));
    line = " [" + std::string(filled, '#') + std::string(width - filled, '.') + "]" + line;
  }
  return (title_ + line).substr(0, Columns() - 1);
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

void Progress::Say(const std::string& status, double first_s) {
  constexpr double kSoon = 1;
  const double seconds = since_begin_.Seconds();
  if (out_ == nullptr || seconds < (terminal_ ? kSoon : std::max(first_s, next_line_s_))) return;
  if (terminal_ && line_open_ && since_line_.Milliseconds() < 100) return;
  since_line_ = {};
  next_line_s_ = 2 * seconds;
  char after[40];
  std::snprintf(after, sizeof after, ", %.0f s", seconds);
  const std::string line = (title_ + " " + status + after).substr(0, Columns() - 1);
  std::fprintf(out_, terminal_ ? "\r%s\x1b[K" : "%s\n", line.c_str());
  line_open_ = terminal_;
  std::fflush(out_);
}

void Progress::Note(const std::string& message, const std::string& more) {
  if (out_ == nullptr || (!more.empty() && ++noted_[more] > kMostAlike)) return;
  std::fprintf(out_, "%s%s", line_open_ ? "\r\x1b[K" : "", internal::Message(message, out_).c_str());
  std::fflush(out_);
}

void Progress::Finish() {
  if (out_ != nullptr && line_open_) std::fputc('\n', out_);
  line_open_ = false;
  for (const auto& [more, count] : std::exchange(noted_, {})) {
    if (count > kMostAlike) Note("tutti: " + std::to_string(count - kMostAlike) + " more " + more);
  }
}

}  // namespace tutti
