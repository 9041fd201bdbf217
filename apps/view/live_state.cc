#include "apps/view/live_state.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

#include "apps/run/interrupt.h"
#include "core/stopwatch.h"

namespace tutti::view {
namespace {

std::vector<LivePlace> PlacesOf(const RunState& state) {
  const Odometry& odometry = *state.odometry;
  std::vector<LivePlace> places;
  for (const int id : odometry.map().KeyframeIds()) {
    if (id >= state.end_of_map) break;
    const std::int64_t frame = odometry.map().keyframe(id).frame_index;
    places.push_back({id, frame, odometry.map().keyframe(id).piece, state.SessionOf(frame),
                      odometry.map().keyframe(id).T_world_camera});
  }
  return places;
}

std::vector<LiveLoop> LoopsOf(const RunState& state) {
  std::vector<LiveLoop> loops;
  for (const Loop& record : state.loops) {
    if (record.verified) loops.push_back({record.query, record.candidate, record.accepted()});
  }
  return loops;
}

std::string StateWord(const TrackResult& track, const RunState& state) {
  if (state.odometry == nullptr) return "appearance only";
  if (!state.OnlyLocated() || track.state != TrackingState::kTracking) return ToString(track.state);
  return state.odometry->LastView().beyond_map ? "beyond the map" : "localized";
}

// The recording has become part of the map that was there before it.
bool InEarlierMap(const RunState& state) {
  const int keyframe = state.odometry->LastView().keyframe;
  return !state.OnlyLocated() && keyframe >= 0 &&
         state.odometry->map().keyframe(keyframe).piece < state.odometry->LastView().session_piece;
}

std::vector<Eigen::Vector3f> SomePoints(const KeyframeView& view) {
  std::vector<Eigen::Vector3f> all;
  for (const Eigen::Vector3d& point : view.points) {
    if (point.allFinite()) all.push_back(point.cast<float>());
  }
  std::vector<Eigen::Vector3f> some;
  const std::size_t count = std::min(all.size(), LiveState::kPointsPerKeyframe);
  for (std::size_t k = 0; k < count; ++k) some.push_back(all[k * all.size() / count]);
  return some;
}

}  // namespace

void LiveState::Changed() {
  ++now_.version;
  changed_.notify_all();
}

void LiveState::AddEvent(LiveEvent event) {
  event.number = next_event_++;
  events_.push_back(std::move(event));
  if (events_.size() > kMostEvents) events_.pop_front();
}

void LiveState::OnRestart() {
  Log("the run begins anew with what it found out of its camera");
  begun_ = joined_ = new_keyframe_ = false;
  loops_seen_ = accepted_seen_ = 0;
  corrections_seen_ = 0;
  state_seen_.clear();
  trail_.clear();
  const std::lock_guard<std::mutex> lock(mutex_);
  points_.clear();
  spots_.clear();
  now_.places = std::make_shared<const std::vector<LivePlace>>();
  now_.loops = std::make_shared<const std::vector<LiveLoop>>();
}

void LiveState::OnStart(const CameraRig& rig, std::size_t frames) {
  rig_ = rig;
  const double end = internal::SteadySeconds() + options_.idle_s;
  std::unique_lock<std::mutex> lock(mutex_);
  now_.total = frames;
  while (viewers_ == 0 && internal::SteadySeconds() < end && !InterruptGuard::Requested())
    changed_.wait_for(lock, std::chrono::milliseconds(50));
}

void ExtendTrail(std::vector<SeenLandmark> seen, LiveTrail* trail) {
  trail->push_front(std::make_shared<const std::vector<SeenLandmark>>(std::move(seen)));
  if (trail->size() > kTrailFrames) trail->pop_back();
}

void LiveState::OnFrame(const InputFrame& frame, const TrackResult& track, const RunState& state) {
  LiveFrame next;
  next.index = frame.index;
  next.stamp_s = frame.stamp_s;
  next.image = frame.image;
  next.state = StateWord(track, state);
  next.reason = track.reason;
  next.features = track.features;
  next.inliers = track.inliers;
  next.posed = state.odometry != nullptr && track.state == TrackingState::kTracking;
  next.T_world_camera = track.T_world_camera;
  std::shared_ptr<const std::vector<LivePlace>> places;
  std::shared_ptr<const std::vector<LiveLoop>> loops;
  const std::size_t accepted = CountAccepted(state.loops);
  const bool corrected = state.corrections != corrections_seen_;
  if (!begun_ && state.odometry != nullptr) SetMap(state);
  if (state.odometry != nullptr && (new_keyframe_ || corrected || !begun_))
    places = std::make_shared<const std::vector<LivePlace>>(PlacesOf(state));
  begun_ = true;
  if (state.loops.size() != loops_seen_ || accepted != accepted_seen_)
    loops = std::make_shared<const std::vector<LiveLoop>>(LoopsOf(state));
  if (next.posed) {
    ExtendTrail(state.odometry->LastView().landmarks, &trail_);
  } else {
    trail_.clear();
  }
  next.trail = trail_;
  if (next.posed) AddSpot(next, state);
  if (corrected) Log("frame " + std::to_string(frame.index) + ": the loops moved the map");
  if (next.state != state_seen_)
    Log("frame " + std::to_string(frame.index) + ": " + next.state +
        (next.reason.empty() ? "" : ": " + next.reason));
  loops_seen_ = state.loops.size();
  accepted_seen_ = accepted;
  corrections_seen_ = state.corrections;
  new_keyframe_ = false;
  state_seen_ = next.state;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    next.number = now_.frame.number + 1;
    now_.frame = std::move(next);
    if (places) now_.places = places;
    if (loops) now_.loops = loops;
    Changed();
  }
  WaitWhilePaused(options_.abandoned_s);
}

void LiveState::SetMap(const RunState& state) {
  const std::vector<int> ids = state.odometry->map().KeyframeIds();
  const std::size_t step = ids.size() / kMostPoints + 1;
  for (std::size_t k = 0; k < ids.size(); k += step) AddPoints({0, ids[k], {}, {}, {}}, *state.odometry);
  joined_ = InEarlierMap(state);  // of a run that was resumed
  const std::lock_guard<std::mutex> lock(mutex_);
  now_.sessions = state.sessions.size();
  now_.only_located = state.OnlyLocated();
}

// The map moves when loops correct it, so a spot moves with the keyframe that the frame hangs on.
void LiveState::AddSpot(const LiveFrame& frame, const RunState& state) {
  const int keyframe = state.odometry->LastView().keyframe;
  const bool known = keyframe >= 0 && keyframe < state.end_of_map;
  const bool joins = !joined_ && InEarlierMap(state);
  joined_ = joined_ || joins;
  LiveSpot spot;
  if (state.recognised) {
    spot.kind = LiveSpot::Kind::kRecognised;
  } else if (joins) {
    spot.kind = LiveSpot::Kind::kJoined;
  } else if (!state.OnlyLocated()) {
    return;
  } else if (state.odometry->LastView().beyond_map) {
    spot.kind = LiveSpot::Kind::kBeyond;
  }
  spot.frame = frame.index;
  spot.position = frame.T_world_camera.translation;
  if (known) {
    spot.keyframe = keyframe;
    spot.position = state.odometry->map().keyframe(keyframe).T_world_camera.Inverse() * spot.position;
  }
  if (state.recognised || joins)
    Log("frame " + std::to_string(frame.index) +
        (state.recognised ? ": recognised" : ": a loop joined the recording with the map") +
        (known ? ", beside keyframe " + std::to_string(keyframe) : ""));
  const std::lock_guard<std::mutex> lock(mutex_);
  spot.number = next_spot_++;
  spots_.push_back(spot);
  if (spots_.size() > kMostSpots) spots_.pop_front();
}

void LiveState::OnKeyframe(const InputFrame& frame, int keyframe, const RunState& state) {
  new_keyframe_ = true;
  LivePoints points;
  points.keyframe = keyframe;
  SeeSurface(frame, rig_, &points);
  AddPoints(std::move(points), *state.odometry);
}

void LiveState::AddPoints(LivePoints points, const Odometry& odometry) {
  points.points = SomePoints(ViewOf(odometry.map(), points.keyframe));
  const std::lock_guard<std::mutex> lock(mutex_);
  points.number = next_points_++;
  points_.push_back(std::move(points));
  if (points_.size() > kMostPoints) points_.pop_front();
}

void LiveState::OnDetection(const LoopResult& result) {
  LiveEvent event;
  event.query = result.query;
  for (const MemberOpinion& member : result.members)
    event.opinions.emplace_back(member.name, member.took_part ? member.hypothesis : std::nan(""));
  event.opinions.emplace_back("ensemble", result.hypothesis);
  if (result.proposed) {
    const std::string place = std::to_string(result.candidate);
    char text[120];
    std::snprintf(text, sizeof text, "frame %ld: H = %.3f, probability %.3f, ",
                  static_cast<long>(result.query), result.hypothesis, result.probability);
    event.text =
        text + (result.accepted ? "verified as the place of frame " + place + ", " +
                                      std::to_string(result.verification.inliers) + " inliers"
                                : "not frame " + place + ": " +
                                      (result.reason.empty() ? result.verification.reason : result.reason));
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  AddEvent(std::move(event));
  Changed();
}

void LiveState::Log(const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  AddEvent({0, text, -1, {}});
  Changed();
}

void LiveState::Finish() {
  Log("the run is done");
  const std::lock_guard<std::mutex> lock(mutex_);
  now_.finished = true;
  now_.paused = false;
  Changed();
}

void LiveState::WaitWhilePaused(double abandoned_s) {
  std::unique_lock<std::mutex> lock(mutex_);
  while (now_.paused && steps_ == 0 && !closed_ && !InterruptGuard::Requested()) {
    if (viewers_ == 0 && internal::SteadySeconds() - last_viewer_s_ > abandoned_s) {
      now_.paused = false;
      AddEvent({0, "nobody looks any more: the run goes on", -1, {}});
      Changed();
      break;
    }
    if (!now_.standing) {
      now_.standing = true;
      Changed();
    }
    changed_.wait_for(lock, std::chrono::milliseconds(50));
  }
  now_.standing = false;
  if (steps_ > 0) --steps_;
}

void LiveState::AddViewer(int change) {
  const std::lock_guard<std::mutex> lock(mutex_);
  viewers_ += change;
  last_viewer_s_ = internal::SteadySeconds();
  changed_.notify_all();
}

int LiveState::Viewers() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return viewers_;
}

void LiveState::Pause(bool paused) {
  const std::lock_guard<std::mutex> lock(mutex_);
  now_.paused = paused && !now_.finished;
  steps_ = 0;
  last_viewer_s_ = internal::SteadySeconds();
  Changed();
}

void LiveState::Step() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (now_.paused) ++steps_;
  last_viewer_s_ = internal::SteadySeconds();
  changed_.notify_all();
}

bool LiveState::WaitForNews(LiveCursor* cursor, double seconds, LiveNews* news) {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait_for(lock, std::chrono::duration<double>(seconds),
                    [&] { return closed_ || now_.version > cursor->version; });
  if (now_.version <= cursor->version) return false;
  *news = now_;
  if (!news->places) news->places = std::make_shared<const std::vector<LivePlace>>();
  if (!news->loops) news->loops = std::make_shared<const std::vector<LiveLoop>>();
  for (const LivePoints& points : points_) {
    if (points.number > cursor->points) news->points.push_back(points);
  }
  for (const LiveSpot& spot : spots_) {
    if (spot.number > cursor->spots) news->spots.push_back(spot);
  }
  for (const LiveEvent& event : events_) {
    if (event.number > cursor->events) news->events.push_back(event);
  }
  cursor->version = now_.version;
  cursor->points = next_points_ - 1;
  cursor->spots = next_spot_ - 1;
  cursor->events = next_event_ - 1;
  return true;
}

void LiveState::Close() {
  const std::lock_guard<std::mutex> lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

bool LiveState::Closed() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return closed_;
}

}  // namespace tutti::view
