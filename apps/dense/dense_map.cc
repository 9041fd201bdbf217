#include "tutti/dense/dense_map.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "apps/dense/stages.h"
#include "apps/dense/voxel_blocks.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr std::size_t kSpeck = 32;    // a piece of fewer triangles is noise
constexpr double kReachVoxels = 1e4;  // farther depth is none, or in another unit

std::string SizeOf(const cv::Mat& image) {
  return std::to_string(image.cols) + "x" + std::to_string(image.rows);
}

// Inverse depth; 0 where nothing is measured, or what is farther than `most_m`. Returns how many were
// farther.
long SetDepth(const cv::Mat& depth_m, double most_m, DepthView* view) {
  view->inverse_depth.create(depth_m.size(), CV_32FC1);
  const auto most = static_cast<float>(most_m);
  float farthest = 0;
  long farther = 0;
  for (int v = 0; v < depth_m.rows; ++v) {
    const float* from = depth_m.ptr<float>(v);
    float* to = view->inverse_depth.ptr<float>(v);
    for (int u = 0; u < depth_m.cols; ++u) {
      const bool measured = from[u] > 0 && from[u] <= most;  // false for NaN
      to[u] = measured ? 1 / from[u] : 0;
      if (measured) farthest = std::max(farthest, from[u]);
      if (from[u] > most) ++farther;
    }
  }
  view->farthest_m = static_cast<double>(farthest);
  return farther;
}

}  // namespace

std::string DenseOptions::Validate() const { return OutOfRange(*this); }

struct DenseMap::Impl {
  explicit Impl(const DenseOptions& given) : options(given), surface(given.voxel_m) {
    if (!options.free_space) return;
    if (options.cell_m <= 0) options.cell_m = std::max(0.05, 2.5 * options.voxel_m);
    space.emplace(options.cell_m);
  }

  // Empty, or why these can't be used.
  std::string Problem(const cv::Mat& depth_m, const cv::Mat& image, const Pose& T_world_camera,
                      const PinholeCamera& camera) const;
  std::string Integrate(const DepthView& view);
  bool MakeBlocks(const DepthView& view, bool free_space, VoxelBlocks* blocks);
  VoxelMesh Surface() const {
    return WithoutSpecks(MarchingCubes(surface, options.min_frames, options.threads), kSpeck);
  }

  DenseOptions options;
  DenseReport report;
  VoxelBlocks surface;
  std::optional<VoxelBlocks> space;
  std::vector<Pose> cameras;
};

std::string DenseMap::Impl::Problem(const cv::Mat& depth_m, const cv::Mat& image, const Pose& T_world_camera,
                                    const PinholeCamera& camera) const {
  if (depth_m.empty()) return "it has no depth image";
  if (depth_m.type() != CV_32FC1) return "the depth image must hold metres as floats (CV_32FC1)";
  const cv::Size size(camera.width, camera.height);
  if (depth_m.size() != size)
    return "the depth image is " + SizeOf(depth_m) + ", the camera " + std::to_string(camera.width) + "x" +
           std::to_string(camera.height);
  if (!image.empty() && image.size() != size)
    return "the image is " + SizeOf(image) + ", the depth image " + SizeOf(depth_m);
  if (!image.empty() && image.type() != CV_8UC3 && image.type() != CV_8UC1)
    return "the image must have 8 bits, and one channel or three";
  if (!T_world_camera.IsFinite()) return "its pose is not finite";
  const double reach = 0.5 * VoxelBlocks::kReach * surface.BlockSize();
  if (T_world_camera.translation.norm() > reach) return "its pose is farther away than a map reaches";
  return "";
}

// False if there is no memory for all of them.
bool DenseMap::Impl::MakeBlocks(const DepthView& view, bool free_space, VoxelBlocks* blocks) {
  const double megabytes = 1e-6 * sizeof(VoxelBlock);
  for (const std::uint64_t key : MissingBlocks(view, free_space, *blocks, options.threads)) {
    if (megabytes * static_cast<double>(report.blocks + 1) > options.memory_mb) return false;
    blocks->Add(BlockCorner(key));
    ++report.blocks;
    report.memory_mb = megabytes * static_cast<double>(report.blocks);
  }
  return true;
}

std::string DenseMap::Impl::Integrate(const DepthView& view) {
  if (double off_m = 0; DisagreesWith(surface, view, options.min_frames, &off_m)) {
    ++report.apart;
    report.apart_m = std::max(report.apart_m, off_m);
  }
  bool whole = MakeBlocks(view, false, &surface);
  Fuse(view, options.threads, &surface);
  if (space) {
    whole = MakeBlocks(view, true, &*space) && whole;
    Fuse(view, options.threads, &*space);
  }
  cameras.push_back(view.T_world_camera);
  ++report.integrated;
  if (!whole) ++report.cut;
  return "";
}

DenseMap::DenseMap(const DenseOptions& options) {
  if (const std::string problem = options.Validate(); !problem.empty())
    throw InputError("dense map: " + problem);
  impl_ = std::make_unique<Impl>(options);
}
DenseMap::~DenseMap() = default;
DenseMap::DenseMap(DenseMap&&) noexcept = default;

std::string DenseMap::Integrate(const cv::Mat& depth_m, const cv::Mat& image, const Pose& T_world_camera,
                                const PinholeCamera& camera) {
  std::string problem = camera.Validate();
  if (problem.empty() && camera.distortion != Distortion::kNone)
    problem = "the camera must have no distortion";
  if (problem.empty()) problem = impl_->Problem(depth_m, image, T_world_camera, camera);
  DepthView view{camera, T_world_camera, {}, image, 0};
  if (problem.empty()) {
    const DenseOptions& options = impl_->options;
    const double most = kReachVoxels * options.voxel_m;
    const long farther =
        SetDepth(depth_m, options.max_depth_m > 0 ? std::min(options.max_depth_m, most) : most, &view);
    if (!(view.farthest_m > 0))
      problem = farther == 0 ? "its depth image is empty"
                             : "all its depth is beyond " + std::to_string(std::lround(most)) +
                                   " m or max_depth_m; is its unit the metre?";
  }
  if (!problem.empty()) {
    ++impl_->report.skipped;
    return problem;
  }
  if (image.channels() == 1 && !image.empty()) cv::cvtColor(image, view.bgr, cv::COLOR_GRAY2BGR);
  return impl_->Integrate(view);
}

TriangleMesh DenseMap::Mesh() const { return impl_->Surface().mesh; }

PointCloud DenseMap::Cloud() const {
  const VoxelMesh surface = impl_->Surface();
  const PointCloud& vertices = surface.mesh.vertices;
  PointCloud cloud;
  for (std::size_t i = 0; i < surface.voxels.size();) {
    Eigen::Vector3f point = Eigen::Vector3f::Zero(), normal = point, colour = point;
    const std::size_t first = i;
    for (; i < surface.voxels.size() && surface.voxels[i] == surface.voxels[first]; ++i) {
      point += vertices.points[i];
      normal += vertices.normals[i];
      for (int c = 0; c < 3; ++c)
        colour[c] += static_cast<float>(vertices.colours[i][static_cast<std::size_t>(c)]);
    }
    const auto count = static_cast<float>(i - first);
    cloud.points.emplace_back(point / count);
    cloud.normals.emplace_back(normal.norm() > 0 ? Eigen::Vector3f(normal.normalized())
                                                 : vertices.normals[first]);
    cloud.colours.emplace_back();
    for (int c = 0; c < 3; ++c)
      cloud.colours.back()[static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(colour[c] / count + 0.5F);
  }
  return cloud;
}

OccupiedSpace DenseMap::Space() const {
  if (!impl_->space) throw InputError("dense map: Space() and Grid() need DenseOptions::free_space");
  if (impl_->cameras.empty()) return {impl_->options.cell_m, {}, false, {}, {}};
  const PointCloud surface = impl_->Surface().mesh.vertices;
  return SpaceIn(FindMapFrame(surface, impl_->cameras), surface, *impl_->space, impl_->options.min_frames,
                 impl_->options.threads);
}

OccupancyGrid DenseMap::Grid() const { return GridOf(Space()); }

const DenseOptions& DenseMap::Options() const { return impl_->options; }
const DenseReport& DenseMap::Report() const { return impl_->report; }

}  // namespace tutti
