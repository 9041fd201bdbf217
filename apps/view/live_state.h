// The newest state of a run, between the thread that tracks and those that serve it.
#pragma once

#include <Eigen/Core>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "apps/run/run_observer.h"
#include "apps/view/live_view.h"

namespace tutti::view {

/// What each of the last frames shows of the map, newest first, for the tails of the features that the
/// odometry follows; copies share it.
using LiveTrail = std::deque<std::shared_ptr<const std::vector<SeenLandmark>>>;
constexpr std::size_t kTrailFrames = 11;  ///< the newest one and those that the tails are of

/// Puts the newest frame before the others; the oldest one falls out.
void ExtendTrail(std::vector<SeenLandmark> seen, LiveTrail* trail);

/// Pixels of one landmark, newest first: in the newest frame, then in those before that show it.
using LiveTrack = std::vector<cv::Point2f>;

/// Tracks of landmarks in the newest frame, at most `most`. Which ones depends on their ids, so that they
/// stay the same from frame to frame as far as possible.
std::vector<LiveTrack> TracksOf(const LiveTrail& trail, std::size_t most);

/// The last frame.
struct LiveFrame {
  std::uint64_t number = 0;  ///< grows with each; 0: none yet
  std::int64_t index = 0;
  double stamp_s = 0;
  cv::Mat image;
  std::string state, reason;
  int features = 0, inliers = 0;
  bool posed = false;
  Pose T_world_camera;
  LiveTrail trail;  ///< empty without a pose
};

/// A keyframe as the map has it now.
struct LivePlace {
  int id = -1;
  std::int64_t frame = 0;
  int piece = 0;
  std::size_t session = 0;  ///< the recording that it is of
  Pose T_world_camera;
};

/// An edge of the map, by input frames.
struct LiveLoop {
  std::int64_t query = 0, candidate = 0;
  bool accepted = false;
};

/// What a keyframe sees, in its camera's frame [m]: a correction moves it with the keyframe.
struct LivePoints {
  std::uint64_t number = 0;
  int keyframe = -1;
  std::vector<Eigen::Vector3f> points;   ///< some landmarks
  std::vector<Eigen::Vector3f> surface;  ///< thinned depth image; empty without depth
  std::vector<std::uint8_t> greys;       ///< of `surface`
};

/// Fills `surface` and `greys` from a depth image or a stereo pair, at most LiveState::kSurfacePerKeyframe.
void SeeSurface(const InputFrame& frame, const CameraRig& rig, LivePoints* points);

/// Where a frame was found in the map, or, where frames are only located, where it is.
struct LiveSpot {
  enum class Kind { kLocated, kBeyond, kRecognised, kJoined };
  std::uint64_t number = 0;
  Kind kind = Kind::kLocated;
  std::int64_t frame = 0;
  int keyframe = -1;  ///< `position` is in its camera's frame; -1: in the world's
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< [m]
};

/// One answer of the detector, or a line of the log.
struct LiveEvent {
  std::uint64_t number = 0;
  std::string text;                                      ///< a line; empty: none
  std::int64_t query = -1;                               ///< -1: no answer
  std::vector<std::pair<std::string, double>> opinions;  ///< member (then "ensemble") and its hypothesis
};

/// A copy of everything that is newer than a viewer's last one.
struct LiveNews {
  LiveFrame frame;
  std::shared_ptr<const std::vector<LivePlace>> places;  ///< never null
  std::shared_ptr<const std::vector<LiveLoop>> loops;    ///< never null
  std::vector<LivePoints> points;
  std::vector<LiveSpot> spots;
  std::vector<LiveEvent> events;
  std::size_t sessions = 1;   ///< recordings of the map, the run's own among them
  bool only_located = false;  ///< the frames do not become part of the map
  std::uint64_t version = 0;
  std::size_t total = 0;  ///< frames of the run; 0: nobody knows how many
  bool paused = false;    ///< somebody asked for a pause; a frame that was begun is still computed
  bool standing = false;  ///< the run stands still: it waits for the end of the pause, or for a step
  bool finished = false;
};

/// What a viewer has by now.
struct LiveCursor {
  std::uint64_t version = 0, points = 0, spots = 0, events = 0;
};

/// What is left of a run for those who look, by the thread that tracks. Thread-safe. Bounded: old events,
/// points and spots fall out. Locks are held for copies of pointers alone.
class LiveState : public RunObserver {
 public:
  static constexpr std::size_t kMostEvents = 400;
  static constexpr std::size_t kMostPoints = 1500;  ///< keyframes with points
  static constexpr std::size_t kPointsPerKeyframe = 40;
  static constexpr std::size_t kSurfacePerKeyframe = 600;
  static constexpr std::size_t kMostSpots = 5000;

  explicit LiveState(LiveViewOptions options = {}) : options_(std::move(options)) {}

  // ---- the run's side
  void OnRestart() override;
  void OnStart(const CameraRig& rig, std::size_t frames) override;
  void OnFrame(const InputFrame& frame, const TrackResult& track, const RunState& state) override;
  void OnKeyframe(const InputFrame& frame, int keyframe, const RunState& state) override;
  void OnDetection(const LoopResult& result) override;
  void OnEnd(const RunState&) override { Finish(); }
  void Log(const std::string& text);
  void Finish();
  /// Returns when the run may go on: it is not paused, a step was asked for, nobody has looked for
  /// `abandoned_s` (then it is no longer paused), or the run is interrupted.
  void WaitWhilePaused(double abandoned_s);

  // ---- the server's side
  void AddViewer(int change);
  int Viewers() const;
  void Pause(bool paused);
  void Step();
  /// News after `cursor`, which moves on; false if there is none within the time, or by when the state was
  /// closed: that the run is done is still said.
  bool WaitForNews(LiveCursor* cursor, double seconds, LiveNews* news);
  /// Wakes all that wait.
  void Close();
  bool Closed() const;

 private:
  void Changed();                  // with mutex_ held
  void AddEvent(LiveEvent event);  // with mutex_ held
  void AddPoints(LivePoints points, const Odometry& odometry);
  // The map that the run began with.
  void SetMap(const RunState& state);
  void AddSpot(const LiveFrame& frame, const RunState& state);

  LiveViewOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  LiveNews now_;
  std::deque<LivePoints> points_;
  std::deque<LiveSpot> spots_;
  std::deque<LiveEvent> events_;
  std::uint64_t next_points_ = 1, next_spot_ = 1, next_event_ = 1;
  int viewers_ = 0;
  int steps_ = 0;
  bool closed_ = false;
  double last_viewer_s_ = 0;
  // What follows belongs to the tracking thread alone.
  CameraRig rig_;
  bool begun_ = false, joined_ = false;
  std::size_t loops_seen_ = 0, accepted_seen_ = 0;
  int corrections_seen_ = 0;
  std::string state_seen_;
  LiveTrail trail_;
  bool new_keyframe_ = false;
};

}  // namespace tutti::view
