// Visual SLAM in one class: odometry, ensemble loop closure, pose graph.
//
//   SlamSystem slam(config, dataset->Rig());
//   for (each frame) slam.Track(frame);
//   slam.Finish();
//   FrameTrajectory(slam.odometry()->map());
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tutti/backend/keyframe_graph.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/core/span_recorder.h"
#include "tutti/frontend/odometry.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/slam/config.h"
#include "tutti/slam/loop.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_report.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Whom a SlamSystem tells, from Track(), Follow() and Finish(); each may be empty.
struct SlamListeners {
  /// Each answer of the loop detector, before it enters.
  std::function<void(const LoopResult&)> on_detection;
  /// Each keyframe and its frame when all its landmarks are known, which is when the detector gets it.
  std::function<void(const InputFrame&, int)> on_keyframe;
  /// Before loops, or a lost frame whose place the detector knew, change the odometry: what it would do alone
  /// goes on from here (a copy of it). `last`: index of the last frame that it has seen, -1 for none.
  std::function<void(const Odometry&, std::int64_t last)> on_change;
};

/// The pipeline. The odometry runs on the caller's thread, the loop detector and the pose graph beside it;
/// what they find enters the map a fixed number of frames after it was asked for (run.loop_delay_frames; the
/// pose graph: by the size of the map), so the result does not depend on the number of threads or on the
/// machine's load. Without calibration only the detector runs (appearance only).
class SlamSystem {
 public:
  /// Throws InputError if the configuration does not fit the rig. `recorder` gets the time of each stage; it
  /// must outlive this object; null: nothing is recorded.
  SlamSystem(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder = nullptr);
  ~SlamSystem();
  SlamSystem(const SlamSystem&) = delete;
  SlamSystem& operator=(const SlamSystem&) = delete;

  void SetListeners(SlamListeners listeners);

  /// Another recording begins, in the map that is there: its frames, taken by this rig, come next. They start
  /// a submap of their own, which joins the map when a loop connects the two; or they go on in the map at
  /// once, if one of the first of them is recognised. The map's frame of reference stays. InputFrame::index
  /// and time stamps of the recording may begin anew: in loop records and keyframes, frames have numbers that
  /// are unique in the map (MapSession::frame_offset). Another camera is allowed if its sensor is of the same
  /// kind (WithRig). Brings in first all that is on its way (Finish); counts of corrections,
  /// relocalised frames and milliseconds begin anew. Throws InputError, and changes nothing, if there is no
  /// map, no detector that knows it, or for a rig that does not fit.
  void BeginSession(const CameraRig& rig);
  /// The recordings so far, oldest first; there is always one, and the last one goes on.
  std::vector<MapSession> Sessions() const;

  /// Tracks the next frame and brings in what is due. Never throws for hard images; throws InputError for
  /// those of another type or size than InputFrame and the rig say, and nothing has changed then.
  TrackResult Track(const InputFrame& frame);
  /// The next frame of another odometry and its pose in that one's world (Odometry::Follow), instead of
  /// Track: loops are found and closed as ever, and the odometry stays as it is between them. Without
  /// calibration as Track. `sigma`: how uncertain the motion since the last call is; without it the
  /// configuration says. Throws InputError for a pose that is not finite and a sigma below 0 or not finite.
  TrackResult Follow(const InputFrame& frame, const Pose& T_odom_camera,
                     const std::optional<MotionSigma>& sigma = {});
  /// A loop that somebody else knows (a marker, a survey, a test) between two keyframes, the older one first:
  /// S_candidate_query maps points of the query camera into the candidate's, `information` is of
  /// (translation, rotation, log scale). It goes past detector and gate into the pose graph, which may refuse
  /// it. Throws InputError without an odometry and for keyframes that are not there.
  void AddLoop(int candidate, int query, const Similarity& S_candidate_query, const Matrix7d& information);
  /// After the last frame: brings in all that is on its way. May be called again after AddLoop.
  void Finish();

  /// Removes keyframes that the map can do without, after Finish(): at least 85 % of their landmarks are seen
  /// by three others, or from an earlier visit. Their frames, the pose graph's edges and the detector's
  /// places go over to keyframes that stay; records of loops stay as they are. The map is as good for going
  /// on and for a Localizer. Returns how many went. Throws InputError without an odometry.
  std::size_t Prune();

  /// What went wrong without stopping it (the long-term memory's disk is full) since the last call.
  std::vector<std::string> TakeWarnings();

  /// The odometry and its map, with all corrections; nullptr without calibration: there are loops but no
  /// poses.
  const Odometry* odometry() const;
  /// Every proposed loop in the order of the queries.
  const std::vector<Loop>& loops() const;
  /// Keyframes, odometry edges and accepted loops at the present poses.
  PoseGraph Graph() const;
  SlamReport Report() const;
  /// All that it knows as it is now, between two frames: Snapshot().Write(file) saves it, and LoadMap goes on
  /// from there. Costs little more than a look at each loop and keyframe: the tracking goes on while somebody
  /// else writes it. `note`: for MapInfo.
  MapSnapshot Snapshot(const std::string& note = "") const;

 private:
  class Impl;
  friend class Localizer;
  friend bool Merge(SlamSystem* map, SlamSystem* other, std::string* reason);
  friend std::unique_ptr<SlamSystem> LoadMap(const std::filesystem::path& file, const MapInfo& info,
                                             SpanRecorder* recorder,
                                             const std::function<void(internal::SectionReader&)>& more);
  explicit SlamSystem(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Milliseconds spent, summed, by stage: SlamReport::stage_ms, and the odometry's as "odometry_...". The
/// detector's run beside the odometry's.
std::map<std::string, double> StageMilliseconds(const SlamSystem& slam);

/// Goes on from a file that Snapshot().Write wrote exactly as the saved one would have gone on, whose
/// listeners are to be set again. `info`: ReadMapInfo(file); its config.run.threads may be another. `more`
/// may read the caller's sections. Throws InputError for a file that is not usable.
std::unique_ptr<SlamSystem> LoadMap(const std::filesystem::path& file, const MapInfo& info,
                                    SpanRecorder* recorder = nullptr,
                                    const std::function<void(internal::SectionReader&)>& more = {});

/// Two maps become one, if they have places in common: the places of each are shown to the detector of the
/// other, one after the other; of the loops that are verified, the largest set that agrees joins the two, if
/// it clearly outnumbers the next one, and what shows the same becomes one. The frame of reference of `map`
/// stays. Which map is which decides nothing else if configuration and camera are the same: sessions, frames
/// and keyframes are numbered in the order of the maps' time stamps then. Otherwise those of `map` come
/// first. `other`: its detector must have the same members, its sensor must be of the same kind. Both bring
/// in first all that is on its way; `other` is of no use any more. True: they are one map now, which can be
/// saved, located in, and gone on with (BeginSession; no frame may be tracked before that). False: no places
/// in common were found that can be relied on, and `map` is of no use any more either; `reason`, which may be
/// null, says why in plain words. Throws InputError if they can't be compared, or one is the other or null.
/// Recorders must outlive both.
bool Merge(SlamSystem* map, SlamSystem* other, std::string* reason = nullptr);

}  // namespace tutti
#pragma GCC visibility pop
