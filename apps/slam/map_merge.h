// How two maps become one.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apps/slam/loop_closer.h"
#include "apps/slam/session_list.h"
#include "tutti/core/camera.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/config.h"
#include "tutti/slam/map_file.h"

namespace tutti {

/// What of a map is merged. References stay valid as long as it is used.
struct MapToMerge {
  const CameraRig& rig;
  LoopCloser& loops;
  SessionList& sessions;
  Odometry& odometry;
};

/// True if the two can be merged in either order (the same configuration and camera), and `map` is the second
/// one then, by the time stamps. Both have an odometry.
bool ComesAfter(const MapInfo& map, const MapInfo& other);

/// Appends one map to another, and joins the two by loops between them. Nothing may be on its way in either.
class MapMerge {
 public:
  MapMerge(const RunConfig& config, const MapToMerge& map, const MapToMerge& other)
      : config_(config), map_(map), other_(other) {}

  /// The other one's keyframes, sessions and loops get new numbers and stand in the map, in submaps of their
  /// own. Throws InputError, and changes nothing, for a camera that does not fit.
  void Append();
  /// The places of each are shown to the detector of the other. Of the loops that are verified those join the
  /// two that ChooseJoiningLoops says, all at once; then what is still open is closed (MapConnection). False:
  /// none does, and `reason` says why. `frames`: number of frames of both.
  bool Join(std::int64_t frames, std::string* reason);
  /// The whole map moves, and nothing in it: the keyframes to these poses.
  static void MoveAll(const std::map<int, Similarity>& S_world_keyframe, LoopCloser* loops,
                      Odometry* odometry);

  /// A loop between two keyframes, as one of the detectors proposed it.
  struct Proposal {
    Loop loop;
    Verification verification;
    int candidate = -1, query = -1;
  };
  /// The places that the detector knows, in their order.
  static std::vector<LoopPlace> PlacesOf(LoopCloser* loops) { return loops->worker_->Detector().Places(); }
  /// What is proposed when the places of another map, which get frame numbers from this one on, are shown to
  /// the detector of `loops`, one after the other: all loops between the two, verified or not. None enters.
  /// `view`: of the keyframe that the frame with such a number is, null: it is none. Nothing may be on its
  /// way.
  static std::vector<Proposal> Compare(
      std::vector<LoopPlace> places, std::int64_t first_frame,
      const std::function<std::optional<KeyframeView>(std::int64_t frame)>& view, LoopCloser* loops);

  /// Loops between submaps: those join them that ChooseJoiningLoops says, all at once; the graph is being
  /// solved with them. Within one recording the camera must have been able to get from the one place to the
  /// other while it was lost (WhyImpossible), and two of the loops must have seen different things. Returns
  /// why no loop joins any; empty: some do.
  static std::string Close(const std::vector<Proposal>& proposed, const RunConfig& config,
                           std::int64_t frames, LoopCloser* loops, const Odometry& odometry);

 private:
  void AppendLoops();
  std::vector<Proposal> LoopsBetween();
  std::vector<Proposal> ProposedByMap();
  std::vector<Proposal> ProposedByOther();

  const RunConfig& config_;
  MapToMerge map_, other_;
  std::vector<LoopPlace> places_, others_;  // that the detectors knew before
  std::int64_t first_frame_ = 0;            // the number here of what is 0 in the other one
  int first_keyframe_ = 0, first_piece_ = 0;
};

}  // namespace tutti
