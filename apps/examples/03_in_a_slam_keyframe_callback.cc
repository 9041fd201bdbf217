// Example 03: loop closure for another SLAM system, which calls OnKeyframe for each of its keyframes.
//
//   03_in_a_slam_keyframe_callback [DIR STATE [DEPTH]]     # without: a generated town; run it twice
//
// DIR has the camera's images. STATE is loaded if it is there and saved at the end: the next run goes on
// where this one stopped, and finds its places again. With DEPTH [m] the "SLAM" knows 3D points (here: a wall
// at that distance), and loops come with a metric pose; without it, with a rotation and a direction.
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "image_folder.h"
#include "tutti/loopclosure/detector.h"
#include "world.h"

namespace {

// What the other SLAM knows of a keyframe.
struct Keyframe {
  std::int64_t id = 0;
  cv::Mat image;  // rectified
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  std::vector<Eigen::Vector3d> landmarks;  // in the camera frame [m], one per keypoint; empty: none known
  std::vector<std::int64_t> neighbours;    // earlier keyframes that see the same landmarks
};

class LoopCloser {
 public:
  LoopCloser(const tutti::PinholeCamera& camera, const std::filesystem::path& state)
      : camera_(camera), state_(state), detector_(tutti::LoopDetectorOptions{}) {
    if (std::filesystem::exists(state_)) detector_.Load(state_);
  }
  void Save() const { detector_.Save(state_); }
  std::int64_t NextId() const { return detector_.LastId() + 1; }

  void OnKeyframe(const Keyframe& keyframe) {
    tutti::LoopQuery query;
    query.id = keyframe.id;  // ids must grow; they need not be consecutive
    query.image = keyframe.image;
    query.camera = camera_;
    query.features = {keyframe.keypoints, keyframe.descriptors, keyframe.landmarks};
    query.metric = !keyframe.landmarks.empty();  // a mono SLAM, whose scale drifts, says false here
    const tutti::LoopResult result = detector_.Detect(query);
    for (const std::int64_t neighbour : keyframe.neighbours) detector_.AddLink(neighbour, keyframe.id);
    if (!result.warning.empty()) std::fprintf(stderr, "warning: %s\n", result.warning.c_str());
    if (!result.accepted) return;
    if (MapContradicts(result.verification)) {
      OnLoopRefused(keyframe.id, result.candidate);
    } else {
      OnLoop(keyframe.id, result.verification);
    }
  }
  // To be called when the pose graph refuses a loop, or leaves it no weight, at once or many keyframes later:
  // the filter then no longer takes the two places for one.
  void OnLoopRefused(std::int64_t id, std::int64_t candidate) { detector_.Unlink(id, candidate); }
  int loops() const { return loops_; }

 private:
  // Stands for the pose graph's judgement: these images were taken on one way, so that a loop which stands on
  // its head can't be one.
  static bool MapContradicts(const tutti::Verification& v) {
    return tutti::LogSO3(v.S_candidate_query.rotation).norm() > 0.5 * M_PI;
  }

  // Here the SLAM would add a constraint to its pose graph: S_candidate_query, weighted with v.information.
  void OnLoop(std::int64_t id, const tutti::Verification& v) {
    ++loops_;
    const Eigen::Vector3d& t = v.S_candidate_query.translation;
    const double degrees = tutti::LogSO3(v.S_candidate_query.rotation).norm() * 180.0 / M_PI;
    const bool metric = v.type == tutti::ConstraintType::kRigid;
    std::printf("keyframe %lld at %lld: %s (%.3f, %.3f, %.3f)%s, turned by %.2f deg (%d inliers)\n",
                static_cast<long long>(id), static_cast<long long>(v.candidate),
                metric ? "moved" : "direction", t.x(), t.y(), t.z(), metric ? " m" : "", degrees, v.inliers);
  }

  tutti::PinholeCamera camera_;
  std::filesystem::path state_;
  tutti::LoopDetector detector_;
  int loops_ = 0;
};

// Stands for the other SLAM: ORB features, and a wall at `depth` for landmarks (0: none known).
Keyframe MakeKeyframe(std::int64_t id, const cv::Mat& image, const tutti::PinholeCamera& camera,
                      double depth) {
  Keyframe keyframe;
  keyframe.id = id;
  keyframe.image = image;
  cv::ORB::create(500)->detectAndCompute(image, cv::noArray(), keyframe.keypoints, keyframe.descriptors);
  for (const cv::KeyPoint& keypoint : keyframe.keypoints) {
    if (depth > 0) keyframe.landmarks.push_back(camera.Unproject({keypoint.pt.x, keypoint.pt.y}) * depth);
  }
  return keyframe;
}

int Run(const std::string& folder, const std::string& state, double depth) {
  const std::vector<std::string> files = examples::FilesInOrder(folder);
  if (files.empty()) throw std::runtime_error(folder + ": no images");
  const cv::Mat first = cv::imread(files.front(), cv::IMREAD_GRAYSCALE);
  tutti::PinholeCamera camera;  // a calibrated one in earnest
  camera.width = first.cols;
  camera.height = first.rows;
  camera.fx = camera.fy = first.cols;
  camera.cx = 0.5 * first.cols;
  camera.cy = 0.5 * first.rows;

  LoopCloser closer(camera, state);
  const std::int64_t begin = closer.NextId();
  std::printf("%lld keyframes known\n", static_cast<long long>(begin));
  for (std::size_t i = 0; i < files.size(); ++i) {
    const std::int64_t id = begin + static_cast<std::int64_t>(i);
    Keyframe keyframe = MakeKeyframe(id, cv::imread(files[i], cv::IMREAD_GRAYSCALE), camera, depth);
    if (i >= 2) keyframe.neighbours = {id - 2};  // the one before is linked by itself
    closer.OnKeyframe(keyframe);
  }
  closer.Save();
  std::printf("%zu keyframes, %d loops\n", files.size(), closer.loops());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 || argc > 4) {
    std::fprintf(stderr, "usage: %s [DIR STATE [DEPTH]]\n", argv[0]);
    return 1;
  }
  try {
    if (argc == 1) return Run(examples::Town(argv[0], "mono") + "/image_0", "example_world/places.tutti", 0);
    return Run(argv[1], argv[2], argc == 4 ? std::stod(argv[3]) : 0.0);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
