#include "apps/export/nerf_transforms.h"

#include <nlohmann/json.hpp>

#include "apps/export/image_name.h"

namespace tutti {
namespace {

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
