#include "tutti/slam/slam_system.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <optional>
#include <utility>

#include "apps/slam/loop_closer.h"
#include "apps/slam/map_merge.h"
#include "apps/slam/map_parts.h"
#include "apps/slam/map_reference.h"
#include "apps/slam/map_state.h"
#include "apps/slam/session_list.h"
#include "apps/slam/submap_joiner.h"
#include "core/section_file.h"
#include "core/stopwatch.h"
#include "frontend/map/append.h"
#include "frontend/odometry/frame_check.h"
#include "frontend/odometry/odometry_file.h"
#include "tutti/core/error.h"
#include "tutti/slam/localizer.h"
#include "tutti/slam/version.h"

namespace tutti {

class SlamSystem::Impl {
 public:
  Impl(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder, bool resumes = false)
      : loops_(config, rig, recorder,
               {[this](const LoopResult& result) {
                  if (listeners_.on_detection) listeners_.on_detection(result);
                },
                [this] {
                  Announce();
                  FinishMapping();
                }},
               resumes),
        config_(config),
        rig_(rig),
        recorder_(recorder) {
    if (rig.calibrated) odometry_.emplace(config.odometry, rig, Execution{config.run.threads > 1, recorder});
  }

  TrackResult Track(const InputFrame& frame) {
    CheckFrame(frame, rig_);
    if (!odometry_) return Look(frame);
    Begin();
    TrackResult result = Note(odometry_->Track(frame));
    SetLast(frame.index);
    InputFrame numbered = frame;
    numbered.index += sessions_.offset();
    if (result.state != TrackingState::kTracking) result = Relocalize(numbered, result);
    End(numbered, result);
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
      warnings_.emplace_back(
          "run.prune_every: no effect on a trajectory that is given: no keyframe is removed");
    Begin();
    TrackResult result = Note(odometry_->Follow(frame, T_odom_camera));
    SetLast(frame.index);
    loops_.Follow(result, {frame.stamp_s, T_odom_camera}, sigma, *odometry_);
    End(frame, result);
    return result;
  }

  void BeginSession(const CameraRig& rig) {
    CheckHasMap("gone on with");
    Finish();
    const std::int64_t offset = sessions_.NextOffset(odometry_->map());
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
    return merge.Join(frames_, reason);
  }

  // True if the two can be merged in either order, and this one is to be the second then.
  bool ComesAfter(const Impl& other) const {
    return odometry_ && other.odometry_ && recorder_ == other.recorder_ &&
           tutti::ComesAfter(Info(""), other.Info(""));
  }

  // The merged map takes the place of the one that was appended, from its keyframe with this number on.
  void TakeThePlaceOf(Impl* appended, const Map& before, int first_keyframe) {
    std::swap(listeners_, appended->listeners_);
    MapMerge::MoveAll(InFrameOf(before, first_keyframe, odometry_->map()), &loops_, &*odometry_);
  }

  std::vector<MapSession> Sessions() const {
    return sessions_.WithKeyframes(odometry_ ? &odometry_->map() : nullptr);
  }

  void AddLoop(int candidate, int query, const Similarity& S_candidate_query, const Matrix7d& information) {
    if (!odometry_) throw InputError("a loop needs keyframes, and without a calibration there are none");
    for (const int id : {candidate, query}) {
      if (id < 0 || id >= odometry_->map().KeyframeCount() || odometry_->map().keyframe(id).replaced_by >= 0)
        throw InputError("a loop to keyframe " + std::to_string(id) + ", which is not there");
    }
    if (candidate >= query) throw InputError("a loop leads from an older keyframe to a newer one");
    const bool finite = S_candidate_query.translation.allFinite() &&
                        S_candidate_query.rotation.coeffs().allFinite() && S_candidate_query.scale > 0 &&
                        std::isfinite(S_candidate_query.scale) && information.allFinite();
    if (!finite) throw InputError("a loop's transform and information must be finite numbers");
    FoundLoop loop{candidate, query, {}, information};
    loop.verification.S_candidate_query = S_candidate_query;
    loops_.AddLoop(loop, &*odometry_, frames_);
  }

  void Finish() {
    if (odometry_) {
      FinishMapping();
      SubmitMapped();
    }
    loops_.Finish(mutable_odometry(), frames_);
    if (odometry_) JoinSubmaps();
    if (odometry_ && sessions_.size() == 1) StandUpright();
    if (odometry_) sessions_.NoteJoined(*odometry_);
  }

  std::size_t Prune() {
    if (!odometry_) throw InputError("the map has no keyframes, since the camera had no calibration");
    Finish();
    return loops_.Prune(&*odometry_);
  }

  MapSnapshot Snapshot(const std::string& note) const {
    auto parts = std::make_shared<MapSnapshot::Parts>();
    parts->info = StateOf(Info(note));
    parts->state = StateOf(*this);
    parts->odometry = odometry_;
    MapFile::Save(loops_, parts.get());
    return MapSnapshot(std::move(parts));
  }

  // From what follows MapSection::kInfo. The detector's half of the file is read beside the other.
  void Load(internal::SectionReader& file, const std::function<void(internal::SectionReader&)>& more) {
    ReadState(file, MapSection::kState, this);
    std::optional<internal::SectionReader> second;
    std::future<void> detector;
    if (config_.run.loops) {
      second.emplace(file.name(), kMapFile);
      detector = std::async(config_.run.threads > 1 ? std::launch::async : std::launch::deferred,
                            [&] { MapFile::LoadDetector(&*second, &loops_); });
    }
    if (odometry_) OdometryFile::Load(&file, &*odometry_);
    MapFile::LoadPending(&file, odometry(), &loops_);
    if (second) {
      if (file.Peek() != static_cast<std::uint32_t>(MapSection::kDetector))
        file.Damaged("a section out of place");
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

  SlamReport Report() const {
    SlamReport report = loops_.Report();
    report.relocalized = relocalized_;
    for (const auto& [name, ms] : stages_) report.stage_ms[name] += ms;
    return report;
  }

  std::vector<std::string> TakeWarnings() {
    std::vector<std::string> warnings = std::exchange(warnings_, {});
    for (std::string& warning : loops_.TakeWarnings()) warnings.push_back(std::move(warning));
    return warnings;
  }

  void CheckHasMap(const std::string& to_be) const {
    if (!odometry_ || odometry_->map().KeyframeIds().empty())
      throw InputError("there is no map to be " + to_be);
    if (!config_.run.loops)
      throw InputError(
          "the map was made without loop closure, so nothing says where in it a frame was taken");
  }

  LoopCloser loops_;
  SessionList sessions_;
  SlamListeners listeners_;

 private:
  bool PruneDue(int new_keyframe) const {
    return new_keyframe > 0 && config_.run.prune_every > 0 && new_keyframe % config_.run.prune_every == 0;
  }

  Odometry* mutable_odometry() { return odometry_ ? &*odometry_ : nullptr; }
  MapToMerge ToMerge() { return {rig_, loops_, sessions_, *odometry_}; }

  void JoinSubmaps() {
    const int keyframes = odometry_->map().KeyframeCount();
    if (!config_.run.loops || std::exchange(searched_, keyframes) == keyframes) return;
    SubmapJoiner(config_, frames_, &loops_, &*odometry_).Join();
  }

  // The world's z axis points up if an IMU knows where that is; one camera's unit is the metre if it knows
  // it.
  void StandUpright() {
    constexpr double kUpright = 0.002;  // it is, no matter what a loop more says [rad], [1]
    const std::optional<ImuReport> imu = odometry_->Report().imu;
    const std::optional<Similarity> turn = UprightTurn(imu);
    if (!turn) return;
    const bool is = turn->rotation.angularDistance(Eigen::Quaterniond::Identity()) < kUpright &&
                    std::abs(turn->scale - 1) < kUpright;
    if (is) return;
    const Map& map = odometry_->map();
    MapMerge::MoveAll(Upright(map, *imu, *turn, loops_.Graph(map)), &loops_, &*odometry_);
  }

  // What is due by now.
  void Begin() {
    loops_.Due(mutable_odometry(), frames_);
    ++frames_;
    sessions_.CountFrame();
  }

  void SetLast(std::int64_t index) {
    last_ = index;
    sessions_.SetLastFrame(index);
  }

  // `frame`: by its number in the map.
  void End(const InputFrame& frame, const TrackResult& result) {
    sessions_.NoteJoined(*odometry_);
    if (result.keyframe >= 0 && (config_.run.loops || listeners_.on_keyframe))
      unmapped_[result.keyframe] = frame;
    SubmitMapped();
  }

  // At a frame without a pose: the camera has no calibration.
  TrackResult Look(const InputFrame& frame) {
    Begin();
    loops_.AddKeyframe(frame, nullptr, frames_);
    TrackResult result;
    result.reason = "no calibration";
    return result;
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
    info.loops = static_cast<int>(CountAccepted(loops_.loops()));
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

  void Announce() {
    if (listeners_.on_change) listeners_.on_change(*odometry_, last_);
  }

  // A frame without a pose is looked up among the keyframes that the detector knows.
  TrackResult Relocalize(const InputFrame& frame, const TrackResult& lost) {
    if (lost.features < LoopCloser::kFewestFeatures) return lost;
    const internal::Stopwatch watch;
    const int keyframe = loops_.Locate(frame);
    TrackResult result = lost;
    if (keyframe >= 0) {
      Announce();
      result = Note(odometry_->RelocalizeAt(keyframe));
    }
    if (result.state != TrackingState::kTracking && Begins()) result = RelocalizeAtTheEnd(result);
    result.recognised = result.state == TrackingState::kTracking;
    if (result.recognised) ++relocalized_;
    stages_["relocalize"] += watch.Milliseconds();
    return result;
  }

  // One of the first frames of another recording than the map's first, which has nothing yet.
  bool Begins() const {
    constexpr std::int64_t kFirstFrames = 5;
    const std::vector<int> ids = odometry_->map().KeyframeIds();
    return sessions_.size() > 1 && sessions_.frames() <= kFirstFrames && !ids.empty() &&
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
      if (listeners_.on_keyframe) listeners_.on_keyframe(frame->second, keyframe);
      if (config_.run.loops) {
        const KeyframeView view = ViewOf(odometry_->map(), keyframe);
        loops_.AddKeyframe(frame->second, &view, frames_);
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
  std::size_t relocalized_ = 0;         // frames
  std::map<std::string, double> stages_;
  std::vector<std::string> warnings_;  // not taken yet
  std::int64_t frames_ = 0;
  int searched_ = 0;        // keyframes that submaps were joined by
  std::int64_t last_ = -1;  // index of the last frame that the odometry has seen
};

SlamSystem::SlamSystem(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder)
    : impl_(std::make_unique<Impl>(config, rig, recorder)) {}
SlamSystem::SlamSystem(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SlamSystem::~SlamSystem() = default;

void SlamSystem::SetListeners(SlamListeners listeners) { impl_->listeners_ = std::move(listeners); }
void SlamSystem::BeginSession(const CameraRig& rig) { impl_->BeginSession(rig); }
std::vector<MapSession> SlamSystem::Sessions() const { return impl_->Sessions(); }
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
std::vector<std::string> SlamSystem::TakeWarnings() { return impl_->TakeWarnings(); }
const Odometry* SlamSystem::odometry() const { return impl_->odometry(); }
const std::vector<Loop>& SlamSystem::loops() const { return impl_->loops_.loops(); }
PoseGraph SlamSystem::Graph() const {
  return odometry() != nullptr ? impl_->loops_.Graph(odometry()->map()) : PoseGraph();
}
SlamReport SlamSystem::Report() const { return impl_->Report(); }
MapSnapshot SlamSystem::Snapshot(const std::string& note) const { return impl_->Snapshot(note); }

std::map<std::string, double> StageMilliseconds(const SlamSystem& slam) {
  std::map<std::string, double> stages = slam.Report().stage_ms;
  if (slam.odometry() == nullptr) return stages;
  for (const auto& [name, ms] : slam.odometry()->Report().stage_ms) stages["odometry_" + name] = ms;
  return stages;
}

std::unique_ptr<SlamSystem> LoadMap(const std::filesystem::path& file, const MapInfo& info,
                                    SpanRecorder* recorder,
                                    const std::function<void(internal::SectionReader&)>& more) {
  internal::SectionReader in(file, kMapFile);
  MapInfo saved;
  ReadState(in, MapSection::kInfo, &saved);
  auto impl = std::make_unique<SlamSystem::Impl>(info.config, info.rig, recorder, true);
  impl->Load(in, more);
  impl->sessions_.Restore(saved.sessions, impl->odometry(), in);
  return std::unique_ptr<SlamSystem>(new SlamSystem(std::move(impl)));
}

bool Merge(SlamSystem* map, SlamSystem* other, std::string* reason) {
  if (map == nullptr || other == nullptr || other == map)
    throw InputError("a map can't be merged with itself, or with none");
  std::string ignored;
  if (reason == nullptr) reason = &ignored;
  if (!map->impl_->ComesAfter(*other->impl_)) return map->impl_->Merge(other->impl_.get(), reason);
  const Map before = map->odometry()->map();
  const int first_keyframe = other->odometry()->map().KeyframeCount();
  const bool joined = other->impl_->Merge(map->impl_.get(), reason);
  map->impl_.swap(other->impl_);
  map->impl_->TakeThePlaceOf(other->impl_.get(), before, first_keyframe);
  return joined;
}

Localizer::Localizer(const SlamSystem& map)
    : map_(map),
      odometry_((map.impl_->CheckHasMap("located in"), *map.odometry()), Locating()),
      map_keyframes_(odometry_.map().KeyframeCount()) {}

TrackResult Localizer::Track(const InputFrame& frame) {
  constexpr int kFramesBetween = 10;  // that are looked for from beyond the map, where the pose drifts
  CheckFrame(frame, odometry_.map().rig());
  TrackResult result = odometry_.Track(frame);
  if (result.state != TrackingState::kTracking) result = Relocalize(frame, result);
  if (!odometry_.LastView().beyond_map || ++frames_beyond_ % kFramesBetween != 0) return result;
  return Relocalize(frame, result);
}

TrackResult Localizer::Relocalize(const InputFrame& frame, const TrackResult& tracked) {
  if (tracked.features < LoopCloser::kFewestFeatures) return tracked;
  InputFrame numbered = frame;
  numbered.index += odometry_.LastView().frame_offset;
  const int keyframe = map_.impl_->loops_.Locate(numbered);
  TrackResult result = tracked;
  if (keyframe >= 0 && keyframe < map_keyframes_) result = odometry_.RelocalizeAt(keyframe);
  result.recognised = result.state == TrackingState::kTracking;
  if (result.recognised) ++relocalized_;
  return result;
}

}  // namespace tutti
