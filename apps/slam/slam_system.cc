#include "tutti/slam/slam_system.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <optional>
#include <utility>

#include "apps/slam/loop_closing.h"
#include "apps/slam/map_merge.h"
#include "apps/slam/map_parts.h"
#include "apps/slam/map_reference.h"
#include "apps/slam/map_state.h"
#include "apps/slam/session_list.h"
#include "core/section_file.h"
#include "core/stopwatch.h"
#include "frontend/map/append.h"
#include "frontend/map/fuse.h"
#include "frontend/map/prune.h"
#include "frontend/odometry/frame_check.h"
#include "frontend/odometry/odometry_file.h"
#include "tutti/core/error.h"
#include "tutti/slam/version.h"

namespace tutti {

class SlamSystem::Impl {
 public:
  Impl(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder, bool resumes = false)
      : loops_(config, rig, recorder, resumes), config_(config), rig_(rig), recorder_(recorder) {
    if (!rig.calibrated) return;
    odometry_.emplace(config.odometry, rig, Execution{config.run.threads > 1, recorder});
  }

  TrackResult Track(const InputFrame& frame) {
    CheckFrame(frame, rig_);
    if (!localizing_) BringIn();
    ++frames_;
    sessions_.CountFrame();
    TrackResult result;
    if (!odometry_) {
      result.reason = "no calibration";
      if (loops_.Searching()) loops_.Submit(frame, nullptr, frames_);
      return result;
    }
    result = Note(odometry_->Track(frame));
    last_ = frame.index;
    sessions_.SetLastFrame(last_);
    InputFrame numbered = frame;
    numbered.index += sessions_.offset();
    if (result.state != TrackingState::kTracking) result = Relocalize(numbered, result);
    if (localizing_) return FindBack(numbered, result);
    if (odometry_) sessions_.NoteJoined(*odometry_);
    if (result.keyframe >= 0 && (loops_.Searching() || on_keyframe_)) unmapped_[result.keyframe] = numbered;
    SubmitMapped();
    if (PruneDue(result.keyframe)) {
      Announce();
      Prune();
    }
    return result;
  }

  TrackResult Follow(const InputFrame& frame, const Pose& T_odom_camera,
                     const std::optional<MotionSigma>& sigma) {
    if (sigma && !(sigma->translation_m >= 0 && sigma->rotation_rad >= 0 &&
                   std::isfinite(sigma->translation_m) && std::isfinite(sigma->rotation_rad)))
      throw InputError("frame " + std::to_string(frame.index) +
                       ": the odometry's standard deviation is below 0 or not finite");
    if (!odometry_) return Track(frame);
    CheckFrame(frame, rig_);
    if (frames_ == 0 && config_.run.prune_every > 0)
      loops_.Warn("run.prune_every: no effect on a trajectory that is given: no keyframe is removed");
    BringIn();
    ++frames_;
    sessions_.CountFrame();
    TrackResult result = Note(odometry_->Follow(frame, T_odom_camera));
    if (result.step) loops_.NoteStep(result.keyframe, *result.step);
    loops_.FollowOdometry({frame.stamp_s, T_odom_camera}, *odometry_);
    if (sigma) loops_.NoteMotion(result.keyframe, *sigma, T_odom_camera.translation);
    last_ = frame.index;
    sessions_.SetLastFrame(last_);
    if (result.keyframe >= 0 && (loops_.Searching() || on_keyframe_)) unmapped_[result.keyframe] = frame;
    SubmitMapped();
    return result;
  }

  void BeginSession(const CameraRig& rig) {
    CheckHasMap("gone on with");
    if (localizing_) throw InputError("frames are only being located: a recording can't go on in this map");
    Finish();
    const std::int64_t offset = sessions_.NextOffset(*odometry_);
    odometry_ = Odometry(*odometry_, WithRig(odometry_->map(), rig), offset);
    rig_ = rig;
    loops_.BeginSession(rig, offset, odometry_->map().KeyframeCount());
    unmapped_.clear();
    relocalized_ = 0;
    stages_.clear();
    last_ = -1;
    sessions_.Begin(offset, odometry_->LastView().session_piece);
  }

  bool Merge(Impl* other, std::string* reason) {
    CheckHasMap("merged");
    other->CheckHasMap("merged");
    Finish();
    other->Finish();
    MapMerge merge(config_, ToMerge(), other->ToMerge());
    merge.Append();
    frames_ += other->frames_;
    last_ = other->last_;
    return merge.Join(
        frames_, [this](const LoopUpdate& update) { Take(update); }, reason);
  }

  // True if the two can be merged in either order, and this one is to be the second then.
  bool ComesAfter(const Impl& other) const {
    return odometry_ && other.odometry_ && recorder_ == other.recorder_ &&
           tutti::ComesAfter(Info(""), other.Info(""));
  }

  // The merged map takes the place of the one that was appended, from its keyframe with this number on.
  void TakeThePlaceOf(Impl* appended, const Odometry& before, int first_keyframe) {
    std::swap(on_keyframe_, appended->on_keyframe_);
    std::swap(on_change_, appended->on_change_);
    loops_.SwapListener(&appended->loops_);
    Take(loops_.MoveAll(InFrameOf(before, first_keyframe, *odometry_), *odometry_));
  }

  std::vector<MapSession> Sessions() const { return sessions_.WithKeyframes(odometry()); }

  void BeginLocalization() {
    CheckHasMap("located in");
    localizing_ = true;
    odometry_ = Odometry(*odometry_, Locating());
  }

  void AddLoop(int candidate, int query, const Similarity& S_candidate_query, const Matrix7d& information) {
    if (!odometry_) throw InputError("a loop needs keyframes, and without a calibration there are none");
    const std::vector<int> ids = odometry_->map().KeyframeIds();
    for (const int id : {candidate, query}) {
      if (!std::binary_search(ids.begin(), ids.end(), id))
        throw InputError("a loop to keyframe " + std::to_string(id) + ", which is not there");
    }
    if (candidate >= query) throw InputError("a loop leads from an older keyframe to a newer one");
    const bool finite = S_candidate_query.translation.allFinite() &&
                        S_candidate_query.rotation.coeffs().allFinite() && S_candidate_query.scale > 0 &&
                        std::isfinite(S_candidate_query.scale) && information.allFinite();
    if (!finite) throw InputError("a loop's transform and information must be finite numbers");
    loops_.Add(candidate, query, S_candidate_query, information, *odometry_, frames_);
  }

  void Finish() {
    if (localizing_) return;
    if (odometry_) {
      FinishMapping();
      SubmitMapped();
    }
    while (const auto update = loops_.Rest(odometry(), frames_)) Take(*update);
    if (odometry_) sessions_.NoteJoined(*odometry_);
  }

  std::size_t Prune() {
    if (!odometry_) throw InputError("the map has no keyframes, since the camera had no calibration");
    Finish();
    if (localizing_) throw InputError("frames are being located in the map: it must stay as it is");
    const Odometry before = *odometry_;
    const FrameView last = before.LastView();
    const std::size_t least_views = rig_.sensor == Sensor::kMono ? 2 : 1;  // that tell where a landmark is
    Map map = before.map();
    FuseAll(rig_.camera, &map);
    const std::map<int, int> removed = tutti::Prune(
        {last.keyframe, last.newest_keyframe}, least_views,
        [&](int keyframe, int into) { return loops_.Forget(keyframe, into, before); }, &map);
    map.Compact();
    odometry_->Replace(std::move(map));
    loops_.Removed(removed, before);
    return removed.size();
  }

  MapSnapshot Snapshot(const std::string& note) const {
    auto parts = std::make_shared<MapSnapshot::Parts>();
    parts->info = StateOf(Info(note));
    parts->state = StateOf(*this);
    parts->odometry = odometry_;
    parts->pending = loops_.pending();
    parts->detector = loops_.SaveDetector();
    return MapSnapshot(std::move(parts));
  }

  // From what follows MapSection::kInfo. The detector's half of the file is read beside the other.
  void Load(internal::SectionReader& file, const std::function<void(internal::SectionReader&)>& more) {
    ReadState(file, MapSection::kState, this);
    std::optional<internal::SectionReader> second;
    std::future<void> detector;
    if (loops_.Searching()) {
      second.emplace(file.name(), kMapFile);
      detector = std::async(config_.run.threads > 1 ? std::launch::async : std::launch::deferred,
                            [&] { loops_.ResumeDetector(&*second); });
    }
    if (odometry_) OdometryFile::Load(&file, &*odometry_);
    loops_.Check(odometry(), file);
    std::optional<LoopSolution> solution;
    if (Next(file, MapSection::kSolution)) ReadState(file, MapSection::kSolution, &solution.emplace());
    std::optional<GlobalAdjustment> adjustment;
    if (Next(file, MapSection::kAdjustment)) {
      file.Expect(MapSection::kAdjustment);
      adjustment = OdometryFile::LoadAdjustment(odometry_.value().map(), &file);
    }
    loops_.ResumePending(std::move(solution), std::move(adjustment));
    if (second) {
      if (!Next(file, MapSection::kDetector)) file.Damaged("a section out of place");
      detector.get();
    }
    internal::SectionReader& end = second ? *second : file;
    if (more) more(end);
    std::string rest;  // of whoever wrote them
    while (end.Next(&rest) != internal::kEndOfSections) {
    }
  }

  // What MapSection::kState holds.
  template <class Archive>
  void State(Archive& archive) {
    archive(loops_, relocalized_, stages_, unmapped_, frames_, last_);
  }

  const Odometry* odometry() const { return odometry_ ? &*odometry_ : nullptr; }

  int NextKeyframe() const { return odometry_ ? odometry_->map().KeyframeCount() : 0; }

  LoopClosing loops_;
  SessionList sessions_;
  std::function<void(const InputFrame&, int)> on_keyframe_;            // may be empty
  std::function<void(const Odometry&, std::int64_t last)> on_change_;  // may be empty
  std::size_t relocalized_ = 0;                                        // frames
  std::map<std::string, double> stages_;

 private:
  bool PruneDue(int new_keyframe) const {
    return new_keyframe > 0 && config_.run.prune_every > 0 && new_keyframe % config_.run.prune_every == 0;
  }

  // What is due by now.
  void BringIn() {
    do {
      if (odometry_ && loops_.MayMove(frames_)) {
        Announce();
        FinishMapping();
      }
      const auto update = loops_.Due(odometry(), frames_);
      if (!update) return;
      Take(*update);
    } while (true);
  }

  MapToMerge ToMerge() { return {rig_, loops_, sessions_, *odometry_}; }

  void Take(const LoopUpdate& update) {
    if (!update.correction) return;
    Announce();
    const internal::Stopwatch watch;
    const std::vector<int> common = odometry_->Correct(*update.correction);
    loops_.Applied(update, common, *odometry_, frames_);
    stages_["loop_fuse"] += watch.Milliseconds();
  }

  void CheckHasMap(const std::string& to_be) const {
    if (!odometry_ || odometry_->map().KeyframeIds().empty())
      throw InputError("there is no map to be " + to_be);
    if (!loops_.Searching())
      throw InputError(
          "the map was made without loop closure, so nothing says where in it a frame was taken");
  }

  MapInfo Info(const std::string& note) const {
    MapInfo info;
    info.note = note;
    info.sessions = Sessions();
    info.sessions.back().note = note;
    info.program = kVersion;
    info.config = config_;
    info.rig = rig_;
    info.frames = frames_;
    info.last_frame = last_;
    info.loops = static_cast<int>(CountAccepted(loops_.closer().records()));
    if (!odometry_) return info;
    const std::vector<int> ids = odometry_->map().KeyframeIds();
    info.keyframes = static_cast<int>(ids.size());
    info.landmarks = static_cast<int>(odometry_->map().LandmarkIds().size());
    info.pieces = static_cast<int>(FramePieces(odometry_->map()).size());
    if (ids.empty()) return info;
    info.first_stamp_s = odometry_->map().keyframe(ids.front()).stamp_s;
    info.last_stamp_s = odometry_->map().keyframe(ids.back()).stamp_s;
    info.least = info.most = odometry_->map().keyframe(ids.front()).T_world_camera.translation;
    for (const int id : ids) {
      const Eigen::Vector3d position = odometry_->map().keyframe(id).T_world_camera.translation;
      info.least = info.least.cwiseMin(position);
      info.most = info.most.cwiseMax(position);
    }
    return info;
  }

  static bool Next(internal::SectionReader& file, MapSection section) {
    return file.Peek() == static_cast<std::uint32_t>(section);
  }

  void Announce() {
    if (on_change_) on_change_(*odometry_, last_);
  }

  // A frame without a pose is looked up among the keyframes that the detector knows.
  TrackResult Relocalize(const InputFrame& frame, const TrackResult& lost) {
    constexpr int kFewFeatures = 100;  // nothing can be recognised by so few
    if (lost.features < kFewFeatures) return lost;
    const internal::Stopwatch watch;
    const int keyframe = loops_.Locate(frame);
    TrackResult result = lost;
    if (keyframe >= 0) {
      Announce();
      result = Note(odometry_->RelocalizeAt(keyframe));
    }
    if (result.state != TrackingState::kTracking && Begins()) result = RelocalizeAtTheEnd(result);
    if (result.state == TrackingState::kTracking) ++relocalized_;
    stages_["relocalize"] += watch.Milliseconds();
    return result;
  }

  // One of the first frames of another recording than the map's first, which has nothing yet.
  bool Begins() const {
    constexpr std::int64_t kFirstFrames = 5;
    const std::vector<int> ids = odometry_->map().KeyframeIds();
    return !localizing_ && sessions_.size() > 1 && sessions_.frames() <= kFirstFrames && !ids.empty() &&
           odometry_->map().keyframe(ids.back()).frame_index < sessions_.offset();
  }

  // A camera that was stopped and started again stands where the recording before ended.
  TrackResult RelocalizeAtTheEnd(TrackResult result) {
    constexpr std::size_t kLastKeyframes = 3;
    const std::vector<int> ids = odometry_->map().KeyframeIds();
    Announce();
    for (std::size_t k = 0; k < std::min(kLastKeyframes, ids.size()); ++k) {
      result = Note(odometry_->RelocalizeAt(ids[ids.size() - 1 - k]));
      if (result.state == TrackingState::kTracking) break;
    }
    return result;
  }

  // Beyond the map the pose drifts: now and then the detector is asked whether the map shows this place.
  TrackResult FindBack(const InputFrame& frame, const TrackResult& tracked) {
    constexpr int kFramesBetween = 10;
    mapped_.clear();
    if (!odometry_->LastView().beyond_map || ++frames_beyond_ % kFramesBetween != 0) return tracked;
    return Relocalize(frame, tracked);
  }

  TrackResult Note(TrackResult result) {
    mapped_.insert(mapped_.end(), result.mapped.begin(), result.mapped.end());
    return result;
  }

  void FinishMapping() {
    for (const int keyframe : odometry_->FinishMapping()) mapped_.push_back(keyframe);
  }

  // The detector gets a keyframe once all its landmarks are known.
  void SubmitMapped() {
    for (const int keyframe : std::exchange(mapped_, {})) {
      const auto frame = unmapped_.find(keyframe);
      if (frame == unmapped_.end()) continue;
      if (on_keyframe_) on_keyframe_(frame->second, keyframe);
      if (loops_.Searching()) {
        const KeyframeView view = ViewOf(odometry_->map(), keyframe);
        loops_.Submit(frame->second, &view, frames_);
      }
      unmapped_.erase(frame);
    }
  }

  RunConfig config_;
  CameraRig rig_;
  SpanRecorder* recorder_;
  std::optional<Odometry> odometry_;    // with a calibration
  std::vector<int> mapped_;             // keyframes that are to be submitted
  std::map<int, InputFrame> unmapped_;  // keyframes that the detector waits for
  bool localizing_ = false;
  int frames_beyond_ = 0;  // of the map, while localizing
  std::int64_t frames_ = 0;
  std::int64_t last_ = -1;  // index of the last frame that the odometry has seen
};

SlamSystem::SlamSystem(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder)
    : impl_(std::make_unique<Impl>(config, rig, recorder)) {}
SlamSystem::SlamSystem(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SlamSystem::~SlamSystem() = default;

void SlamSystem::BeginSession(const CameraRig& rig) { impl_->BeginSession(rig); }
std::vector<MapSession> SlamSystem::Sessions() const { return impl_->Sessions(); }
bool SlamSystem::Merge(SlamSystem* other, std::string* reason) {
  if (other == nullptr || other == this) throw InputError("a map can't be merged with itself, or with none");
  std::string ignored;
  if (reason == nullptr) reason = &ignored;
  if (!impl_->ComesAfter(*other->impl_)) return impl_->Merge(other->impl_.get(), reason);
  const Odometry before = *impl_->odometry();
  const int first_keyframe = other->impl_->NextKeyframe();
  const bool joined = other->impl_->Merge(impl_.get(), reason);
  impl_.swap(other->impl_);
  impl_->TakeThePlaceOf(other->impl_.get(), before, first_keyframe);
  return joined;
}
void SlamSystem::BeginLocalization() { impl_->BeginLocalization(); }
MapSnapshot SlamSystem::Snapshot(const std::string& note) const { return impl_->Snapshot(note); }

std::unique_ptr<SlamSystem> SlamSystem::Load(const std::filesystem::path& file, const MapInfo& info,
                                             SpanRecorder* recorder,
                                             const std::function<void(internal::SectionReader&)>& more) {
  internal::SectionReader in(file, kMapFile);
  MapInfo saved;
  ReadState(in, MapSection::kInfo, &saved);
  auto impl = std::make_unique<Impl>(info.config, info.rig, recorder, true);
  impl->Load(in, more);
  impl->sessions_.Restore(saved.sessions, impl->odometry(), in);
  return std::unique_ptr<SlamSystem>(new SlamSystem(std::move(impl)));
}

void SlamSystem::SetDetectionListener(std::function<void(const LoopResult&)> listener) {
  impl_->loops_.SetDetectionListener(std::move(listener));
}
void SlamSystem::SetKeyframeListener(std::function<void(const InputFrame&, int)> listener) {
  impl_->on_keyframe_ = std::move(listener);
}
void SlamSystem::SetChangeListener(std::function<void(const Odometry&, std::int64_t)> listener) {
  impl_->on_change_ = std::move(listener);
}

TrackResult SlamSystem::Track(const InputFrame& frame) { return impl_->Track(frame); }
TrackResult SlamSystem::Follow(const InputFrame& frame, const Pose& T_odom_camera,
                               const std::optional<MotionSigma>& sigma) {
  return impl_->Follow(frame, T_odom_camera, sigma);
}
void SlamSystem::AddLoop(int candidate, int query, const Similarity& S_candidate_query,
                         const Matrix7d& information) {
  impl_->AddLoop(candidate, query, S_candidate_query, information);
}
void SlamSystem::Finish() { impl_->Finish(); }
std::size_t SlamSystem::Prune() { return impl_->Prune(); }
std::vector<std::string> SlamSystem::TakeWarnings() { return impl_->loops_.TakeWarnings(); }

const Odometry* SlamSystem::odometry() const { return impl_->odometry(); }
const std::vector<LoopRecord>& SlamSystem::loops() const { return impl_->loops_.closer().records(); }
std::size_t SlamSystem::Relocalized() const { return impl_->relocalized_; }
int SlamSystem::Corrections() const { return impl_->loops_.closer().Corrections(); }
int SlamSystem::GlobalAdjustments() const { return impl_->loops_.closer().Adjustments(); }

FollowedUncertainty SlamSystem::Followed() const {
  const FollowedOdometry& followed = impl_->loops_.closer().followed();
  const FollowedOdometry::Sigmas stated = followed.Stated(), seen = followed.Seen();
  return {stated.fraction, stated.rotation_rad, seen.fraction, seen.rotation_rad, followed.jumps()};
}

PoseGraph SlamSystem::Graph() const {
  return odometry() != nullptr ? impl_->loops_.closer().Graph(*odometry()) : PoseGraph();
}

const std::optional<KeyframeGraphProof>& SlamSystem::GraphProof() const {
  return impl_->loops_.closer().proof();
}

std::map<std::string, double> SlamSystem::StageMilliseconds() const {
  std::map<std::string, double> stages = impl_->loops_.StageMilliseconds();
  for (const auto& [name, ms] : impl_->stages_) stages[name] += ms;
  if (odometry() == nullptr) return stages;
  for (const auto& [name, ms] : odometry()->Report().stage_ms) stages["odometry_" + name] = ms;
  return stages;
}

}  // namespace tutti
