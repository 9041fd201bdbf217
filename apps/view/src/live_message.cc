#include "live_message.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tutti/report/base64.h"

namespace tutti::view {
namespace {

using Json = nlohmann::json;
constexpr int kMostWidth = 640;
constexpr int kQuality = 70;  // of the JPEG, 0..100
constexpr std::size_t kMostTracks = 250;

double Short(double value, double unit = 1000) { return std::round(value * unit) / unit; }

Json Position(const Eigen::Vector3d& p) { return {Short(p.x()), Short(p.y()), Short(p.z())}; }

Json TracksJson(const LiveFrame& frame, const CameraRig& rig, double scale) {
  Json tracks = Json::array();
  if (!frame.keyframe) return tracks;
  const KeyframeView& view = *frame.keyframe;
  const Pose T_camera_keyframe = frame.T_world_camera.Inverse() * frame.T_world_keyframe;
  const std::size_t step = std::max<std::size_t>(1, view.points.size() / (3 * kMostTracks));
  for (std::size_t i = 0; i < view.points.size() && tracks.size() < kMostTracks; i += step) {
    if (!view.points[i].allFinite()) continue;
    const Eigen::Vector3d point = T_camera_keyframe * view.points[i];
    if (point.z() <= 0) continue;
    const Eigen::Vector2d pixel = rig.camera.Project(point);
    if (!rig.camera.Contains(pixel)) continue;
    const cv::Point2f& old = view.keypoints[i].pt;
    tracks.push_back({Short(scale * old.x, 10), Short(scale * old.y, 10), Short(scale * pixel.x(), 10),
                      Short(scale * pixel.y(), 10)});
  }
  return tracks;
}

Json FrameJson(const LiveFrame& frame, const CameraRig& rig) {
  Json json = {{"index", frame.index},   {"stamp", frame.stamp_s},     {"state", frame.state},
               {"reason", frame.reason}, {"features", frame.features}, {"inliers", frame.inliers},
               {"number", frame.number}};
  if (frame.posed) json["position"] = Position(frame.T_world_camera.translation);
  if (frame.image.empty()) return json;
  const double scale = std::min(1.0, static_cast<double>(kMostWidth) / frame.image.cols);
  cv::Mat small;
  cv::resize(frame.image, small, {}, scale, scale, cv::INTER_AREA);
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  json["image"] = "data:image/jpeg;base64," + Base64(bytes.data(), bytes.size());
  json["tracks"] = TracksJson(frame, rig, scale);
  return json;
}

}  // namespace

std::string LiveMessage(const LiveNews& news, const CameraRig& rig) {
  Json json = {{"paused", news.paused}, {"finished", news.finished}, {"frame", FrameJson(news.frame, rig)}};
  json["places"] = Json::array();
  for (const LivePlace& place : *news.places) {
    const Eigen::Quaterniond& q = place.T_world_camera.rotation;
    Json p = Position(place.T_world_camera.translation);
    for (const double v : {q.x(), q.y(), q.z(), q.w()}) p.push_back(Short(v, 1e4));
    json["places"].push_back({place.id, place.frame, place.piece, p});
  }
  json["loops"] = Json::array();
  for (const LiveLoop& loop : *news.loops)
    json["loops"].push_back({loop.query, loop.candidate, loop.accepted ? 1 : 0});
  json["points"] = Json::array();
  for (const LivePoints& points : news.points) {
    Json list = Json::array();
    for (const Eigen::Vector3f& p : points.points) list.push_back(Position(p.cast<double>()));
    json["points"].push_back({points.keyframe, list});
  }
  json["events"] = Json::array();
  for (const LiveEvent& event : news.events) {
    Json e = {{"text", event.text}};
    if (event.query >= 0) {
      e["query"] = event.query;
      for (const auto& [name, h] : event.opinions)
        e["h"][name] = std::isfinite(h) ? Json(Short(h, 1e4)) : Json();
    }
    json["events"].push_back(e);
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace tutti::view
