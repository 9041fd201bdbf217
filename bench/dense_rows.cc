// A dense map of a generated world whose geometry is known, measured. bench/dense_table.py runs it.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/reconstruct/depth_source.h"
#include "data/synthetic/synthetic_world.h"
#include "tests/apps/dense/known_geometry.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"
#include "tutti/dense/dense_map.h"

namespace tutti::bench {
namespace {

struct Arguments {
  SyntheticOptions world;
  DenseOptions dense;
  std::string poses;  // TUM file; empty: the true ones
  int stride = 1, rounds = 1;
  double most_m = 0;    // seen surface that is farther does not count
  double within_m = 0;  // of completeness; 0: a voxel
  bool grid = false;
};

// Poses of a file in the world's frame, as aligned to the truth; nothing where it has none.
class Poses {
 public:
  Poses(const std::string& file, const Trajectory& truth) {
    if (file.empty()) {
      for (const StampedPose& pose : truth) poses_[pose.stamp_s] = pose.pose;
      return;
    }
    const Trajectory estimate = ReadTrajectory(file, TrajectoryFormat::kTum);
    const EvaluationReport report = EvaluateTrajectory(truth, estimate, {});
    for (const StampedPose& pose : estimate)
      poses_[pose.stamp_s] =
          Pose(report.S_reference_estimate.rotation, report.S_reference_estimate.translation) * pose.pose;
  }
  std::optional<Pose> At(double stamp_s) const {
    constexpr double kSame = 1e-3;  // [s]
    const auto found = poses_.lower_bound(stamp_s - kSame);
    if (found == poses_.end() || found->first > stamp_s + kSame) return std::nullopt;
    return found->second;
  }

 private:
  std::map<double, Pose> poses_;
};

void Measure(const Arguments& a) {
  const SyntheticWorld world(a.world);
  const Poses poses(a.poses, world.GroundTruth());
  DenseMap map(a.dense);
  std::vector<Eigen::Vector3d> seen;
  std::clock_t clocks = 0;
  const auto stride = static_cast<std::size_t>(a.stride);
  for (int round = 0; round < a.rounds; ++round) {
    for (std::size_t i = 0; i < world.Size(); i += stride) {
      const std::optional<Pose> pose = poses.At(world.Stamp(i));
      if (!pose) continue;
      const SyntheticFrame frame = world.Render(i);
      const std::clock_t begin = std::clock();
      const cv::Mat depth = frame.right.empty() ? frame.depth_m
                                                : DepthOfPair(frame.image, frame.right, world.Camera().fx,
                                                              world.Options().baseline_m);
      map.Integrate(depth, frame.image, *pose, world.Camera());
      clocks += std::clock() - begin;
      if (round > 0 || i % (4 * stride) != 0) continue;
      cv::Mat exact = world.ExactDepth(i);
      if (a.most_m > 0) exact.setTo(0, exact > a.most_m);
      testing::AppendSeen(exact, frame.T_world_camera, world.Camera(), 9, &seen);
    }
  }
  const double within = a.within_m > 0 ? a.within_m : a.dense.voxel_m;
  const testing::KnownGeometry geometry(StillFaces(world), 1);
  const testing::SurfaceQuality quality = testing::Measure(map.Mesh().vertices, geometry, seen, within);
  nlohmann::ordered_json row = {{"rms_m", quality.rms},
                                {"mean_m", quality.mean},
                                {"worst_m", quality.worst},
                                {"completeness", quality.completeness},
                                {"frames", map.Report().integrated},
                                {"apart", map.Report().apart},
                                {"memory_mb", map.Report().memory_mb},
                                {"cpu_ms", 1e3 * static_cast<double>(clocks) / CLOCKS_PER_SEC /
                                               static_cast<double>(map.Report().integrated)}};
  if (a.grid) row["grid_right"] = testing::ShareOfRightCells(world, map.Grid(), 0.1, 1.0);
  std::puts(row.dump().c_str());
}

int Main(int argc, char** argv) {
  Arguments a;
  a.world.width = 640, a.world.height = 480;
  a.dense.free_space = false;
  CLI::App app("Measures a dense map of a generated world; prints a JSON object.");
  std::string world = "room", sensor = "rgbd";
  app.add_option("--world", world)->check(CLI::IsMember({"room", "corridor", "town"}));
  app.add_option("--sensor", sensor)->check(CLI::IsMember({"rgbd", "stereo"}));
  app.add_option("--seed", a.world.seed);
  app.add_option("--laps", a.world.laps);
  app.add_option("--width", a.world.width);
  app.add_option("--height", a.world.height);
  app.add_option("--frames", a.world.frames);
  app.add_option("--supersample", a.world.supersample);
  app.add_flag("--kinect-noise", a.world.kinect_noise);
  app.add_option("--poses", a.poses);
  app.add_option("--stride", a.stride);
  app.add_option("--rounds", a.rounds);
  app.add_option("--voxel", a.dense.voxel_m);
  app.add_option("--max-depth", a.dense.max_depth_m);
  app.add_option("--most", a.most_m);
  app.add_option("--within", a.within_m);
  app.add_flag("--grid", a.grid);
  CLI11_PARSE(app, argc, argv);
  a.world.scene = world == "room"       ? SyntheticScene::kRoom
                  : world == "corridor" ? SyntheticScene::kCorridor
                                        : SyntheticScene::kTown;
  a.world.sensor = sensor == "rgbd" ? SyntheticSensor::kRgbd : SyntheticSensor::kStereo;
  a.dense.free_space = a.grid;
  Measure(a);
  return 0;
}

}  // namespace
}  // namespace tutti::bench

int main(int argc, char** argv) {
  try {
    return tutti::bench::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "dense_rows: %s\n", error.what());
    return 1;
  }
}
