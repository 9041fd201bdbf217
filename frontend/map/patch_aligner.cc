#include "frontend/map/patch_aligner.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/eigen_bits.h"
#include "core/reprojection.h"
#include "frontend/features/grey_window.h"
#include "frontend/geometry/lens_error.h"
#include "frontend/geometry/pose_solver.h"

namespace tutti {
namespace {

constexpr int kHalf = 4;  // half of the window that is compared [px of its level]
constexpr int kSide = 2 * kHalf + 1;
constexpr int kPixels = kSide * kSide;
constexpr int kIterations = 10;
constexpr float kConverged = 0.02F;   // [px]
constexpr float kMaxShift = 2.5F;     // from the detected corner [px of its level]
constexpr float kMaxResidual = 0.2F;  // of the window's variance
constexpr float kMinGradient = 30;    // least weighted mean square gradient in any direction [grey levels^2]

using Window = GreyWindow<kHalf>;
using Vector4f = Eigen::Matrix<float, 4, 1>;

// Level-0 pixels per pixel of a level; sizes of levels are rounded.
Eigen::Vector2d LevelScale(const std::vector<cv::Mat>& pyramid, std::size_t level) {
  return {double(pyramid[0].cols) / pyramid[level].cols, double(pyramid[0].rows) / pyramid[level].rows};
}

Eigen::Vector2d ToLevel(const Eigen::Vector2d& pixel, const Eigen::Vector2d& scale) {
  return ((pixel.array() + 0.5) / scale.array() - 0.5).matrix();
}

// Level-0 pixels of a frame per pixel of the patch.
double SizeIn(const Patch& patch, const Eigen::Matrix2d& A_frame_patch) {
  return patch.scale_x * std::sqrt(std::abs(A_frame_patch.determinant()));
}

// The patch as the frame should see it, one pixel wider than the window on each side; false if the patch does
// not reach so far.
bool Warp(const Patch& patch, const Eigen::Matrix2f& A_patch_level, float (*grey)[kSide + 2]) {
  constexpr float kCentre = Patch::kHalf;
  for (int v = -kHalf - 1; v <= kHalf + 1; ++v) {
    for (int u = -kHalf - 1; u <= kHalf + 1; ++u) {
      const float x =
          kCentre + patch.offset_x + A_patch_level(0, 0) * float(u) + A_patch_level(0, 1) * float(v);
      const float y =
          kCentre + patch.offset_y + A_patch_level(1, 0) * float(u) + A_patch_level(1, 1) * float(v);
      if (!(x >= 0 && y >= 0 && x < Patch::kSide - 1 && y < Patch::kSide - 1)) return false;
      grey[v + kHalf + 1][u + kHalf + 1] = Bilinear(patch.grey.data(), Patch::kSide, x, y);
    }
  }
  return true;
}

// What the inverse compositional method works out once for a template.
struct Template {
  Window grey;
  Eigen::Matrix<float, kPixels, 4> weighted;  // shift in x and y, gain, offset
  Eigen::LDLT<Eigen::Matrix4f> solver;
  float variance = 0;
};

bool Prepare(const float (*grey)[kSide + 2], Template* t) {
  const Window& weights = WindowWeights<kHalf>();
  for (int v = 0, n = 0; v < kSide; ++v) {
    for (int u = 0; u < kSide; ++u, ++n) t->grey(n) = grey[v + 1][u + 1];
  }
  const float mean = weights.dot(t->grey);
  Eigen::Matrix<float, kPixels, 4> jacobian;
  for (int v = 0, n = 0; v < kSide; ++v) {
    for (int u = 0; u < kSide; ++u, ++n) {
      jacobian(n, 0) = 0.5F * (grey[v + 1][u + 2] - grey[v + 1][u]);
      jacobian(n, 1) = 0.5F * (grey[v + 2][u + 1] - grey[v][u + 1]);
      jacobian(n, 2) = t->grey(n) - mean;
      jacobian(n, 3) = 1;
    }
  }
  for (int c = 0; c < 4; ++c) t->weighted.col(c) = weights.cwiseProduct(jacobian.col(c));
  const Eigen::Matrix4f h = t->weighted.transpose() * jacobian;
  t->variance = h(2, 2);
  const float half_trace = 0.5F * (h(0, 0) + h(1, 1)), difference = 0.5F * (h(0, 0) - h(1, 1));
  if (!(half_trace - std::sqrt(difference * difference + h(0, 1) * h(0, 1)) > kMinGradient)) return false;
  t->solver.compute(h);
  t->grey.array() -= mean;
  return t->solver.info() == Eigen::Success;
}

// Shifts the template over the image from (x, y) on.
bool Fit(const Template& t, const cv::Mat& image, float* x, float* y) {
  const float x0 = *x, y0 = *y, reach = kHalf;
  float gain = 1, offset = 0, residual = 0;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    if (!(*x - reach >= 0 && *y - reach >= 0 && *x + reach < float(image.cols - 1) &&
          *y + reach < float(image.rows - 1)))
      return false;
    Window r;
    BilinearWindow<kHalf>(image.data, image.step, *x, *y, &r);
    if (iteration == 0) offset = WindowWeights<kHalf>().dot(r);
    r.array() -= gain * t.grey.array() + offset;
    residual = WindowWeights<kHalf>().dot(r.cwiseAbs2());
    Vector4f step = t.weighted.transpose() * r;
    internal::small_ldlt::SolveInPlace<4>(t.solver, step.data());
    *x -= step(0) / std::max(gain, 0.1F);
    *y -= step(1) / std::max(gain, 0.1F);
    gain += step(2);
    offset += step(3);
    if (!(std::abs(*x - x0) < kMaxShift && std::abs(*y - y0) < kMaxShift && gain > 0.3F && gain < 3))
      return false;
    if (std::abs(step(0)) < kConverged && std::abs(step(1)) < kConverged)
      return residual < kMaxResidual * gain * gain * t.variance;
  }
  return false;
}

}  // namespace

namespace {

// Where the image has a feature: without what is known of the lens's error and the rolling shutter.
Eigen::Vector2d InImage(const PinholeCamera& camera, const FrameFeatures& features, int feature) {
  const std::size_t f = static_cast<std::size_t>(feature);
  const cv::Point2f& at = features.keypoints[f].pt;
  return LensError::Uncorrect(camera, features.lens, Eigen::Vector2d(at.x, at.y) - features.Rolled(f));
}

// The inverse, for a place near the feature.
Eigen::Vector2d OutOfImage(const PinholeCamera& camera, const FrameFeatures& features, int feature,
                           const Eigen::Vector2d& pixel) {
  return LensError::Correct(camera, features.lens, pixel) +
         features.Rolled(static_cast<std::size_t>(feature));
}

}  // namespace

std::shared_ptr<const Patch> CutPatch(const PinholeCamera& camera, const FrameFeatures& features,
                                      int feature) {
  const cv::KeyPoint& k = features.keypoints[static_cast<std::size_t>(feature)];
  const std::size_t level = static_cast<std::size_t>(k.octave);
  if (!features.pyramid) return nullptr;
  const std::vector<cv::Mat>& levels = features.pyramid->Levels();
  if (level >= levels.size()) return nullptr;
  const cv::Mat& image = levels[level];
  const Eigen::Vector2d scale = LevelScale(levels, level);
  const Eigen::Vector2d p = ToLevel(InImage(camera, features, feature), scale);
  const int x = static_cast<int>(std::lround(p.x())), y = static_cast<int>(std::lround(p.y()));
  if (x < Patch::kHalf || y < Patch::kHalf || x + Patch::kHalf >= image.cols ||
      y + Patch::kHalf >= image.rows)
    return nullptr;
  auto patch = std::make_shared<Patch>();
  patch->offset_x = static_cast<float>(p.x() - x);
  patch->offset_y = static_cast<float>(p.y() - y);
  patch->scale_x = static_cast<float>(scale.x());
  patch->scale_y = static_cast<float>(scale.y());
  for (int v = 0; v < Patch::kSide; ++v) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(y - Patch::kHalf + v) + x - Patch::kHalf;
    std::copy(row, row + Patch::kSide, patch->grey.data() + v * Patch::kSide);
  }
  return patch;
}

std::optional<Eigen::Vector2d> AlignPatch(const Patch& patch, const FrameFeatures& frame,
                                          const Eigen::Matrix2d& A_frame_patch,
                                          const Eigen::Vector2d& start) {
  if (!frame.pyramid || frame.pyramid->Levels().empty()) return std::nullopt;
  const std::vector<cv::Mat>& pyramid = frame.pyramid->Levels();
  // The level at which the patch keeps its size.
  const double size = SizeIn(patch, A_frame_patch);
  std::size_t level = 0;
  while (level + 1 < pyramid.size() && std::abs(std::log(LevelScale(pyramid, level + 1).x() / size)) <
                                           std::abs(std::log(LevelScale(pyramid, level).x() / size)))
    ++level;
  const Eigen::Vector2d scale = LevelScale(pyramid, level);
  const Eigen::Matrix2d A_level_patch = scale.cwiseInverse().asDiagonal() * A_frame_patch *
                                        Eigen::Vector2d(patch.scale_x, patch.scale_y).asDiagonal();
  if (!(std::abs(A_level_patch.determinant()) > 0.1)) return std::nullopt;
  float grey[kSide + 2][kSide + 2];
  Template t;
  if (!Warp(patch, A_level_patch.inverse().cast<float>(), grey) || !Prepare(grey, &t)) return std::nullopt;
  const Eigen::Vector2d p = ToLevel(start, scale);
  float x = static_cast<float>(p.x()), y = static_cast<float>(p.y());
  if (!Fit(t, pyramid[level], &x, &y)) return std::nullopt;
  return Eigen::Vector2d((x + 0.5) * scale.x() - 0.5, (y + 0.5) * scale.y() - 0.5);
}

namespace {

// How offsets around a point in its patch's keyframe, where it is at `p`, map to offsets in a frame, if the
// surface faces the keyframe.
std::optional<Eigen::Matrix2d> PatchToFrame(const PinholeCamera& camera, const Pose& T_camera_patch,
                                            const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = T_camera_patch * p;
  Eigen::Vector2d pixel;
  internal::Reprojection<2>::PointJacobian projection;
  if (!(p.z() > kMinDepth) || !internal::Reprojection<2>::Residual(camera, q, {Eigen::Vector2d::Zero()},
                                                                   kMinDepth, &pixel, &projection))
    return std::nullopt;
  const Eigen::Matrix3d r = T_camera_patch.rotation.toRotationMatrix();
  Eigen::Matrix<double, 3, 2> lift;
  lift << p.z() / camera.fx, 0, 0, p.z() / camera.fy, 0, 0;
  return Eigen::Matrix2d(projection * r * lift);
}

// The same for a landmark, and a frame at `T_camera_world`.
std::optional<Eigen::Matrix2d> PatchToFrame(const Map& map, const PinholeCamera& camera,
                                            const Pose& T_camera_world, const Landmark& landmark) {
  const Pose& T_world_patch = map.keyframe(landmark.patch_source.keyframe).T_world_camera;
  return PatchToFrame(camera, T_camera_world * T_world_patch, T_world_patch.Inverse() * landmark.position);
}

}  // namespace

std::optional<Eigen::Vector2d> FindPoint(const PinholeCamera& camera, const FrameFeatures& a, int feature_a,
                                         const FrameFeatures& b, int feature_b, const Pose& T_b_a,
                                         const Eigen::Vector3d& in_a) {
  const std::shared_ptr<const Patch> patch = CutPatch(camera, a, feature_a);
  const std::optional<Eigen::Matrix2d> A = PatchToFrame(camera, T_b_a, in_a);
  if (!patch || !A) return std::nullopt;
  const std::optional<Eigen::Vector2d> found = AlignPatch(*patch, b, *A, InImage(camera, b, feature_b));
  if (!found) return std::nullopt;
  return OutOfImage(camera, b, feature_b, *found);
}

std::vector<PatchView> FindPatches(const Map& map, const PinholeCamera& camera, const Pose& T_camera_world,
                                   const std::vector<int>& landmarks, const FrameFeatures& features) {
  std::vector<PatchView> views;
  if (!features.pyramid || !features.rolled.empty()) return views;
  for (int id : landmarks) {
    const Landmark& l = map.landmark(id);
    if (!l.alive || !l.patch) continue;
    const std::optional<Eigen::Matrix2d> A = PatchToFrame(map, camera, T_camera_world, l);
    if (!A) continue;  // behind the camera
    const Eigen::Vector2d expected = camera.Project(T_camera_world * l.position);
    if (!camera.Contains(expected)) continue;
    const std::optional<Eigen::Vector2d> found =
        AlignPatch(*l.patch, features, *A, LensError::Uncorrect(camera, features.lens, expected));
    if (!found) continue;
    views.push_back({id, LensError::Correct(camera, features.lens, *found), SizeIn(*l.patch, *A)});
  }
  return views;
}

std::shared_ptr<const FrameFeatures> AlignFeatures(const Map& map, const PinholeCamera& camera,
                                                   const Pose& T_camera_world,
                                                   const std::vector<int>& landmarks,
                                                   const FrameFeatures& features) {
  std::shared_ptr<FrameFeatures> moved;
  if (!features.pyramid) return moved;
  for (std::size_t f = 0; f < landmarks.size(); ++f) {
    if (landmarks[f] < 0) continue;
    const Landmark& l = map.landmark(landmarks[f]);
    if (!l.patch || features.aligned[f] == landmarks[f]) continue;
    const std::optional<Eigen::Matrix2d> A = PatchToFrame(map, camera, T_camera_world, l);
    if (!A) continue;
    const int feature = static_cast<int>(f);
    const std::optional<Eigen::Vector2d> found =
        AlignPatch(*l.patch, features, *A, InImage(camera, features, feature));
    if (!found) continue;
    if (!moved) moved = std::make_shared<FrameFeatures>(features);
    moved->aligned[f] = landmarks[f];
    const Eigen::Vector2d to = OutOfImage(camera, features, feature, *found);
    moved->keypoints[f].pt = cv::Point2f(static_cast<float>(to.x()), static_cast<float>(to.y()));
  }
  if (moved) moved->BuildGrid(camera.width, camera.height);
  return moved;
}

}  // namespace tutti
