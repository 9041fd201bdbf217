#include "apps/reconstruct/reconstruction.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <system_error>

#include "apps/reconstruct/depth_source.h"
#include "apps/reconstruct/written_maps.h"
#include "apps/run/interrupt.h"
#include "apps/run/progress.h"
#include "core/parallel.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/dense/dense_files.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr double kMostBaselines = 40;
constexpr std::int64_t kSameStretch = 3;  // frames apart that are named together

std::string Metres(double length) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3g m", length);
  return text;
}

std::string Count(std::size_t number, const std::string& what) {
  return std::to_string(number) + " " + what + (number == 1 ? "" : "s");
}

// Of the camera at `from`, by where it is at `to`.
Vector6d Velocity(const StampedPose& from, const StampedPose& to, const Pose& T_body_camera) {
  constexpr double kMostGap = 0.5;  // [s]
  const double seconds = to.stamp_s - from.stamp_s;
  if (seconds == 0 || std::abs(seconds) > kMostGap) return Vector6d::Zero();
  return LogSE3((from.pose * T_body_camera).Inverse() * to.pose * T_body_camera) / seconds;
}

// The frames of the data set that have a pose, in their order.
std::vector<PosedFrame> FramesOf(const MapModel& model, const Dataset& dataset, bool keyframes_only) {
  std::map<double, const ModelKeyframe*> keyframes;  // by time stamp
  for (const ModelKeyframe& keyframe : model.keyframes) keyframes[keyframe.stamp_s] = &keyframe;
  const Pose T_body_camera = dataset.Rig().T_body_camera;
  std::vector<PosedFrame> frames;
  for (std::size_t i = 0; i < model.trajectory.size(); ++i) {
    const StampedPose& pose = model.trajectory[i];
    const std::optional<std::size_t> place = FindStamp(dataset, pose.stamp_s);
    if (!place) continue;
    const auto keyframe = keyframes.find(pose.stamp_s);
    const bool is_keyframe = keyframe != keyframes.end();
    if (keyframes_only && !is_keyframe) continue;
    PosedFrame frame;
    frame.place = *place;
    frame.T_world_camera = pose.pose * T_body_camera;
    if (is_keyframe) frame.keyframe = keyframe->second;
    if (i > 0) frame.velocity_before = Velocity(pose, model.trajectory[i - 1], T_body_camera);
    if (i + 1 < model.trajectory.size())
      frame.velocity_after = Velocity(pose, model.trajectory[i + 1], T_body_camera);
    frames.push_back(frame);
  }
  if (frames.empty())
    throw InputError(
        "the data set has no frame of the map, by its time stamp; give the one that the map was made of");
  return frames;
}

void RequireSameCamera(const PinholeCamera& a, const PinholeCamera& b) {
  constexpr double kSame = 1e-6;  // [px]
  if (a.width == b.width && a.height == b.height && std::abs(a.fx - b.fx) < kSame &&
      std::abs(a.fy - b.fy) < kSame && std::abs(a.cx - b.cx) < kSame && std::abs(a.cy - b.cy) < kSame)
    return;
  throw InputError(
      "the data set has another camera than the map (size, focal length or principal point); give the one "
      "that the "
      "map was made of");
}

// A frame as it is integrated.
struct ReadFrame {
  DepthImageRead depth;
  ColourImage colour;
};

class Integration {
 public:
  Integration(const Dataset& dataset, const ReconstructionRequest& request, const DepthSource& source,
              std::vector<PosedFrame> frames)
      : dataset_(dataset),
        source_(source),
        wants_colour_(request.cloud || request.mesh || request.report),
        frames_(std::move(frames)),
        progress_("dense", frames_.size(), request.quiet ? nullptr : internal::StandardError()) {}

  // Reads a few at a time, in parallel; integrates them one after the other.
  void Run(DenseMap* map, Reconstruction* result) {
    const auto threads = static_cast<std::size_t>(map->Options().threads);
    for (std::size_t first = 0; first < frames_.size() && !InterruptGuard::Requested(); first += threads) {
      const std::size_t count = std::min(threads, frames_.size() - first);
      std::vector<ReadFrame> read(count);
      RunParallel(static_cast<int>(count), map->Options().threads, [&](int i) {
        const auto at = static_cast<std::size_t>(i);
        read[at] = Read(frames_[first + at]);
      });
      for (std::size_t i = 0; i < count; ++i) Integrate(frames_[first + i], read[i], map);
      progress_.Update(first + count, std::to_string(std::lround(map->Report().memory_mb)) + " MB");
    }
    result->interrupted = InterruptGuard::Requested();
    result->dense = map->Report();
    result->dense.skipped += unread_;
    if (!apart_.empty()) result->warnings.push_back(ApartWarning(result->dense.apart_m));
    result->frames = frames_.size();
  }

 private:
  std::string ApartWarning(double most_m) const {
    constexpr std::size_t kNamed = 5;
    std::string where;
    std::size_t ranges = 0;
    for (std::size_t i = 0; i < apart_.size(); ++ranges) {
      const std::size_t first = i;
      for (++i; i < apart_.size() && apart_[i] <= apart_[i - 1] + kSameStretch;) ++i;
      if (ranges >= kNamed) continue;
      where += (ranges > 0 ? ", " : "") + std::to_string(apart_[first]);
      if (i > first + 1) where += " to " + std::to_string(apart_[i - 1]);
    }
    if (ranges > kNamed) where += ", and in " + std::to_string(ranges - kNamed) + " more places";
    return "depth and poses disagree in " + Count(apart_.size(), "frame") + " (" + where +
           "): their depth lies up to " + Metres(most_m) +
           " from the surface that frames before had measured. Poses slid there, things moved, or depth and "
           "image have different clocks (camera.depth_delay_s)";
  }

  ReadFrame Read(const PosedFrame& frame) const {
    ReadFrame read;
    read.depth = source_.Read(frame);
    if (read.depth.error.empty() && wants_colour_) read.colour = dataset_.ReadColour(frame.place);
    return read;
  }

  void Integrate(const PosedFrame& frame, const ReadFrame& read, DenseMap* map) {
    const std::size_t apart = map->Report().apart;
    std::string problem = read.depth.error;
    if (problem.empty()) problem = read.colour.error;
    if (!problem.empty())
      ++unread_;
    else
      problem = map->Integrate(read.depth.depth_m, read.colour.image, frame.PoseLater(read.depth.later_s),
                               dataset_.Rig().camera);
    if (map->Report().apart > apart) apart_.push_back(dataset_.Number(frame.place));
    if (!problem.empty())
      progress_.Note("tutti: frame " + std::to_string(dataset_.Number(frame.place)) + ": " + problem,
                     "frames are skipped");
  }

  const Dataset& dataset_;
  const DepthSource& source_;
  const bool wants_colour_;
  const std::vector<PosedFrame> frames_;
  Progress progress_;
  std::size_t unread_ = 0;
  std::vector<std::int64_t> apart_;  // numbers of frames that DenseReport::apart counts
};

// A report that can't be written is no reason to leave out what was asked for.
void ExtendReport(const fs::path& folder, const TriangleMesh& mesh, Reconstruction* result) {
  try {
    if (ShowInReport(folder, mesh))
      result->files.push_back({folder / "report.html", "its tab 3D shows the surface", "a browser"});
  } catch (const InputError& error) {
    result->warnings.push_back(std::string("the report does not show the surface: ") + error.what());
  }
}

// What is asked for, from what was integrated.
void WriteFiles(const DenseMap& map, const ReconstructionRequest& request, Reconstruction* result) {
  const TriangleMesh mesh = request.mesh || request.report ? map.Mesh() : TriangleMesh();
  if (request.mesh) {
    WritePly(*request.mesh, mesh);
    result->files.push_back({*request.mesh,
                             Count(mesh.triangles.size(), "triangle") + ", " +
                                 std::to_string(mesh.vertices.points.size()) +
                                 " vertices with colours and normals",
                             "MeshLab, CloudCompare, Blender; Open3D: read_triangle_mesh"});
  }
  if (request.cloud) {
    const PointCloud cloud = map.Cloud();
    WritePly(*request.cloud, cloud);
    result->files.push_back({*request.cloud,
                             Count(cloud.points.size(), "point") + " with colours and normals",
                             "CloudCompare, MeshLab; Open3D: read_point_cloud"});
  }
  if (request.report) ExtendReport(*request.report, mesh, result);
  if (!request.grid && !request.octomap && !request.esdf) return;
  const OccupiedSpace space = map.Space();
  if (!space.ground_found)
    result->warnings.emplace_back(
        "no level ground was seen below the camera: heights are from the lowest surface, up is where the "
        "images' tops are");
  if (request.grid) {
    const OccupancyGrid grid = GridOf(space, request.low_m, request.robot_height_m);
    WriteGrid(*request.grid, grid);
    result->files.push_back({*request.grid / "map.yaml",
                             std::to_string(grid.cells.cols) + "x" + std::to_string(grid.cells.rows) +
                                 " cells of " + Metres(grid.cell_m) + ", obstacles from " +
                                 Metres(request.low_m) + " to " + Metres(request.robot_height_m) +
                                 " above the ground",
                             "ros2 run nav2_map_server map_server --ros-args -p yaml_filename:=" +
                                 (*request.grid / "map.yaml").string()});
  }
  const std::string cells =
      Count(space.occupied.size(), "occupied cell") + ", " + Count(space.free.size(), "free one");
  if (request.octomap) {
    WriteOctomap(*request.octomap, space);
    result->files.push_back({*request.octomap, cells, "octovis " + request.octomap->string()});
  }
  if (request.esdf) {
    WriteEsdf(*request.esdf, space);
    result->files.push_back({*request.esdf, "distances [m] of " + cells,
                             "vdb_print " + request.esdf->string() + "; Houdini, Blender"});
  }
}

}  // namespace

EnumWords<DenseFrames> WordsOf(DenseFrames) {
  return {{"all", DenseFrames::kAll}, {"keyframes", DenseFrames::kKeyframes}};
}

void CheckReconstruction(const ReconstructionRequest& request) {
  if (!request.cloud && !request.mesh && !request.grid && !request.octomap && !request.esdf)
    throw InputError("there is nothing to make; give --mesh, --cloud, --grid, --octomap or --esdf");
  if (const std::string problem = request.dense.Validate(); !problem.empty())
    throw InputError("dense: " + problem);
  if (!(request.low_m < request.robot_height_m))
    throw InputError("--robot-height must be above " + Metres(request.low_m));
  if (request.octomap) RequireOctomap();
  if (request.esdf) RequireOpenVdb();
  for (const auto& file : {request.cloud, request.mesh, request.octomap})
    if (file) internal::CheckWritable(*file, internal::Needs::kBytes);
  if (request.esdf) internal::CheckWritable(*request.esdf, internal::Needs::kFile);
  if (!request.grid) return;
  std::error_code error;
  fs::create_directories(*request.grid, error);
  if (error) throw InputError("--grid " + request.grid->string() + ": can't be made: " + error.message());
  for (const char* name : {"map.pgm", "map.yaml"})
    internal::CheckWritable(*request.grid / name, internal::Needs::kFile);
}

Reconstruction Reconstruct(const MapModel& model, const Dataset& dataset,
                           const ReconstructionRequest& request) {
  CheckReconstruction(request);
  if (dataset.FrameSupply() == Supply::kOnce)
    throw InputError(
        "the images of a camera come only once and are gone; record them, then run on the recording");
  RequireSameCamera(dataset.Rig().camera, model.camera);
  const std::unique_ptr<DepthSource> source = OpenDepth(dataset, model, request.depth);
  const bool keyframes_only = source->KeyframesOnly() || request.frames == DenseFrames::kKeyframes;
  std::vector<PosedFrame> frames = FramesOf(model, dataset, keyframes_only);
  Reconstruction result;
  if (!keyframes_only && frames.size() < dataset.Size())
    result.warnings.push_back(Count(dataset.Size() - frames.size(), "frame") +
                              " of the data set have no pose and are left out");
  DenseOptions options = request.dense;
  // The depth of a stereo camera is worth little far away: at 40 baselines a pixel of disparity is a tenth of
  // it and more.
  if (!request.depth && dataset.Rig().sensor == Sensor::kStereo && options.max_depth_m <= 0)
    options.max_depth_m = kMostBaselines * dataset.Rig().baseline_m;
  options.free_space = request.grid || request.octomap || request.esdf;
  if (!request.quiet)
    internal::Say("%zu frames, voxels of %s, at most %d MB for them (--memory)", frames.size(),
                  Metres(options.voxel_m).c_str(), options.memory_mb);
  DenseMap map(options);
  const InterruptGuard guard;
  Integration(dataset, request, *source, std::move(frames)).Run(&map, &result);
  if (result.dense.integrated == 0)
    throw InputError("no frame could be used" +
                     std::string(result.interrupted ? ": interrupted" : "; nothing was written"));
  if (result.dense.cut > 0)
    result.warnings.push_back("the memory of --memory was used up: something is left out of " +
                              Count(result.dense.cut, "frame") + "; give more, or larger voxels (--voxel)");
  WriteFiles(map, request, &result);
  return result;
}

}  // namespace tutti
