#include "apps/export/map_files.h"

#include <nlohmann/json.hpp>

#include "core/little_endian.h"
#include "core/numbers.h"
#include "core/replaced_file.h"

namespace tutti {
namespace {

using internal::AppendLittleEndian;

constexpr std::array<std::uint8_t, 3> kOrange = {{213, 94, 0}};  // no colour of a scene that is often there
constexpr std::uint32_t kCorners = 5;
// Apex and base, counted anticlockwise as seen from outside.
constexpr std::array<std::array<std::uint32_t, 3>, 6> kTriangles = {
    {{{0, 2, 1}}, {{0, 3, 2}}, {{0, 4, 3}}, {{0, 1, 4}}, {{1, 2, 3}}, {{1, 3, 4}}}};

void AppendVertex(const Eigen::Vector3d& at, const std::array<std::uint8_t, 3>& rgb, int observations,
                  std::string* bytes) {
  for (const double coordinate : at) AppendLittleEndian(static_cast<float>(coordinate), bytes);
  for (const std::uint8_t channel : rgb) AppendLittleEndian(channel, bytes);
  AppendLittleEndian(static_cast<std::uint32_t>(observations), bytes);
}

// How far the base is from the apex [m].
double FrustumDepth(const MapModel& model) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < model.keyframes.size(); ++i)
    steps.push_back(
        (model.keyframes[i].T_world_camera.translation - model.keyframes[i - 1].T_world_camera.translation)
            .norm());
  const double median = internal::Median(steps);
  return median > 0 ? 0.5 * median : 0.1;
}

// Apex, then the corners of the image: top left, top right, bottom right, bottom left; in the camera's frame.
std::array<Eigen::Vector3d, kCorners> Frustum(const PinholeCamera& camera, double depth) {
  const double left = -0.5, top = -0.5, right = camera.width - 0.5, bottom = camera.height - 0.5;
  return {{Eigen::Vector3d::Zero(), depth * camera.Unproject({left, top}),
           depth * camera.Unproject({right, top}), depth * camera.Unproject({right, bottom}),
           depth * camera.Unproject({left, bottom})}};
}

// T_world_camera with y and z of the camera turned round: OpenCV's axes to OpenGL's.
nlohmann::ordered_json OpenGlPose(const Pose& T_world_camera) {
  Eigen::Matrix4d matrix = T_world_camera.Matrix();
  matrix.col(1) *= -1;
  matrix.col(2) *= -1;
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int r = 0; r < 4; ++r) rows.push_back({matrix(r, 0), matrix(r, 1), matrix(r, 2), matrix(r, 3)});
  return rows;
}

}  // namespace

void WritePly(const std::filesystem::path& file, const MapModel& model, PlyCameras cameras) {
  const std::size_t frusta = cameras == PlyCameras::kFrusta ? model.keyframes.size() : 0;
  const std::size_t points = model.landmarks.size();
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\n"
      "comment written by tutti; world: x right, y down, z forward of the first camera\n"
      "element vertex " +
      std::to_string(points + kCorners * frusta) +
      "\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uint observations\n";
  if (frusta > 0)
    bytes += "element face " + std::to_string(kTriangles.size() * frusta) +
             "\nproperty list uchar int vertex_indices\n";
  bytes += "end_header\n";
  for (const ModelLandmark& landmark : model.landmarks)
    AppendVertex(landmark.position, landmark.rgb, landmark.observations, &bytes);
  const auto corners = Frustum(model.camera, FrustumDepth(model));
  for (std::size_t k = 0; k < frusta; ++k) {
    for (const Eigen::Vector3d& corner : corners)
      AppendVertex(model.keyframes[k].T_world_camera * corner, kOrange, 0, &bytes);
  }
  for (std::size_t k = 0; k < frusta; ++k) {
    const auto first = static_cast<std::uint32_t>(points + kCorners * k);
    for (const auto& triangle : kTriangles) {
      AppendLittleEndian(std::uint8_t{3}, &bytes);
      for (const std::uint32_t corner : triangle) AppendLittleEndian(first + corner, &bytes);
    }
  }
  internal::WriteFile(file, bytes);
}

std::string NerfTransforms(const MapModel& model, const std::vector<std::size_t>& chosen,
                           const std::string& points) {
  const PinholeCamera& camera = model.camera;
  nlohmann::ordered_json json = {{"camera_model", "OPENCV"},
                                 {"w", camera.width},
                                 {"h", camera.height},
                                 {"fl_x", camera.fx},
                                 {"fl_y", camera.fy},
                                 {"cx", camera.cx + 0.5},
                                 {"cy", camera.cy + 0.5},
                                 {"k1", 0.0},
                                 {"k2", 0.0},
                                 {"p1", 0.0},
                                 {"p2", 0.0},
                                 {"ply_file_path", points}};
  json["frames"] = nlohmann::ordered_json::array();
  for (const std::size_t k : chosen) {
    const ModelKeyframe& keyframe = model.keyframes[k];
    json["frames"].push_back({{"file_path", "images/" + ImageName(keyframe.frame_index)},
                              {"transform_matrix", OpenGlPose(keyframe.T_world_camera)}});
  }
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace tutti
