// tutti.SlamSystem
#include "tutti/slam/slam_system.h"
#include "tutti/slam/localizer.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/python/pickled.h"

namespace tutti::python {
namespace {

namespace fs = std::filesystem;

// A SLAM system, and who locates frames in its map once that was asked for.
class System {
 public:
  explicit System(std::unique_ptr<SlamSystem> slam) : slam_(std::move(slam)) {}

  TrackResult Track(const InputFrame& frame) {
    return localizer_ ? localizer_->Track(frame) : slam_->Track(frame);
  }
  void Finish() {
    if (!localizer_) slam_->Finish();
  }
  void BeginLocalization() { localizer_.emplace(*slam_); }
  void BeginSession(const CameraRig& rig) {
    CheckMaps();
    slam_->BeginSession(rig);
  }
  std::size_t Prune() {
    CheckMaps();
    return slam_->Prune();
  }
  void Save(const fs::path& file) const { slam_->Snapshot().Write(file); }
  const Odometry* odometry() const { return localizer_ ? &localizer_->odometry() : slam_->odometry(); }
  bool AppearanceOnly() const { return odometry() == nullptr; }
  const std::vector<Loop>& loops() const { return slam_->loops(); }
  PoseGraph Graph() const { return slam_->Graph(); }
  int Corrections() const { return slam_->Report().corrections; }
  std::size_t Relocalized() const {
    return localizer_ ? localizer_->Relocalized() : slam_->Report().relocalized;
  }
  std::vector<std::string> TakeWarnings() { return slam_->TakeWarnings(); }
  std::map<std::string, double> StageMilliseconds() const { return tutti::StageMilliseconds(*slam_); }

 private:
  void CheckMaps() const {
    if (localizer_) throw InputError("frames are being located in the map: it must stay as it is");
  }

  std::unique_ptr<SlamSystem> slam_;
  std::optional<Localizer> localizer_;
};
using Slam = Guarded<System>;

std::unique_ptr<Slam> MakeSlam(const CameraRig& rig, const std::optional<RunConfig>& config,
                               const py::kwargs& sections) {
  RunConfig all = config.value_or(RunConfig());
  SetOptions("SlamSystem", "", sections, all);
  const py::gil_scoped_release release;
  return std::make_unique<Slam>(System(std::make_unique<SlamSystem>(all, rig)));
}

std::unique_ptr<Slam> LoadSlam(const fs::path& file, std::optional<int> threads) {
  const auto load = [&] {
    const py::gil_scoped_release release;
    MapInfo info = ReadMapInfo(file);
    if (threads) info.config.run.threads = *threads;
    const std::string problem = info.config.run.Validate();
    if (!problem.empty()) throw InputError(problem);
    return std::make_unique<Slam>(System(LoadMap(file, info)));
  };
  return Reading(file, load);
}

// With the odometry, which a rig without calibration has none of.
template <class Work>
auto WithOdometry(Slam& slam, Work work) {
  return slam.Run([&](System& s) {
    if (s.AppearanceOnly()) throw InputError("the rig has no calibration: there are loops but no poses");
    return work(*s.odometry());
  });
}

py::array_t<double> KeyframeTrajectory(Slam& slam) {
  return ArrayOf(WithOdometry(slam, [](const Odometry& odometry) {
    Trajectory trajectory;
    for (const int id : odometry.map().KeyframeIds())
      trajectory.push_back({odometry.map().keyframe(id).stamp_s, odometry.map().keyframe(id).T_world_camera});
    return trajectory;
  }));
}

KeyframeView Keyframe(Slam& slam, int id) {
  return WithOdometry(slam, [id](const Odometry& odometry) {
    const std::vector<int> ids = odometry.map().KeyframeIds();
    if (!std::binary_search(ids.begin(), ids.end(), id))
      throw py::index_error("there is no keyframe " + std::to_string(id));
    return ViewOf(odometry.map(), id);
  });
}

py::array_t<double> PointsOf(const std::vector<Eigen::Vector3d>& points) {
  py::array_t<double> array({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}});
  double* row = array.mutable_data();
  for (const Eigen::Vector3d& point : points) row = std::copy_n(point.data(), 3, row);
  return array;
}

py::array_t<double> Landmarks(Slam& slam) {
  return PointsOf(WithOdometry(slam, [](const Odometry& odometry) {
    std::vector<Eigen::Vector3d> points;
    for (const int id : odometry.map().LandmarkIds()) points.push_back(odometry.map().landmark(id).position);
    return points;
  }));
}

py::object OptionalPose(const TrackResult& result) {
  if (result.state != TrackingState::kTracking) return py::none();
  return ArrayOf(result.T_world_camera);
}

void BindResults(py::module_& module) {
  py::class_<TrackResult>(module, "TrackResult", doc::TrackResult)
      .def(Pickled<TrackResult>())
      .def_property_readonly(
          "state", [](const TrackResult& result) { return ToString(result.state); },
          "initializing, tracking or lost")
      .def_readonly("reason", &TrackResult::reason, doc::TrackResult_reason)
      .def_property_readonly("T_world_camera", &OptionalPose,
                             "(4, 4) float64; None if the frame has no pose. What it was then: trajectory() "
                             "has what loops made of it.")
      .def_readonly("features", &TrackResult::features, doc::TrackResult_features)
      .def_readonly("inliers", &TrackResult::inliers, doc::TrackResult_inliers)
      .def_readonly("keyframe", &TrackResult::keyframe, "id of the keyframe that this frame became, or -1")
      .def("__repr__", [](const TrackResult& result) {
        return py::str("TrackResult(state='{}', inliers={}, keyframe={}, reason='{}')")
            .format(ToString(result.state), result.inliers, result.keyframe, result.reason);
      });
  py::class_<Loop>(module, "LoopRecord", doc::Loop)
      .def(Pickled<Loop>())
      .def_readonly("query", &Loop::query, doc::Loop_query)
      .def_readonly("candidate", &Loop::candidate, "0-based index of the input frame")
      .def_readonly("query_stamp", &Loop::query_stamp_s, "[s]")
      .def_readonly("candidate_stamp", &Loop::candidate_stamp_s, "[s]")
      .def_readonly("members", &Loop::members, "what each member of the ensemble believed")
      .def_readonly("hypothesis", &Loop::hypothesis, doc::Loop_hypothesis)
      .def_readonly("posterior", &Loop::posterior, doc::Loop_posterior)
      .def_readonly("probability", &Loop::probability, doc::Loop_probability)
      .def_readonly("matches", &Loop::matches, "that were considered")
      .def_readonly("inliers", &Loop::inliers, "of these, those that fit one camera motion")
      .def_readonly("verified", &Loop::verified, doc::Loop_verified)
      .def_property_readonly("accepted", &Loop::accepted, doc::Loop_accepted)
      .def_readonly("weight", &Loop::weight, doc::Loop_weight)
      .def_readonly("revoked", &Loop::revoked, doc::Loop_revoked)
      .def_property_readonly(
          "pending", [](const Loop& loop) { return loop.state == LoopState::kWaiting; },
          "waits for a second loop that agrees")
      .def_readonly("reason", &Loop::reason, doc::Loop_reason)
      .def_property_readonly(
          "S_candidate_query",
          [](const Loop& loop) -> py::object {
            if (!loop.S_candidate_query) return py::none();
            return ArrayOf(*loop.S_candidate_query);
          },
          "(4, 4): maps points of the query camera into the candidate's; None if it could not be computed.")
      .def("__repr__", [](const Loop& loop) {
        return py::str("LoopRecord(query={}, candidate={}, accepted={}, probability={:.4g}, reason='{}')")
            .format(loop.query, loop.candidate, loop.accepted(), loop.probability, loop.reason);
      });
}

void BindKeyframe(py::module_& module) {
  py::class_<KeyframeView>(module, "Keyframe", doc::KeyframeView)
      .def_readonly("id", &KeyframeView::id, doc::KeyframeView_id)
      .def_readonly("frame_index", &KeyframeView::frame_index, doc::KeyframeView_frame_index)
      .def_readonly("stamp", &KeyframeView::stamp_s, "[s]")
      .def_readonly("map_piece", &KeyframeView::map_piece, doc::KeyframeView_map_piece)
      .def_property_readonly(
          "T_world_camera", [](const KeyframeView& view) { return ArrayOf(view.T_world_camera); },
          "(4, 4) float64")
      .def_property_readonly(
          "pixels",
          [](const KeyframeView& view) {
            py::array_t<float> array({static_cast<py::ssize_t>(view.keypoints.size()), py::ssize_t{2}});
            float* row = array.mutable_data();
            for (const cv::KeyPoint& keypoint : view.keypoints)
              *row++ = keypoint.pt.x, *row++ = keypoint.pt.y;
            return array;
          },
          "(N, 2) float32: x, y of the features [px]")
      .def_property_readonly(
          "descriptors", [](const KeyframeView& view) { return ArrayOfImage(view.descriptors); },
          "(N, 32) uint8: ORB")
      .def_property_readonly(
          "points", [](const KeyframeView& view) { return PointsOf(view.points); },
          (std::string("(N, 3) float64: ") + doc::KeyframeView_points).c_str())
      .def_property_readonly(
          "landmarks",
          [](const KeyframeView& view) {
            return py::array_t<int>(static_cast<py::ssize_t>(view.landmarks.size()), view.landmarks.data());
          },
          (std::string("(N,) int32: ") + doc::KeyframeView_landmarks).c_str());
}

}  // namespace

void BindSlamSystem(py::module_& module) {
  using namespace pybind11::literals;  // NOLINT(google-build-using-namespace)
  BindResults(module);
  BindKeyframe(module);
  const std::string text = std::string(doc::SlamSystem) +
                           "\n\nSlamSystem(dataset.rig, config, run={\"threads\": 1}): sections of the "
                           "configuration are keywords, as in Config.";
  py::class_<Slam>(module, "SlamSystem", text.c_str())
      .def(py::init(&MakeSlam), "rig"_a, "config"_a = py::none(),
           "Raises tutti.InputError if the configuration does not fit the rig.")
      .def_static("load", &LoadSlam, "file"_a, "threads"_a = py::none(),
                  "Goes on from a file that save wrote exactly as the saved one would have gone on, with so "
                  "many threads (None: as saved). Raises tutti.InputError for a file that is not usable.")
      .def("track", Locked(&System::Track), "frame"_a, doc::SlamSystem_Track)
      .def("finish", Locked(&System::Finish), doc::SlamSystem_Finish)
      .def(
          "save",
          [](Slam& slam, const fs::path& file) {
            Writing([&] { slam.Run([&](System& s) { s.Save(file); }); });
          },
          "file"_a, doc::SlamSystem_Snapshot)
      .def("begin_localization", Locked(&System::BeginLocalization), doc::Localizer)
      .def("begin_session", Locked(&System::BeginSession), "rig"_a, doc::SlamSystem_BeginSession)
      .def("prune", Locked(&System::Prune), doc::SlamSystem_Prune)
      .def(
          "trajectory",
          [](Slam& slam, int piece) {
            return ArrayOf(
                WithOdometry(slam, [&](const Odometry& o) { return FrameTrajectory(o.map(), piece); }));
          },
          "piece"_a = -1,
          (std::string("(N, 8): stamp [s], x, y, z [m], qx, qy, qz, qw. ") + doc::FrameTrajectory).c_str())
      .def("keyframe_trajectory", &KeyframeTrajectory,
           "(N, 8), as trajectory: of all keyframes, in the order of keyframe_ids.")
      .def("keyframe", &Keyframe, "id"_a, doc::ViewOf)
      .def_property_readonly(
          "keyframe_ids",
          [](Slam& slam) {
            return WithOdometry(slam, [](const Odometry& o) { return o.map().KeyframeIds(); });
          },
          doc::Map_KeyframeIds)
      .def("landmarks", &Landmarks, "(N, 3) float64: points of the map in the world [m], by id.")
      .def_property_readonly("loops", Locked(&System::loops), doc::SlamSystem_loops)
      .def(
          "graph",
          [](Slam& slam) { return std::make_unique<Guarded<PoseGraph>>(Locked(&System::Graph)(slam)); },
          doc::SlamSystem_Graph)
      .def_property_readonly("appearance_only", Locked(&System::AppearanceOnly), doc::SlamSystem_odometry)
      .def_property_readonly("corrections", Locked(&System::Corrections), doc::SlamReport_corrections)
      .def_property_readonly("relocalized", Locked(&System::Relocalized), doc::SlamReport_relocalized)
      .def("take_warnings", Locked(&System::TakeWarnings), doc::SlamSystem_TakeWarnings)
      .def_property_readonly("stage_ms", Locked(&System::StageMilliseconds), doc::StageMilliseconds);
}

}  // namespace tutti::python
