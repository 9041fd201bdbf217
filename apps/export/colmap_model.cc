#include "apps/export/colmap_model.h"

#include <cmath>
#include <cstdio>
#include <unordered_map>

#include "apps/export/image_name.h"
#include "apps/export/little_endian.h"
#include "core/numbers.h"
#include "core/replaced_file.h"

namespace tutti {
namespace {

constexpr double kHalfPixel = 0.5;
constexpr std::uint32_t kCameraId = 1;
constexpr int kPinhole = 1;  // COLMAP's number of the model PINHOLE: fx fy cx cy

// 17 digits: reading gives the same number.
std::string Text(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", number);
  return text;
}

std::array<double, 7> QvecTvec(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  return {{q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}};
}

std::array<double, 4> Parameters(const PinholeCamera& camera) {
  return {{camera.fx, camera.fy, camera.cx, camera.cy}};
}

}  // namespace

ColmapModel::ColmapModel(const MapModel& model, const std::vector<std::size_t>& chosen)
    : camera_(model.camera) {
  camera_.cx += kHalfPixel;
  camera_.cy += kHalfPixel;
  std::unordered_map<int, int> seen;
  for (const std::size_t k : chosen) {
    for (const SeenLandmark& view : model.keyframes[k].views) ++seen[view.landmark];
  }
  std::unordered_map<int, std::size_t> places;  // in points_, of landmarks
  for (const ModelLandmark& landmark : model.landmarks) {
    if (seen[landmark.id] < 2) {
      ++left_out_;
      continue;
    }
    places[landmark.id] = points_.size();
    points_.push_back({static_cast<std::uint64_t>(landmark.id) + 1, landmark.position, landmark.rgb, 0, {}});
  }
  for (const std::size_t k : chosen) {
    const ModelKeyframe& keyframe = model.keyframes[k];
    Image image{static_cast<std::uint32_t>(images_.size() + 1),
                ImageName(keyframe.frame_index),
                keyframe.T_world_camera.Inverse(),
                {}};
    for (const SeenLandmark& view : keyframe.views) {
      const auto place = places.find(view.landmark);
      if (place == places.end()) continue;
      Point3D& point = points_[place->second];
      const Eigen::Vector2d pixel(view.pixel.x + kHalfPixel, view.pixel.y + kHalfPixel);
      point.track.push_back({image.id, static_cast<std::uint32_t>(image.points.size())});
      point.error_px += (camera_.Project(image.T_camera_world * point.position) - pixel).norm();
      image.points.push_back({pixel, point.id});
    }
    images_.push_back(std::move(image));
  }
  for (Point3D& point : points_) point.error_px /= static_cast<double>(point.track.size());
  OrderFiles();
}

void ColmapModel::OrderFiles() {
  std::vector<std::size_t> counts;
  for (const Image& image : images_) counts.push_back(image.points.size());
  const std::size_t enough = internal::Median(counts);
  double farthest = -1;
  std::size_t first = 0, second = 0;
  for (std::size_t a = 0; a < images_.size(); ++a) {
    if (counts[a] < enough) continue;
    const Eigen::Vector3d centre = images_[a].T_camera_world.Inverse().translation;
    for (std::size_t b = 0; b < images_.size(); ++b) {
      if (b == a || counts[b] < enough) continue;
      const double apart = std::abs((images_[b].T_camera_world * centre).x());
      if (apart <= farthest) continue;
      farthest = apart;
      first = a;
      second = b;
    }
  }
  if (farthest >= 0) file_order_ = {first, second};
  for (std::size_t i = 0; i < images_.size(); ++i) {
    if (farthest < 0 || (i != first && i != second)) file_order_.push_back(i);
  }
}

double ColmapModel::MeanTrackLength() const {
  std::size_t views = 0;
  for (const Image& image : images_) views += image.points.size();
  return points_.empty() ? 0 : static_cast<double>(views) / static_cast<double>(points_.size());
}

std::string ColmapModel::CamerasText() const {
  std::string text =
      "# Camera list with one line of data per camera:\n"
      "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
      "# Number of cameras: 1\n";
  text += std::to_string(kCameraId) + " PINHOLE " + std::to_string(camera_.width) + " " +
          std::to_string(camera_.height);
  for (const double parameter : Parameters(camera_)) text += " " + Text(parameter);
  return text + "\n";
}

std::string ColmapModel::ImagesText() const {
  std::string text =
      "# Image list with two lines of data per image:\n"
      "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
      "#   POINTS2D[] as (X, Y, POINT3D_ID)\n"
      "# Number of images: " +
      std::to_string(images_.size()) + "\n";
  for (const std::size_t i : file_order_) {
    const Image& image = images_[i];
    text += std::to_string(image.id);
    for (const double number : QvecTvec(image.T_camera_world)) text += " " + Text(number);
    text += " " + std::to_string(kCameraId) + " " + image.name + "\n";
    const char* between = "";
    for (const Point2D& point : image.points) {
      text +=
          between + Text(point.pixel.x()) + " " + Text(point.pixel.y()) + " " + std::to_string(point.point3d);
      between = " ";
    }
    text += "\n";
  }
  return text;
}

std::string ColmapModel::PointsText() const {
  std::string text =
      "# 3D point list with one line of data per point:\n"
      "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
      "# Number of points: " +
      std::to_string(points_.size()) + "\n";
  for (const Point3D& point : points_) {
    text += std::to_string(point.id);
    for (const double coordinate : point.position) text += " " + Text(coordinate);
    for (const int channel : point.rgb) text += " " + std::to_string(channel);
    text += " " + Text(point.error_px);
    for (const TrackElement& element : point.track)
      text += " " + std::to_string(element.image) + " " + std::to_string(element.point);
    text += "\n";
  }
  return text;
}

std::string ColmapModel::CamerasBinary() const {
  std::string bytes;
  AppendLittleEndian(std::uint64_t{1}, &bytes);
  AppendLittleEndian(kCameraId, &bytes);
  AppendLittleEndian(kPinhole, &bytes);
  AppendLittleEndian(static_cast<std::uint64_t>(camera_.width), &bytes);
  AppendLittleEndian(static_cast<std::uint64_t>(camera_.height), &bytes);
  for (const double parameter : Parameters(camera_)) AppendLittleEndian(parameter, &bytes);
  return bytes;
}

std::string ColmapModel::ImagesBinary() const {
  std::string bytes;
  AppendLittleEndian(static_cast<std::uint64_t>(images_.size()), &bytes);
  for (const std::size_t i : file_order_) {
    const Image& image = images_[i];
    AppendLittleEndian(image.id, &bytes);
    for (const double number : QvecTvec(image.T_camera_world)) AppendLittleEndian(number, &bytes);
    AppendLittleEndian(kCameraId, &bytes);
    bytes += image.name;
    bytes += '\0';
    AppendLittleEndian(static_cast<std::uint64_t>(image.points.size()), &bytes);
    for (const Point2D& point : image.points) {
      AppendLittleEndian(point.pixel.x(), &bytes);
      AppendLittleEndian(point.pixel.y(), &bytes);
      AppendLittleEndian(point.point3d, &bytes);
    }
  }
  return bytes;
}

std::string ColmapModel::PointsBinary() const {
  std::string bytes;
  AppendLittleEndian(static_cast<std::uint64_t>(points_.size()), &bytes);
  for (const Point3D& point : points_) {
    AppendLittleEndian(point.id, &bytes);
    for (const double coordinate : point.position) AppendLittleEndian(coordinate, &bytes);
    for (const std::uint8_t channel : point.rgb) AppendLittleEndian(channel, &bytes);
    AppendLittleEndian(point.error_px, &bytes);
    AppendLittleEndian(static_cast<std::uint64_t>(point.track.size()), &bytes);
    for (const TrackElement& element : point.track) {
      AppendLittleEndian(element.image, &bytes);
      AppendLittleEndian(element.point, &bytes);
    }
  }
  return bytes;
}

void ColmapModel::Write(const std::filesystem::path& folder) const {
  internal::WriteFile(folder / "cameras.txt", CamerasText());
  internal::WriteFile(folder / "images.txt", ImagesText());
  internal::WriteFile(folder / "points3D.txt", PointsText());
  internal::WriteFile(folder / "cameras.bin", CamerasBinary());
  internal::WriteFile(folder / "images.bin", ImagesBinary());
  internal::WriteFile(folder / "points3D.bin", PointsBinary());
}

}  // namespace tutti
