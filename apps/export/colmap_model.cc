#include "apps/export/colmap_model.h"

#include <cmath>
#include <cstdio>
#include <unordered_map>
#include <utility>

#include "apps/export/map_files.h"
#include "core/little_endian.h"
#include "core/numbers.h"
#include "core/replaced_file.h"

namespace tutti {
namespace {

constexpr double kHalfPixel = 0.5;
constexpr std::uint32_t kCameraId = 1;
constexpr int kPinhole = 1;  // COLMAP's number of the model PINHOLE: fx fy cx cy

// The two forms of COLMAP's files. Both have the same numbers in the same order, but counts and comments.
class TextForm {
 public:
  static constexpr const char* kEnding = ".txt";
  explicit TextForm(const std::string& comment) : text_(comment) {}
  template <class T>
  void Add(const T& number) {
    text_ += std::exchange(between_, " ") + TextOf(number);
  }
  void Either(const char* name, int /*number*/) { text_ += std::exchange(between_, " ") + std::string(name); }
  void AddName(const std::string& name) { text_ += " " + name; }
  void AddCount(std::size_t /*count*/) {}
  void EndLine() { text_ += "\n", between_ = ""; }
  const std::string& Bytes() const { return text_; }

 private:
  // 17 digits: reading gives the same number.
  static std::string TextOf(double number) {
    char text[32];
    std::snprintf(text, sizeof text, "%.17g", number);
    return text;
  }
  template <class T>
  static std::string TextOf(T number) {
    return std::to_string(number);
  }

  std::string text_;
  const char* between_ = "";
};

class BinaryForm {
 public:
  static constexpr const char* kEnding = ".bin";
  explicit BinaryForm(const std::string& /*comment*/) {}
  template <class T>
  void Add(const T& number) {
    internal::AppendLittleEndian(number, &bytes_);
  }
  void Either(const char* /*name*/, int number) { Add(number); }
  void AddName(const std::string& name) { bytes_.append(name.c_str(), name.size() + 1); }
  void AddCount(std::size_t count) { Add(static_cast<std::uint64_t>(count)); }
  void EndLine() {}
  const std::string& Bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

template <class Form>
void WriteCamerasFile(const PinholeCamera& camera, const std::filesystem::path& folder) {
  Form out(
      "# Camera list with one line of data per camera:\n"
      "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
      "# Number of cameras: 1\n");
  out.AddCount(1);
  out.Add(kCameraId);
  out.Either("PINHOLE", kPinhole);
  for (const int side : {camera.width, camera.height}) out.Add(static_cast<std::uint64_t>(side));
  for (const double parameter : {camera.fx, camera.fy, camera.cx, camera.cy}) out.Add(parameter);
  out.EndLine();
  internal::WriteFile(folder / (std::string("cameras") + Form::kEnding), out.Bytes());
}

template <class Form>
void WriteImagesFile(const ColmapModel& model, const std::filesystem::path& folder) {
  Form out(
      "# Image list with two lines of data per image:\n"
      "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
      "#   POINTS2D[] as (X, Y, POINT3D_ID)\n"
      "# Number of images: " +
      std::to_string(model.Images().size()) + "\n");
  out.AddCount(model.Images().size());
  for (const std::size_t i : model.FileOrder()) {
    const ColmapModel::Image& image = model.Images()[i];
    const Eigen::Quaterniond& q = image.T_camera_world.rotation;
    out.Add(image.id);
    for (const double number : {q.w(), q.x(), q.y(), q.z()}) out.Add(number);
    for (const double number : image.T_camera_world.translation) out.Add(number);
    out.Add(kCameraId);
    out.AddName(image.name);
    out.EndLine();
    out.AddCount(image.points.size());
    for (const ColmapModel::Point2D& point : image.points) {
      out.Add(point.pixel.x());
      out.Add(point.pixel.y());
      out.Add(point.point3d);
    }
    out.EndLine();
  }
  internal::WriteFile(folder / (std::string("images") + Form::kEnding), out.Bytes());
}

template <class Form>
void WritePointsFile(const ColmapModel& model, const std::filesystem::path& folder) {
  Form out(
      "# 3D point list with one line of data per point:\n"
      "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
      "# Number of points: " +
      std::to_string(model.Points().size()) + "\n");
  out.AddCount(model.Points().size());
  for (const ColmapModel::Point3D& point : model.Points()) {
    out.Add(point.id);
    for (const double coordinate : point.position) out.Add(coordinate);
    for (const std::uint8_t channel : point.rgb) out.Add(channel);
    out.Add(point.error_px);
    out.AddCount(point.track.size());
    for (const ColmapModel::TrackElement& element : point.track) {
      out.Add(element.image);
      out.Add(element.point);
    }
    out.EndLine();
  }
  internal::WriteFile(folder / (std::string("points3D") + Form::kEnding), out.Bytes());
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

void ColmapModel::Write(const std::filesystem::path& folder) const {
  WriteCamerasFile<TextForm>(camera_, folder);
  WriteImagesFile<TextForm>(*this, folder);
  WritePointsFile<TextForm>(*this, folder);
  WriteCamerasFile<BinaryForm>(camera_, folder);
  WriteImagesFile<BinaryForm>(*this, folder);
  WritePointsFile<BinaryForm>(*this, folder);
}

}  // namespace tutti
