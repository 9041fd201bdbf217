#include "apps/run/focal_length.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Sparse>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "apps/run/map_figures.h"
#include "apps/run/run_parts.h"
#include "frontend/dataset/wrapped_dataset.h"
#include "tutti/frontend/odometry.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr double kPixelSigma = 1.0;    // of a keypoint [px]
constexpr double kDepthSigma = 0.02;   // of a depth, as share of it
constexpr double kLensSigma = 0.05;    // prior of k1
constexpr double kLensKept = 0.005;    // the same where the lens is taken to be as it was calibrated
constexpr double kNoLens = 1e-5;       // the same where there is none
constexpr double kNeedsLens = 4;       // gain of another lens [squares of sigma] below which none is needed
constexpr double kCentreSigma = 0.01;  // prior of the principal point, as share of the width
constexpr double kLeftOut = 1.3;  // what is not in a sigma: the scatter over first frames and noise is larger
constexpr double kRidge = 1e-9;
constexpr double kCorrelation = 3.0;  // errors of neighbouring keypoints are not independent
constexpr double kWorstSigma = 0.10;  // of a focal length that is worth more than a guess
constexpr double kLeftOver = 0.3;     // of a move: what a map that was tracked with another one keeps of it
constexpr double kAnyMove = 1e9;
constexpr double kWorstChecked = 0.15;  // of one that can speak against another
constexpr int kFewestKeyframes = 6;
constexpr int kFewestFeatures = 500;  // of an image; half of those of the run do
constexpr std::size_t kMostLandmarks = 3000;
constexpr std::size_t kCheckedKeyframes = 40, kCheckedLandmarks = 800;

struct Measurement {
  int keyframe = 0, landmark = 0;  // places in Scene
  Eigen::Vector2d offset;          // from the principal point [px]
  double depth = 0;                // [m]; 0: not measured
  double depth_sigma = 0;          // as share of it
};

// A map as numbers that Ceres moves.
struct Scene {
  std::vector<std::array<double, 6>> cameras;  // angle-axis and translation, camera from world
  std::vector<Eigen::Vector3d> landmarks;
  std::vector<Measurement> observations;
  std::array<double, 4> lens = {{0, 0, 0, 0}};  // log of the focal length [px], k1, move of the centre [px]
  double width = 0;
  double lens_sigma = kLensSigma;
  bool stereo = false;  // depths are disparities, which another focal length would make others
  double given = 0;     // log of the focal length that depths are of
};

struct PixelError {
  Eigen::Vector2d offset;
  template <class T>
  bool operator()(const T* camera, const T* landmark, const T* lens, T* error) const {
    T p[3];
    ceres::AngleAxisRotatePoint(camera, landmark, p);
    for (int i = 0; i < 3; ++i) p[i] += camera[3 + i];
    if (p[2] < T(1e-6)) return false;
    const T x = p[0] / p[2], y = p[1] / p[2];
    using std::exp;
    const T scale = exp(lens[0]) * (T(1) + lens[1] * (x * x + y * y));
    error[0] = (scale * x + lens[2] - T(offset.x())) / T(kPixelSigma);
    error[1] = (scale * y + lens[3] - T(offset.y())) / T(kPixelSigma);
    return true;
  }
};

struct DepthError {
  double depth, sigma, given;
  bool stereo;
  template <class T>
  bool operator()(const T* camera, const T* landmark, const T* lens, T* error) const {
    T p[3];
    ceres::AngleAxisRotatePoint(camera, landmark, p);
    using std::exp;
    const T measured = stereo ? T(depth) * exp(lens[0] - T(given)) : T(depth);
    error[0] = (p[2] + camera[5] - measured) / (T(sigma) * measured);
    return true;
  }
};

struct LensPrior {
  double width, sigma;
  template <class T>
  bool operator()(const T* lens, T* error) const {
    error[0] = lens[1] / T(sigma);
    for (int i = 1; i < 3; ++i) error[i] = lens[1 + i] / T(kCentreSigma * width);
    return true;
  }
};

struct Fit {
  bool usable = false;
  double cost = 0;
  int residuals = 0;
};

// The errors of a scene, in the order of its observations; the priors of its lens are the last.
void AddErrors(Scene& scene, ceres::Problem* problem) {
  for (const Measurement& o : scene.observations) {
    double* const camera = scene.cameras[static_cast<std::size_t>(o.keyframe)].data();
    double* const landmark = scene.landmarks[static_cast<std::size_t>(o.landmark)].data();
    problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<PixelError, 2, 6, 3, 4>(new PixelError{o.offset}),
        new ceres::HuberLoss(2.0), camera, landmark, scene.lens.data());
    if (o.depth > 0) {
      problem->AddResidualBlock(new ceres::AutoDiffCostFunction<DepthError, 1, 6, 3, 4>(
                                    new DepthError{o.depth, o.depth_sigma, scene.given, scene.stereo}),
                                new ceres::CauchyLoss(2.0), camera, landmark, scene.lens.data());
    }
  }
  problem->AddResidualBlock(
      new ceres::AutoDiffCostFunction<LensPrior, 3, 4>(new LensPrior{scene.width, scene.lens_sigma}), nullptr,
      scene.lens.data());
}

// The first that has seen one of the landmarks, which stays where it is: the others are not in the problem.
std::size_t FixedCamera(const Scene& scene) {
  return static_cast<std::size_t>(scene.observations.front().keyframe);
}

Fit Adjust(Scene& scene) {
  ceres::Problem problem;
  AddErrors(scene, &problem);
  problem.SetParameterBlockConstant(scene.cameras[FixedCamera(scene)].data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_SCHUR;
  options.max_num_iterations = 40;
  options.function_tolerance = 1e-6;
  options.num_threads = 1;  // sums in one order
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return {summary.IsSolutionUsable(), summary.final_cost, summary.num_residuals_reduced};
}

// Keyframes in a row between which the camera turns most.
std::vector<int> WhereItTurns(const Odometry& odometry, const FrameRange& session) {
  std::vector<int> keyframes = KeyframesOfLargestSubmap(odometry, session);
  if (keyframes.size() <= kCheckedKeyframes) return keyframes;
  std::vector<double> turned = {0};  // up to each keyframe
  for (std::size_t k = 1; k < keyframes.size(); ++k) {
    const Pose& before = odometry.map().keyframe(keyframes[k - 1]).T_world_camera;
    const Pose& here = odometry.map().keyframe(keyframes[k]).T_world_camera;
    turned.push_back(turned.back() + (before.Inverse() * here).Angle());
  }
  std::size_t best = 0;
  const auto turn = [&](std::size_t begin) { return turned[begin + kCheckedKeyframes - 1] - turned[begin]; };
  for (std::size_t begin = 1; begin + kCheckedKeyframes <= keyframes.size(); ++begin) {
    if (turn(begin) > turn(best)) best = begin;
  }
  const auto first = keyframes.begin() + static_cast<std::ptrdiff_t>(best);
  return {first, first + static_cast<std::ptrdiff_t>(kCheckedKeyframes)};
}

// Landmarks that three of the keyframes see, those seen most first. `aspect`: fy over fx, by which offsets
// along y are divided, so that one focal length is that of both.
std::optional<Scene> SceneOf(const Odometry& odometry, const std::vector<int>& keyframes,
                             std::size_t most_landmarks, double aspect = 1) {
  std::vector<KeyframeView> views;
  std::map<int, int> seen;
  for (const int id : keyframes) {
    views.push_back(ViewOf(odometry.map(), id));
    for (const int landmark : views.back().landmarks) ++seen[landmark];
  }
  std::vector<std::pair<int, int>> landmarks;  // id, keyframes that see it
  for (const auto& [id, count] : seen) {
    if (id >= 0 && count >= 3 && odometry.map().landmark(id).position.allFinite())
      landmarks.emplace_back(id, count);
  }
  std::stable_sort(landmarks.begin(), landmarks.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  if (landmarks.size() > most_landmarks) landmarks.resize(most_landmarks);
  Scene scene;
  std::map<int, int> place;
  for (const auto& [id, count] : landmarks) {
    place[id] = static_cast<int>(scene.landmarks.size());
    scene.landmarks.push_back(odometry.map().landmark(id).position);
  }
  const PinholeCamera& c = odometry.map().rig().camera;
  for (const KeyframeView& view : views) {
    const Pose T_camera_world = view.T_world_camera.Inverse();
    for (std::size_t f = 0; f < view.landmarks.size(); ++f) {
      const auto found = place.find(view.landmarks[f]);
      if (found == place.end()) continue;
      const auto at = static_cast<std::size_t>(found->second);
      if (!((T_camera_world * scene.landmarks[at]).z() > 0)) continue;
      const cv::Point2f pixel = view.keypoints[f].pt;
      Measurement o{static_cast<int>(scene.cameras.size()),
                    found->second,
                    {double(pixel.x) - c.cx, (double(pixel.y) - c.cy) / aspect},
                    0,
                    0};
      if (const double inverse = double(view.inverse_depth[f]); inverse > 0) {
        o.depth = 1 / inverse;
        o.depth_sigma = std::max(kDepthSigma, double(view.inverse_depth_sigma[f]) / inverse);
      }
      scene.observations.push_back(o);
    }
    const Eigen::AngleAxisd turn(T_camera_world.rotation);
    const Eigen::Vector3d r = turn.angle() * turn.axis(), t = T_camera_world.translation;
    scene.cameras.push_back({{r.x(), r.y(), r.z(), t.x(), t.y(), t.z()}});
  }
  if (static_cast<int>(scene.cameras.size()) < kFewestKeyframes || scene.landmarks.size() < 50 ||
      scene.observations.empty())
    return std::nullopt;
  scene.given = std::log(std::sqrt(c.fx * c.fy / aspect));
  scene.lens = {{scene.given, 0, 0, 0}};
  scene.stereo = odometry.map().rig().sensor == Sensor::kStereo;
  scene.width = c.width;
  return scene;
}

struct Pass {
  std::optional<Scene> scene;
  int frames = 0, posed = 0;
};

Pass Track(const Dataset& dataset, const RunConfig& config, const PinholeCamera& camera, int frames) {
  CameraRig rig = dataset.Rig();
  rig.camera = camera;
  OdometryOptions options = config.odometry;
  options.lens_sigma = 0;  // the lens is sought here
  options.features = std::min(options.features, std::max(kFewestFeatures, options.features / 2));
  Odometry odometry(options, rig);
  Pass pass;
  for (std::size_t i = 0; i < dataset.Size() && pass.frames < frames; ++i) {
    const ReadResult read = dataset.Read(i);
    if (!read.frame) continue;
    ++pass.frames;
    const TrackResult track = odometry.Track(*read.frame);
    pass.posed += int(track.state == TrackingState::kTracking);
  }
  odometry.FinishMapping();
  pass.scene =
      SceneOf(odometry, KeyframesOfLargestSubmap(odometry, {}), kMostLandmarks, camera.fy / camera.fx);
  return pass;
}

// The variance of a residual would be 1 if sigmas were what they are said to be.
double VarianceOf(const Scene& scene, const Fit& fit) {
  const auto free = static_cast<double>(6 * scene.cameras.size() + 3 * scene.landmarks.size());
  return std::max(1e-4, 2 * fit.cost / std::max(1.0, fit.residuals - free));
}

double SumOfSquares(const std::vector<double>& values) {
  return std::inner_product(values.begin(), values.end(), values.begin(), 0.0);
}

// How far the focal length of an adjusted scene can be from the true one, as share of it. Around the
// solution, with Jacobian J and errors e, each weighted by its loss, it is off by the sum over all errors of
// (J u) e, where J^T J u is 1 for the focal length and 0 for all else. Errors of one landmark are not
// independent, nor are those of one keyframe, so what varies are sums over each: a sandwich estimate with
// clusters of two kinds (A. C. Cameron, J. B. Gelbach, D. L. Miller, "Robust Inference with Multiway
// Clustering", Journal of Business & Economic Statistics 2011). The whole sum is what the solver has left to
// go.
double SigmaOf(Scene scene) {
  ceres::Problem problem;
  AddErrors(scene, &problem);
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = {scene.lens.data()};
  const auto add = [&](double* block) {
    if (problem.HasParameterBlock(block)) options.parameter_blocks.push_back(block);
  };
  for (std::size_t k = 0; k < scene.cameras.size(); ++k) {
    if (k != FixedCamera(scene)) add(scene.cameras[k].data());
  }
  for (Eigen::Vector3d& landmark : scene.landmarks) add(landmark.data());
  problem.GetResidualBlocks(&options.residual_blocks);
  std::vector<double> errors;
  ceres::CRSMatrix by_all;
  if (!problem.Evaluate(options, nullptr, &errors, nullptr, &by_all)) return 1;
  const Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>> J(
      by_all.num_rows, by_all.num_cols, static_cast<Eigen::Index>(by_all.values.size()), by_all.rows.data(),
      by_all.cols.data(), by_all.values.data());
  Eigen::SparseMatrix<double> hessian = J.transpose() * J;
  hessian.diagonal() *= 1 + kRidge;  // one camera knows no scale
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(hessian);
  if (solver.info() != Eigen::Success) return 1;
  const Eigen::VectorXd weights = J * solver.solve(Eigen::VectorXd::Unit(J.cols(), 0)).eval();
  if (!weights.allFinite()) return 1;

  std::vector<double> of_landmark(scene.landmarks.size(), 0), of_keyframe(scene.cameras.size(), 0), of_each;
  double left = 0;
  Eigen::Index row = 0;
  const auto next = [&] {
    const double move = weights[row] * errors[static_cast<std::size_t>(row)];
    ++row;
    left += move;
    return move;
  };
  for (const Measurement& o : scene.observations) {
    double move = next();
    move += next();
    if (o.depth > 0) move += next();
    of_landmark[static_cast<std::size_t>(o.landmark)] += move;
    of_keyframe[static_cast<std::size_t>(o.keyframe)] += move;
    of_each.push_back(move);
  }
  double variance = 0;  // a prior varies as much as it says, wherever the lens has ended up
  while (row < weights.size()) {
    variance += weights[row] * weights[row];
    next();
  }
  const double of_landmarks = SumOfSquares(of_landmark);
  variance += std::max(of_landmarks, of_landmarks + SumOfSquares(of_keyframe) - SumOfSquares(of_each));
  return std::hypot(kLeftOut * std::sqrt(variance), left);
}

// What a map says of its camera.
struct Estimate {
  std::array<double, 4> lens = {{0, 0, 0, 0}};  // as Scene's
  double sigma = 1;                             // of the logarithm of the focal length
  double lens_sigma = 0;                        // part of it: by the choice of the lens
};

// A distortion of the lens and another focal length look nearly the same, and what the model has not
// (further coefficients, a rolling shutter) goes into either: the truth lies between the fit with k1 free
// and the one without distortion, and half of their difference is what the choice of the model is uncertain
// by.
// No sigma (1) where the focal length moves by more than that: there is a better map to come.
std::optional<Estimate> EstimateOf(const Scene& scene, double worth_a_sigma) {
  Scene free = scene, straight = scene;
  straight.lens_sigma = kNoLens;
  const Fit with = Adjust(free), without = Adjust(straight);
  if (!with.usable || !without.usable) return std::nullopt;
  Estimate estimate;
  for (std::size_t i = 0; i < estimate.lens.size(); ++i)
    estimate.lens[i] = 0.5 * (free.lens[i] + straight.lens[i]);
  estimate.lens_sigma = 0.5 * std::abs(free.lens[0] - straight.lens[0]);
  const double moved = estimate.lens[0] - scene.given;
  if (std::abs(moved) < worth_a_sigma) {
    estimate.sigma = std::hypot(SigmaOf(free), estimate.lens_sigma, kLeftOver * moved);
  }
  return estimate;
}

PinholeCamera CameraOf(const PinholeCamera& before, const std::array<double, 4>& lens) {
  PinholeCamera camera = before;
  const double aspect = before.fy / before.fx;  // of the pixels, which need not be square
  camera.fx = std::exp(lens[0]);
  camera.fy = aspect * camera.fx;
  camera.cx = std::clamp(before.cx + lens[2], 0.0, double(before.width));
  camera.cy = std::clamp(before.cy + aspect * lens[3], 0.0, double(before.height));
  return camera;
}

bool IsLens(double focal_px, int width) { return focal_px > 0.2 * width && focal_px < 10.0 * width; }

// A share of the recording: the odometry of these frames is what measuring costs.
int FramesToTrack(const Dataset& dataset, int most) {
  constexpr std::size_t kShare = 3;
  constexpr int kFewest = 40;
  const auto share = static_cast<int>(std::min<std::size_t>(dataset.Size() / kShare, 1000000));
  return std::min(most, std::max(kFewest, share));
}

}  // namespace

FocalLength MeasureFocalLength(const fs::path& path, const RunConfig& config, int frames) {
  constexpr double kSettled = 0.03;  // a move of the focal length that needs no second look
  const double cpu_begin = ProcessCpuSeconds();
  DatasetOptions as_stored = config.dataset;
  as_stored.rotate = 0;
  const std::unique_ptr<Dataset> dataset = OpenDataset(path, as_stored);
  FocalLength result;
  result.camera = dataset->Rig().camera;
  const int most = FramesToTrack(*dataset, frames);
  // From the usual one; a wide or a narrow one where that loses its way.
  const std::array<double, 3> starts = {{1, 0.65, 1.5}};
  std::size_t start = 0;
  std::optional<Estimate> found;
  PinholeCamera camera = result.camera;
  for (int tracked = 0; tracked < 2 * most && start < starts.size();) {
    if (!found) {
      camera.fx = starts[start] * result.camera.fx;
      camera.fy = starts[start] * result.camera.fy;
    }
    const Pass pass = Track(*dataset, config, camera, most);
    result.frames = pass.frames;
    tracked += std::max(1, pass.frames);
    const bool last = tracked >= 2 * most;
    const bool enough = pass.scene && 2 * pass.posed >= pass.frames;
    const std::optional<Estimate> here =
        enough ? EstimateOf(*pass.scene, last ? kAnyMove : kSettled) : std::nullopt;
    if (!here || !IsLens(std::exp(here->lens[0]), camera.width)) {
      result.reason = enough ? "nothing agrees on a focal length" : "too little of it could be tracked";
      if (found) break;
      ++start;
      continue;
    }
    found = here;
    const double moved = found->lens[0] - std::log(camera.fx);
    camera = CameraOf(camera, found->lens);
    if (std::abs(moved) < kSettled) break;
  }
  result.cpu_s = ProcessCpuSeconds() - cpu_begin;
  if (!found) return result;
  result.sigma = found->sigma;
  result.lens_sigma = found->lens_sigma;
  result.measured = result.sigma <= kWorstSigma;
  result.reason = result.measured ? "" : "the motion does not tell the focal length";
  if (!result.measured) return result;
  result.camera = camera;
  if (std::abs(found->lens[1]) > 0.01) {
    result.camera.distortion = Distortion::kRadTan;
    result.camera.coefficients = {found->lens[1], 0, 0, 0, 0};
  }
  result.camera = TurnedCamera(result.camera, (360 - dataset->TurnedBy()) % 360);
  return result;
}

FocalLength FocalLengthOf(const Odometry& odometry, const FrameRange& session, double lens_sigma) {
  const double cpu_begin = ProcessCpuSeconds();
  FocalLength result;
  result.camera = odometry.map().rig().camera;
  const std::optional<Scene> scene = SceneOf(odometry, WhereItTurns(odometry, session), kCheckedLandmarks,
                                             result.camera.fy / result.camera.fx);
  const std::optional<Estimate> found = scene ? EstimateOf(*scene, kAnyMove) : std::nullopt;
  if (found && IsLens(std::exp(found->lens[0]), result.camera.width)) {
    result.sigma = std::hypot(found->sigma, lens_sigma);
    result.measured = result.sigma <= kWorstSigma;
    if (result.measured) {
      result.camera.fy *= std::exp(found->lens[0]) / result.camera.fx;
      result.camera.fx = std::exp(found->lens[0]);
    }
  }
  if (!result.measured)
    result.reason = scene ? "the motion does not tell the focal length" : "the map is too small";
  result.cpu_s = ProcessCpuSeconds() - cpu_begin;
  return result;
}

std::string FocalLengthText(const FocalLength& found, const std::string& photo_lens) {
  char text[300];
  if (found.measured) {
    std::snprintf(text, sizeof text, "focal length measured on %d frames: %.1f px, give or take %.1f %%",
                  found.frames, found.camera.fx, 100 * found.sigma);
    return text;
  }
  std::snprintf(text, sizeof text, "guessed, %.1f px", found.camera.fx);
  return "focal length " + (photo_lens.empty() ? text : photo_lens) + ": in the first " +
         std::to_string(found.frames) + " frames " + found.reason;
}

LensCheck CheckLens(const Odometry& odometry, const FrameRange& session) {
  LensCheck check;
  std::optional<Scene> scene = SceneOf(odometry, WhereItTurns(odometry, session), kCheckedLandmarks);
  if (!scene) return check;
  // A wrong focal length and a wrong lens look nearly the same, and seldom are both wrong.
  Scene kept = *scene;
  kept.lens_sigma = kLensKept;
  const Fit by_focal = Adjust(kept);
  Fit fit = Adjust(*scene);
  if (!fit.usable) return check;
  const double gain = 2 * (by_focal.cost - fit.cost) / VarianceOf(*scene, fit);
  check.other_lens = !by_focal.usable || gain >= kNeedsLens * kCorrelation * kCorrelation;
  if (!check.other_lens) {
    scene = std::move(kept);
    fit = by_focal;
  }
  check.sigma = SigmaOf(*scene);
  check.measured = check.sigma <= kWorstChecked;
  check.focal_ratio = std::exp(scene->lens[0] - scene->given);
  check.k1 = scene->lens[1];
  return check;
}

}  // namespace tutti
