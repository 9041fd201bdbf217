// Pictures of loops: the image, the place that was meant, and the features that match.
#include <algorithm>
#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/report/report_parts.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"

namespace tutti::report {
namespace {

constexpr std::size_t kMostOfAKind = 8;
constexpr int kWidth = 360;       // of either image [px]
constexpr int kMostHeight = 360;  // [px]
constexpr int kGap = 4;           // between the two [px]
constexpr int kQuality = 72;      // of the JPEG, 0..100

using PixelPair = std::pair<cv::Point2f, cv::Point2f>;

// BGR, of Okabe and Ito's palette as in the page, in the order of the outcomes.
const cv::Scalar kColors[] = {{115, 158, 0}, {0, 94, 213}, {0, 159, 230}, {167, 121, 204}};

// Nobody tried these two images, so they are matched for the picture alone: ORB, mutual best matches, one
// epipolar geometry.
std::vector<PixelPair> MatchForThePicture(const cv::Mat& query, const cv::Mat& candidate) {
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000);
  std::vector<cv::KeyPoint> points_q, points_c;
  cv::Mat rows_q, rows_c;
  orb->detectAndCompute(query, cv::noArray(), points_q, rows_q);
  orb->detectAndCompute(candidate, cv::noArray(), points_c, rows_c);
  if (rows_q.rows < 8 || rows_c.rows < 8) return {};
  std::vector<cv::DMatch> matches;
  cv::BFMatcher(cv::NORM_HAMMING, true).match(rows_q, rows_c, matches);
  std::vector<cv::Point2f> q, c;
  for (const cv::DMatch& match : matches) {
    q.push_back(points_q[static_cast<std::size_t>(match.queryIdx)].pt);
    c.push_back(points_c[static_cast<std::size_t>(match.trainIdx)].pt);
  }
  if (q.size() < 8) return {};
  std::vector<unsigned char> inlier;
  cv::setRNGSeed(1);
  if (cv::findFundamentalMat(q, c, cv::FM_RANSAC, 2.0, 0.99, inlier).empty()) return {};
  std::vector<PixelPair> out;
  for (std::size_t i = 0; i < q.size() && out.size() < DetectionLog::kMostMatches; ++i) {
    if (inlier[i] != 0) out.emplace_back(q[i], c[i]);
  }
  return out;
}

cv::Mat Coloured(const cv::Mat& grey, double scale) {
  cv::Mat small, out;
  cv::resize(grey, small, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  cv::cvtColor(small, out, cv::COLOR_GRAY2BGR);
  return out;
}

std::string PictureOf(const cv::Mat& query, const cv::Mat& candidate, const std::vector<PixelPair>& matches,
                      Outcome outcome) {
  const double scale =
      std::min(static_cast<double>(kWidth) / query.cols, static_cast<double>(kMostHeight) / query.rows);
  const cv::Mat left = Coloured(query, scale), right = Coloured(candidate, scale);
  cv::Mat picture(std::max(left.rows, right.rows), left.cols + kGap + right.cols, CV_8UC3,
                  cv::Scalar::all(128));
  left.copyTo(picture(cv::Rect({0, 0}, left.size())));
  right.copyTo(picture(cv::Rect({left.cols + kGap, 0}, right.size())));
  const cv::Point2f offset(static_cast<float>(left.cols + kGap), 0);
  const auto factor = static_cast<float>(scale);
  for (const auto& [q, c] : matches) {
    cv::line(picture, factor * q, factor * c + offset, kColors[static_cast<int>(outcome)], 1, cv::LINE_AA);
    cv::circle(picture, factor * q, 2, cv::Scalar::all(255), 1, cv::LINE_AA);
    cv::circle(picture, factor * c + offset, 2, cv::Scalar::all(255), 1, cv::LINE_AA);
  }
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return "data:image/jpeg;base64," + Base64(bytes.data(), bytes.size());
}

cv::Mat ReadGrey(const Dataset& dataset, double stamp_s) {
  const std::optional<std::size_t> place = FindStamp(dataset, stamp_s);
  if (!place) return {};
  const ReadResult read = dataset.Read(*place);
  return read.frame ? read.frame->image : cv::Mat();
}

std::string Describe(const ShownLoop& loop, std::size_t drawn, bool for_the_picture) {
  char text[200];
  std::snprintf(text, sizeof text, "H = %.3f, probability %.3f", loop.hypothesis, loop.probability);
  std::string out = text;
  if (loop.matches > 0)
    out += ", " + std::to_string(loop.inliers) + " inliers of " + std::to_string(loop.matches) + " matches";
  if (for_the_picture) {
    out += drawn > 0 ? "; lines: ORB matches of one epipolar geometry, made for this picture"
                     : "; ORB finds no common epipolar geometry either";
  }
  if (!loop.reason.empty()) out += "; " + loop.reason;
  return out;
}

Json Entry(const Dataset& dataset, const ShownLoop& loop) {
  const cv::Mat query = ReadGrey(dataset, loop.query_stamp_s),
                candidate = ReadGrey(dataset, loop.candidate_stamp_s);
  if (query.empty() || candidate.empty()) return Json();
  const bool tried = loop.detection != nullptr && loop.detection->candidate == loop.candidate &&
                     !loop.detection->matches.empty();
  const std::vector<PixelPair> matches =
      tried ? loop.detection->matches : MatchForThePicture(query, candidate);
  return {{"outcome", ToString(loop.outcome)},
          {"title", "frame " + std::to_string(loop.query) + " and frame " + std::to_string(loop.candidate)},
          {"text", Describe(loop, matches.size(), !tried)},
          {"drawn", matches.size()},
          {"picture", PictureOf(query, candidate, matches, loop.outcome)}};
}

}  // namespace

Json GalleryJson(const RunResult& result, const std::vector<ShownLoop>& loops) {
  Json json = {{"note", ""}, {"entries", Json::array()}};
  if (loops.empty()) return json;
  if (IsCamera(result.dataset)) {
    json["note"] = "a camera's images can't be read again, so there are no pictures";
    return json;
  }
  std::unique_ptr<Dataset> dataset;
  try {
    DatasetOptions options = result.config.dataset;
    options.start = options.end = 0;
    options.stride = 1;  // a loop may lead to an earlier recording of the same images
    dataset = OpenDataset(result.dataset, options);
  } catch (const InputError& error) {
    json["note"] = std::string("the images can't be read again: ") + error.what();
    return json;
  }
  std::string note;
  for (const Outcome outcome : {Outcome::kFalse, Outcome::kAccepted, Outcome::kRejected, Outcome::kMissed}) {
    std::vector<const ShownLoop*> of_a_kind;
    for (const ShownLoop& loop : loops) {
      if (loop.outcome == outcome) of_a_kind.push_back(&loop);
    }
    for (const std::size_t k : Thinned(of_a_kind.size(), kMostOfAKind)) {
      Json entry = Entry(*dataset, *of_a_kind[k]);
      if (!entry.is_null()) json["entries"].push_back(std::move(entry));
    }
    note += (note.empty() ? "" : ", ") + std::string(ToString(outcome)) + ": " +
            std::to_string(std::min(of_a_kind.size(), kMostOfAKind)) + " of " +
            std::to_string(of_a_kind.size());
  }
  json["note"] = json["entries"].empty() ? "the images of the loops are of other recordings."
                                         : "Shown, evenly over the run: " + note + ".";
  return json;
}

}  // namespace tutti::report
