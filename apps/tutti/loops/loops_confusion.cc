// The confusion picture of `tutti loops`: who was taken for whom.
#include <algorithm>
#include <cmath>
#include <vector>

#include "apps/plot/plot_picture.h"
#include "apps/tutti/loops/loops_output.h"
#include "apps/tutti/text_table.h"

namespace tutti::cli {
namespace {

constexpr int kSide = 600;             // of a panel [px]
constexpr int kGap = 100, kLeft = 90;  // [px]
constexpr int kTop = 100, kBottom = 80;
constexpr const char* kUnused = "#f3f3f3";  // the upper triangle

const cv::Vec3b Bgr(const char* hex) {
  const cv::Scalar color = PlotColor(hex);
  return {static_cast<std::uint8_t>(color[0]), static_cast<std::uint8_t>(color[1]),
          static_cast<std::uint8_t>(color[2])};
}

// The panel's pixel k stands for images [first, last) of n: many where n is large, one where it is small.
struct Span {
  int first, last;
};
Span Images(int k, int n) {
  const auto at = [n](int i) { return static_cast<int>(static_cast<long long>(i) * n / kSide); };
  return {at(k), std::max(at(k) + 1, at(k + 1))};
}

// White to blue to near black; the root shows the small values, too.
cv::Vec3b PosteriorColor(double p) {
  const double s = std::sqrt(std::clamp(p, 0.0, 1.0));
  const cv::Vec3b light(255, 255, 255), middle = Bgr(kTrueColor), dark(40, 15, 0);
  const cv::Vec3b &a = s < 0.5 ? light : middle, &b = s < 0.5 ? middle : dark;
  const double t = s < 0.5 ? 2 * s : 2 * s - 1;
  cv::Vec3b color;
  for (int k = 0; k < 3; ++k) color[k] = static_cast<std::uint8_t>(std::lround(a[k] + t * (b[k] - a[k])));
  return color;
}

void PaintTruth(const LoopGroundTruth& truth, const char* loop, const char* ignored, cv::Mat panel) {
  const cv::Vec3b colors[3] = {cv::Vec3b(255, 255, 255), Bgr(ignored), Bgr(loop)};
  for (int y = 0; y < kSide; ++y) {
    const Span rows = Images(y, truth.size());
    for (int x = 0; x < kSide; ++x) {
      const Span columns = Images(x, truth.size());
      if (columns.first >= rows.last) {
        panel.at<cv::Vec3b>(y, x) = Bgr(kUnused);
        continue;
      }
      int level = 0;  // a loop shows through everything else
      for (int r = rows.first; r < rows.last; ++r) {
        for (int c = columns.first; c < std::min(columns.last, r); ++c) {
          const LoopLabel label = truth.At(r, c);
          level = std::max(level, label == LoopLabel::kLoop ? 2 : label == LoopLabel::kIgnore ? 1 : 0);
        }
      }
      panel.at<cv::Vec3b>(y, x) = colors[level];
    }
  }
}

void PaintPosterior(const cv::Mat& posterior, cv::Mat panel) {
  for (int y = 0; y < kSide; ++y) {
    const int row = Images(y, posterior.rows).first;
    for (int x = 0; x < kSide; ++x) {
      const int column = Images(x, posterior.cols).first;
      panel.at<cv::Vec3b>(y, x) =
          column > row ? Bgr(kUnused) : PosteriorColor(static_cast<double>(posterior.at<float>(row, column)));
    }
  }
}

PlotAxes PanelAxes(int number, int images, const std::string& title) {
  PlotAxes axes;
  const double left = kLeft + number * (kSide + kGap);
  axes.top_left = {left, kTop};
  axes.bottom_right = {left + kSide, kTop + kSide};
  axes.low = {0, images};  // rows run down
  axes.high = {images, 0};
  axes.title = title;
  axes.x_name = "past image";
  axes.y_name = "current image";
  axes.grid = false;
  return axes;
}

// Marks, apart in colour and in shape.
enum class Mark { kTrue, kFalse, kMissed, kIgnored, kRejected };

void AddMark(Mark mark, const Eigen::Vector2d& at, double r, std::vector<PlotShape>& shapes) {
  const auto offset = [&](double x, double y) { return Eigen::Vector2d(at.x() + r * x, at.y() + r * y); };
  switch (mark) {
    case Mark::kTrue:
      shapes.push_back(PlotDisc(at, r, kTrueColor));
      break;
    case Mark::kFalse:
      shapes.push_back(PlotLine(offset(-1.3, -1.3), offset(1.3, 1.3), kFalseColor, 2));
      shapes.push_back(PlotLine(offset(-1.3, 1.3), offset(1.3, -1.3), kFalseColor, 2));
      break;
    case Mark::kMissed: {
      PlotShape triangle = PlotLine(offset(0, -1.5), offset(1.4, 1), kMissedColor, 2);
      triangle.points.push_back(offset(-1.4, 1));
      triangle.points.push_back(offset(0, -1.5));
      shapes.push_back(triangle);
      break;
    }
    case Mark::kIgnored:
      shapes.push_back(PlotBox(offset(-0.8, -0.8), offset(0.8, 0.8), "#777777"));
      break;
    case Mark::kRejected:
      shapes.push_back(PlotDisc(at, 0.6 * r, "#aaaaaa"));
      break;
  }
}

int MiddleLoop(const LoopGroundTruth& truth, int row) {
  std::vector<int> columns;
  for (int c = 0; c < row; ++c) {
    if (truth.At(row, c) == LoopLabel::kLoop) columns.push_back(c);
  }
  return columns.empty() ? -1 : columns[columns.size() / 2];
}

void AddMarks(const LoopRun& run, const LoopReport& report, const PlotAxes& axes,
              std::vector<PlotShape>& shapes) {
  const double radius = std::clamp(0.6 * kSide / std::max(1, run.truth.size()), 3.0, 6.0);
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    const LoopResult& r = run.rows[i].result;
    const int row = static_cast<int>(r.query);
    const auto put = [&](Mark mark, long column) {
      if (column < 0) return;
      AddMark(mark, axes.Page({static_cast<double>(column) + 0.5, row + 0.5}), radius, shapes);
    };
    const long said = run.rows[i].Said();
    switch (report.verified.outcomes[i]) {
      case LoopOutcome::kTruePositive:
        put(Mark::kTrue, said);
        break;
      case LoopOutcome::kFalsePositive:
        put(Mark::kFalse, said);
        break;
      case LoopOutcome::kMissed:
        put(Mark::kMissed, MiddleLoop(run.truth, row));
        break;
      case LoopOutcome::kIgnored:
        put(Mark::kIgnored, said);
        break;
      case LoopOutcome::kNothing:
        if (r.proposed) put(Mark::kRejected, said);
        break;
    }
  }
}

// The upper triangle of every panel is free for its legend; entry k lies above the diagonal.
class Legend {
 public:
  Legend(const PlotAxes& axes, std::vector<PlotShape>& shapes)
      : x_(axes.bottom_right.x() - 350), y_(axes.top_left.y() + 26), shapes_(shapes) {}

  void Box(const std::string& color, const std::string& text) {
    shapes_.push_back(PlotBox({x_ - 8, y_ - 8}, {x_ + 8, y_ + 8}, "#555555"));
    shapes_.push_back(PlotBox({x_ - 7, y_ - 7}, {x_ + 7, y_ + 7}, color));
    Text(text);
  }
  void Marked(Mark mark, const std::string& text) {
    AddMark(mark, {x_, y_}, 6, shapes_);
    Text(text);
  }

 private:
  void Text(const std::string& text) {
    shapes_.push_back(PlotText({x_ + 18, y_ + 5}, text, 14));
    y_ += 24;
  }
  double x_, y_;
  std::vector<PlotShape>& shapes_;
};

std::string Hex(const cv::Vec3b& bgr) { return Formatted("#%02x%02x%02x", bgr[2], bgr[1], bgr[0]); }

void AddOutcomeLegend(const LoopRun& run, const LoopReport& report, const PlotAxes& axes,
                      std::vector<PlotShape>& shapes) {
  const std::vector<LoopOutcome>& outcomes = report.verified.outcomes;
  long rejected = 0;
  for (std::size_t i = 0; i < outcomes.size(); ++i)
    rejected += outcomes[i] == LoopOutcome::kNothing && run.rows[i].result.proposed ? 1 : 0;
  Legend legend(axes, shapes);
  const auto counted = [&](Mark mark, const char* text, long count) {
    legend.Marked(mark, Formatted("%s (%ld)", text, count));
  };
  const auto all = [&](LoopOutcome outcome) {
    return static_cast<long>(std::count(outcomes.begin(), outcomes.end(), outcome));
  };
  counted(Mark::kTrue, "true", all(LoopOutcome::kTruePositive));
  counted(Mark::kFalse, "false", all(LoopOutcome::kFalsePositive));
  counted(Mark::kMissed, "missed, at its true place", all(LoopOutcome::kMissed));
  counted(Mark::kIgnored, "on an ignored pair", all(LoopOutcome::kIgnored));
  counted(Mark::kRejected, "proposed, rightly rejected", rejected);
  legend.Box("#bfdcee", "ground truth: same place");
  legend.Box("#e4e4e4", "ignored");
}

}  // namespace

void AddPosterior(const LoopResult& result, int images, cv::Mat& posterior) {
  const int side = std::min(images, kSide);
  if (posterior.empty()) posterior = cv::Mat::zeros(side, side, CV_32FC1);
  const auto cell = [&](std::int64_t image) { return static_cast<int>(image * side / images); };
  if (result.query < 0 || result.query >= images) return;
  for (const auto& [id, p] : result.posterior_by_location) {
    if (id < 0 || id >= images) continue;
    float& value = posterior.at<float>(cell(result.query), cell(id));
    value = std::max(value, static_cast<float>(p));
  }
}

void WriteConfusion(const LoopRun& run, const LoopReport& report, const std::filesystem::path& file) {
  const int panels = run.posterior.empty() ? 2 : 3;
  const int width = kLeft + panels * kSide + (panels - 1) * kGap + 40;
  cv::Mat picture(kTop + kSide + kBottom, width, CV_8UC3, cv::Scalar::all(255));
  std::vector<PlotShape> shapes;
  const int images = std::max(1, run.truth.size());
  int number = 0;
  const auto panel = [&](const PlotAxes& axes) {
    return picture(cv::Rect(static_cast<int>(axes.top_left.x()), kTop, kSide, kSide));
  };

  const PlotAxes truth_axes = PanelAxes(number++, images, "ground truth");
  PaintTruth(run.truth, kTrueColor, "#c4c4c4", panel(truth_axes));
  AddAxes(truth_axes, shapes);
  Legend truth_legend(truth_axes, shapes);
  truth_legend.Box(kTrueColor, "same place");
  truth_legend.Box("#c4c4c4", "ignored");
  truth_legend.Box("#ffffff", "another place");

  if (panels == 3) {
    const PlotAxes axes = PanelAxes(number++, images, "posterior of every past image");
    PaintPosterior(run.posterior, panel(axes));
    AddAxes(axes, shapes);
    Legend legend(axes, shapes);
    for (const double p : {1.0, 0.5, 0.25, 0.1, 0.01, 0.0})
      legend.Box(Hex(PosteriorColor(p)), Formatted("%g", p));
  }

  const PlotAxes axes =
      PanelAxes(number, images, Formatted("what was said, at probability >= %g", run.options.loop_threshold));
  PaintTruth(run.truth, "#bfdcee", "#e4e4e4", panel(axes));
  AddAxes(axes, shapes);
  AddMarks(run, report, axes, shapes);
  AddOutcomeLegend(run, report, axes, shapes);

  shapes.push_back(PlotText({0.5 * width, 36}, RunTitle(run, report), 22, PlotShape::Anchor::kMiddle));
  DrawShapes(shapes, picture);
  WritePicture(file, picture);
}

}  // namespace tutti::cli
