// The state of a run as the page reads it.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <unordered_map>

#include "apps/report/page.h"
#include "apps/view/live_server.h"

namespace tutti::view {
namespace {

using Json = nlohmann::json;
constexpr int kMostWidth = 640;
constexpr int kQuality = 70;  // of the JPEG, 0..100
constexpr std::size_t kMostTracks = 250;

double Short(double value, double unit = 1000) { return std::round(value * unit) / unit; }

Json Position(const Eigen::Vector3d& p) { return {Short(p.x()), Short(p.y()), Short(p.z())}; }

constexpr const char* kSpotWords[] = {"located", "beyond", "recognised",
                                      "joined"};  // in the order of the kinds

// Each track: x, y of now, of the frame before that shows it, ...
Json TracksJson(const LiveFrame& frame, double scale) {
  Json tracks = Json::array();
  for (const LiveTrack& track : TracksOf(frame.trail, kMostTracks)) {
    Json pixels = Json::array();
    for (const cv::Point2f& p : track) {
      pixels.push_back(Short(scale * p.x, 10));
      pixels.push_back(Short(scale * p.y, 10));
    }
    tracks.push_back(std::move(pixels));
  }
  return tracks;
}

// A surface in base64: x, y, z of each point as floats, then their greys.
std::string Packed(const LivePoints& points) {
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
  const std::size_t places = points.surface.size() * sizeof(Eigen::Vector3f);
  std::vector<std::uint8_t> bytes(places + points.greys.size());
  if (bytes.empty()) return {};
  std::memcpy(bytes.data(), points.surface.data(), places);
  std::copy(points.greys.begin(), points.greys.end(), bytes.begin() + static_cast<std::ptrdiff_t>(places));
  return Base64(bytes.data(), bytes.size());
}

Json FrameJson(const LiveFrame& frame) {
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
  json["tracks"] = TracksJson(frame, scale);
  return json;
}

}  // namespace

std::vector<LiveTrack> TracksOf(const LiveTrail& trail, std::size_t most) {
  std::vector<LiveTrack> tracks;
  if (trail.empty() || most == 0) return tracks;
  const std::size_t step = std::max<std::size_t>(1, (trail.front()->size() + most - 1) / most);
  std::unordered_map<int, std::size_t> track_of;  // landmark -> its track
  for (const SeenLandmark& seen : *trail.front()) {
    if (static_cast<std::size_t>(seen.landmark) % step != 0 || tracks.size() == most) continue;
    if (track_of.emplace(seen.landmark, tracks.size()).second) tracks.push_back({seen.pixel});
  }
  for (std::size_t frame = 1; frame < trail.size(); ++frame) {
    for (const SeenLandmark& seen : *trail[frame]) {
      const auto track = track_of.find(seen.landmark);
      if (track != track_of.end()) tracks[track->second].push_back(seen.pixel);
    }
  }
  return tracks;
}

std::string LiveMessage(const LiveNews& news) {
  Json json = {{"paused", news.paused},         {"standing", news.standing},
               {"finished", news.finished},     {"total", news.total},
               {"sessions", news.sessions},     {"only_located", news.only_located},
               {"frame", FrameJson(news.frame)}};
  json["places"] = Json::array();
  for (const LivePlace& place : *news.places) {
    const Eigen::Quaterniond& q = place.T_world_camera.rotation;
    Json p = Position(place.T_world_camera.translation);
    for (const double v : {q.x(), q.y(), q.z(), q.w()}) p.push_back(Short(v, 1e4));
    json["places"].push_back({place.id, place.frame, place.piece, p, place.session});
  }
  json["loops"] = Json::array();
  for (const LiveLoop& loop : *news.loops)
    json["loops"].push_back({loop.query, loop.candidate, loop.accepted ? 1 : 0});
  json["points"] = Json::array();
  for (const LivePoints& points : news.points) {
    Json list = Json::array();
    for (const Eigen::Vector3f& p : points.points) list.push_back(Position(p.cast<double>()));
    json["points"].push_back({points.keyframe, list, Packed(points)});
  }
  json["spots"] = Json::array();
  for (const LiveSpot& spot : news.spots)
    json["spots"].push_back(
        {kSpotWords[static_cast<int>(spot.kind)], spot.frame, spot.keyframe, Position(spot.position)});
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
