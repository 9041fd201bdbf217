// The contact sheet of `tutti loops`: what went wrong, to look at.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "apps/plot/plot_picture.h"
#include "apps/tutti/loops/loops_output.h"
#include "apps/tutti/text_table.h"
#include "tutti/loopclosure/features.h"

namespace tutti::cli {
namespace {

constexpr std::size_t kMostRows = 24;  // half of them for either kind where both have more
constexpr int kThumbWidth = 400, kThumbHeight = 240, kMargin = 16;  // [px]
constexpr int kWidth = 3 * kThumbWidth + 4 * kMargin;
constexpr int kCaption = 84, kHeader = 84;
constexpr double kTextHeight = 15;

struct Entry {
  std::size_t row = 0;  // of LoopRun::rows
  bool missed = false;
  bool found = false;  // accepted, and nobody knows whether rightly
};

std::vector<std::size_t> RowsOf(const LoopReport& report, LoopOutcome outcome) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < report.verified.outcomes.size(); ++i) {
    if (report.verified.outcomes[i] == outcome) rows.push_back(i);
  }
  return rows;
}

// At most `count`, evenly over the list: neighbours fail for the same reason.
std::vector<std::size_t> Spread(const std::vector<std::size_t>& rows, std::size_t count) {
  if (rows.size() <= count) return rows;
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < count; ++k) chosen.push_back(rows[k * rows.size() / count]);
  return chosen;
}

std::vector<Entry> Choose(std::vector<std::size_t> wrong, const std::vector<std::size_t>& missed,
                          const LoopRun& run) {
  std::stable_sort(wrong.begin(), wrong.end(), [&](std::size_t a, std::size_t b) {
    return run.rows[a].result.probability > run.rows[b].result.probability;
  });
  const std::size_t half = kMostRows / 2;
  const std::size_t wrong_count =
      std::min(wrong.size(), std::max(half, kMostRows - std::min(kMostRows, missed.size())));
  wrong.resize(wrong_count);
  std::vector<Entry> entries;
  for (const std::size_t row : wrong) entries.push_back({row, false});
  for (const std::size_t row : Spread(missed, kMostRows - wrong_count)) entries.push_back({row, true});
  return entries;
}

// A line of text where an image would be.
cv::Mat EmptyThumb(const char* text) {
  cv::Mat thumb(kThumbHeight, kThumbWidth, CV_8UC3, cv::Scalar::all(236));
  DrawShapes(
      {PlotText({0.5 * kThumbWidth, 0.5 * kThumbHeight}, text, kTextHeight, PlotShape::Anchor::kMiddle)},
      thumb);
  return thumb;
}

// Colour, 8 bits, in the middle of a thumb.
cv::Mat Thumb(cv::Mat read) {
  if (read.empty()) return EmptyThumb("the image can't be read");
  cv::Mat thumb(kThumbHeight, kThumbWidth, CV_8UC3, cv::Scalar::all(236));
  if (read.depth() != CV_8U) read = ToGrey8(read);
  if (read.channels() == 1) cv::cvtColor(read, read, cv::COLOR_GRAY2BGR);
  if (read.channels() == 4) cv::cvtColor(read, read, cv::COLOR_BGRA2BGR);
  const double scale =
      std::min(static_cast<double>(kThumbWidth) / read.cols, static_cast<double>(kThumbHeight) / read.rows);
  const cv::Size size(std::max(1, static_cast<int>(read.cols * scale)),
                      std::max(1, static_cast<int>(read.rows * scale)));
  cv::resize(read, read, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  read.copyTo(thumb(
      cv::Rect((kThumbWidth - size.width) / 2, (kThumbHeight - size.height) / 2, size.width, size.height)));
  return thumb;
}

std::string Name(const LoopRun& run, long image) {
  if (image < 0) return "none";
  std::string text = std::to_string(run.Number(image));
  if (image < static_cast<long>(run.rows.size()))
    text += " (" + run.rows[static_cast<std::size_t>(image)].file + ")";
  return text;
}

// The loops of a row, and the one nearest to what was said; the middle one if nothing was.
struct TruthOfRow {
  std::vector<long> loops;
  long shown = -1;
};

TruthOfRow LookUp(const LoopGroundTruth& truth, int row, long said) {
  TruthOfRow result;
  for (int c = 0; c < row; ++c) {
    if (truth.At(row, c) == LoopLabel::kLoop) result.loops.push_back(c);
  }
  if (result.loops.empty()) return result;
  const auto nearer = [said](long a, long b) { return std::labs(a - said) < std::labs(b - said); };
  result.shown = said < 0 ? result.loops[result.loops.size() / 2]
                          : *std::min_element(result.loops.begin(), result.loops.end(), nearer);
  return result;
}

std::string TruthText(const LoopRun& run, const TruthOfRow& truth) {
  if (truth.loops.empty()) return "truth: no loop";
  std::string text = "truth: " + Name(run, truth.shown);
  if (truth.loops.size() > 1)
    text += ", of " + std::to_string(truth.loops.size()) + " from " +
            std::to_string(run.Number(truth.loops.front())) + " to " +
            std::to_string(run.Number(truth.loops.back()));
  return text;
}

std::string Numbers(const LoopRun& run, const LoopResult& r) {
  const std::string line = Formatted("H = %.3f, posterior of the best %.3f, probability %.3f", r.hypothesis,
                                     r.posterior, r.probability);
  if (r.verification.candidate < 0) return line + ", nothing was verified";
  return line + Formatted("; %d inliers of %d matches with image %ld", r.verification.inliers,
                          r.verification.matches, run.Number(r.verification.candidate));
}

// As much of a text as fits.
std::string Fitted(std::string text, double width) {
  if (TextWidth(text, kTextHeight) <= width) return text;
  while (!text.empty() && TextWidth(text + "...", kTextHeight) > width) text.pop_back();
  return text + "...";
}

// One or two lines, broken between words.
std::vector<std::string> Wrapped(const std::string& text, double width) {
  std::size_t end = text.size();
  while (TextWidth(text.substr(0, end), kTextHeight) > width) {
    const std::size_t space = end == 0 ? std::string::npos : text.rfind(' ', end - 1);
    if (space == std::string::npos) return {Fitted(text, width)};
    end = space;
  }
  if (end == text.size()) return {text};
  return {text.substr(0, end), Fitted(text.substr(end + 1), width)};
}

// Where nothing is known: accepted loops, evenly.
std::vector<Entry> ChooseFound(const LoopRun& run) {
  std::vector<std::size_t> accepted;
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    if (run.rows[i].result.accepted) accepted.push_back(i);
  }
  std::vector<Entry> entries;
  for (const std::size_t row : Spread(accepted, kMostRows)) entries.push_back({row, false, true});
  return entries;
}

// The images of a row: its own, what was said, what is true; -1: none.
struct Shown {
  TruthOfRow truth;
  std::array<long, 3> images;
};

Shown ShownBy(const LoopRun& run, const Entry& entry) {
  const LoopRow& row = run.rows[entry.row];
  const int image = static_cast<int>(row.result.query);
  const TruthOfRow truth = LookUp(run.truth, image, row.Said());
  return {truth, {image, row.Said(), truth.shown}};
}

using Thumbs = std::map<long, cv::Mat>;

// In the order of their numbers: a video's frames are not to be had in any other without beginning again.
Thumbs ReadThumbs(const LoopRun& run, const std::vector<Entry>& entries) {
  Thumbs thumbs;
  for (const Entry& entry : entries) {
    for (const long image : ShownBy(run, entry).images) {
      if (image >= 0 && image < static_cast<long>(run.rows.size())) thumbs[image];
    }
  }
  for (auto& [image, thumb] : thumbs) thumb = Thumb(run.image(static_cast<std::size_t>(image)));
  return thumbs;
}

void DrawEntry(const LoopRun& run, const Entry& entry, const Thumbs& thumbs, cv::Mat strip) {
  const LoopRow& row = run.rows[entry.row];
  const LoopResult& r = row.result;
  const auto [truth, shown] = ShownBy(run, entry);
  const long image = shown[0], said = shown[1];
  const char* absent[] = {"", "nothing was proposed",
                          entry.found ? "there is no ground truth" : "no loop in the ground truth"};
  const std::string heads[] = {"image " + Name(run, image),
                               (r.accepted ? "accepted: " : "best: ") + Name(run, said),
                               entry.found ? "" : TruthText(run, truth)};
  const std::string color = entry.found ? kTrueColor : entry.missed ? kMissedColor : kFalseColor;
  std::string reason = !row.read ? "the image can't be read" : r.reason;
  if (entry.missed && r.accepted) reason = "accepted on a pair that the ground truth ignores";
  if (!entry.missed) reason = "accepted";
  std::vector<PlotShape> shapes = {PlotBox({kMargin, 4}, {kWidth - kMargin, 8}, color)};
  for (int k = 0; k < 3; ++k) {
    const int left = kMargin + k * (kThumbWidth + kMargin);
    const auto found = thumbs.find(shown[static_cast<std::size_t>(k)]);
    const cv::Mat thumb = found != thumbs.end() ? found->second : EmptyThumb(absent[k]);
    thumb.copyTo(strip(cv::Rect(left, kCaption, kThumbWidth, kThumbHeight)));
    shapes.push_back(
        PlotText({static_cast<double>(left), kCaption - 8.0}, Fitted(heads[k], kThumbWidth), kTextHeight));
  }
  const std::string kind = entry.found ? "loop: " : entry.missed ? "missed: " : "false positive: ";
  const std::string line = kind + Numbers(run, r) + "; " + reason;
  double y = 28;
  for (const std::string& part : Wrapped(line, kWidth - 2 * kMargin)) {
    shapes.push_back(PlotText({kMargin, y}, part, kTextHeight));
    y += 21;
  }
  DrawShapes(shapes, strip);
}

}  // namespace

void WriteContactSheet(const LoopRun& run, const LoopReport& report, const std::filesystem::path& file) {
  const std::vector<std::size_t> wrong = RowsOf(report, LoopOutcome::kFalsePositive);
  const std::vector<std::size_t> missed = RowsOf(report, LoopOutcome::kMissed);
  const std::vector<Entry> entries = run.judged ? Choose(wrong, missed, run) : ChooseFound(run);
  const int strip = kCaption + kThumbHeight + kMargin;
  const int height = kHeader + std::max(1, static_cast<int>(entries.size())) * strip;
  cv::Mat picture(height, kWidth, CV_8UC3, cv::Scalar::all(255));

  std::string summary = Formatted("false positives: %zu, missed loops: %zu, at probability >= %g",
                                  wrong.size(), missed.size(), run.options.loop_threshold);
  if (!run.judged) {
    summary = std::to_string(entries.size()) + " of the accepted loops, evenly; all are in loops.csv";
  } else if (entries.size() < wrong.size() + missed.size())
    summary +=
        "; " + std::to_string(entries.size()) +
        " are shown: the most probable of the false ones, the missed ones evenly; all are in hypotheses.csv";
  std::vector<PlotShape> shapes = {PlotText({kMargin, 34}, RunTitle(run, report), 20),
                                   PlotText({kMargin, 64}, summary, 16)};
  if (entries.empty())
    shapes.push_back(PlotText({0.5 * kWidth, kHeader + 0.5 * strip},
                              run.judged ? "none: no false positive, no missed loop" : "no loop was accepted",
                              22, PlotShape::Anchor::kMiddle));
  DrawShapes(shapes, picture);
  const Thumbs thumbs = ReadThumbs(run, entries);
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const int top = kHeader + static_cast<int>(k) * strip;
    DrawEntry(run, entries[k], thumbs, picture(cv::Rect(0, top, kWidth, strip)));
  }
  WritePicture(file, picture);
}

}  // namespace tutti::cli
