// Saving and loading of an odometry.
#include <algorithm>
#include <limits>
#include <sstream>
#include <utility>

#include "core/section_file.h"
#include "core/state_archive.h"
#include "frontend/map/global_adjustment.h"
#include "frontend/odometry/odometry_file.h"
#include "frontend/odometry/odometry_impl.h"
#include "frontend/odometry/state_check.h"
#include "frontend/store/features_state.h"
#include "frontend/store/grey_bytes.h"
#include "tutti/core/error.h"

namespace tutti {

// Without the step, which is of a keyframe alone.
template <class Archive>
void State(Archive& archive, TrackResult& result) {
  archive(result.state, result.reason, result.T_world_camera, result.features, result.inliers,
          result.by_grey_values, result.keyframe);
}

namespace {

constexpr int kLandmarksPerSection = 1024;
constexpr int kMostPieces = 1 << 28;

// What must be the same where an odometry is loaded: else its numbers mean something else.
std::string Fingerprint(const CameraRig& rig, const std::vector<float>& scales) {
  std::ostringstream text;
  text.precision(std::numeric_limits<double>::max_digits10);
  const PinholeCamera& camera = rig.camera;
  text << WordOf(rig.sensor) << ", " << camera.width << "x" << camera.height << " px, fx " << camera.fx
       << ", fy " << camera.fy << ", cx " << camera.cx << ", cy " << camera.cy;
  if (rig.sensor == Sensor::kStereo) text << ", baseline " << rig.baseline_m << " m";
  if (rig.readout_s > 0) text << ", readout " << rig.readout_s << " s";
  text << ", " << scales.size() << " pyramid levels to " << scales.back();
  return text.str();
}

// The grey values of the landmarks' patches, one below the other.
cv::Mat PatchesOf(const Map& map, int first, int end) {
  cv::Mat all(0, Patch::kSide, CV_8UC1);
  all.reserve(static_cast<std::size_t>(Patch::kSide) * static_cast<std::size_t>(end - first));
  for (int id = first; id < end; ++id) {
    const std::shared_ptr<const Patch>& patch = map.landmark(id).patch;
    if (map.landmark(id).alive && patch) all.push_back(cv::Mat(patch->grey, true).reshape(1, Patch::kSide));
  }
  return all;
}

// The descriptor of what a landmark was seen as; null if that is nowhere.
const std::uint8_t* SeenAs(const Observation& seen, const Map& map) {
  if (seen.keyframe < 0 || seen.keyframe >= map.KeyframeCount()) return nullptr;
  const FrameFeatures& features = *map.keyframe(seen.keyframe).features;
  if (seen.feature < 0 || seen.feature >= features.descriptors.rows) return nullptr;
  return features.descriptors.ptr(seen.feature);
}

// Descriptors of landmarks: by which observation, or as they are.
struct LandmarkDescriptors {
  static constexpr std::size_t kOther = 255;
  std::vector<std::uint8_t> which, others;

  void Add(const Landmark& landmark, const Map& map) {
    const auto& own = landmark.descriptor;
    std::size_t o = 0;
    for (; o < landmark.observations.size() && o < kOther; ++o) {
      const std::uint8_t* seen = SeenAs(landmark.observations[o], map);
      if (seen != nullptr && std::equal(own.begin(), own.end(), seen)) break;
    }
    const bool found = o < landmark.observations.size() && o < kOther;
    which.push_back(static_cast<std::uint8_t>(found ? o : kOther));
    if (!found) others.insert(others.end(), own.begin(), own.end());
  }
  // Into the landmarks that live.
  void Give(std::vector<Landmark>* landmarks, const Map& map, const internal::StateReader& in) const {
    auto observation = which.begin();
    auto other = others.begin();
    for (Landmark& landmark : *landmarks) {
      if (!landmark.alive) continue;
      auto& own = landmark.descriptor;
      if (observation == which.end()) in.Damaged("landmarks without descriptors");
      const std::size_t o = *observation++;
      if (o != kOther) {
        const std::uint8_t* seen =
            o < landmark.observations.size() ? SeenAs(landmark.observations[o], map) : nullptr;
        if (seen == nullptr) in.Damaged("a landmark that looks like nothing");
        std::copy_n(seen, own.size(), own.begin());
      } else {
        if (others.end() - other < static_cast<std::ptrdiff_t>(own.size()))
          in.Damaged("landmarks without descriptors");
        std::copy_n(other, own.size(), own.begin());
        other += static_cast<std::ptrdiff_t>(own.size());
      }
    }
    if (observation != which.end() || other != others.end()) in.Damaged("descriptors without landmarks");
  }

  template <class Archive>
  void State(Archive& archive) {
    archive(which, others);
  }
};

void ReadLandmarks(int count, internal::StateReader& in, Map* map) {
  std::vector<Landmark> landmarks(static_cast<std::size_t>(count));
  std::vector<int> replaced_by(landmarks.size(), -1);
  int patches = 0;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    Landmark& landmark = landmarks[i];
    in(landmark.alive);
    if (landmark.alive) {
      in(landmark);
    } else {
      in(replaced_by[i]);
    }
    if (landmark.patch) ++patches;
  }
  std::string packed;
  in(packed);
  cv::Mat all(patches * Patch::kSide, Patch::kSide, CV_8UC1);
  if (!internal::GetGrey(packed, &all)) in.Damaged("patches that are none");
  LandmarkDescriptors descriptors;
  in(descriptors);
  descriptors.Give(&landmarks, *map, in);
  const std::uint8_t* next = all.data;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    Landmark& landmark = landmarks[i];
    if (landmark.patch) {
      auto patch = std::make_shared<Patch>(*landmark.patch);
      std::copy(next, next + patch->grey.size(), patch->grey.begin());
      next += patch->grey.size();
      landmark.patch = std::move(patch);
    }
    map->Restore(std::move(landmark), replaced_by[i]);
  }
}

// Reads the next section into what `read` is given to an archive.
template <class Read>
void ReadSection(OdometrySection section, internal::SectionReader* file, internal::SharedObjectsIn* shared,
                 const Read& read) {
  const std::string bytes = file->Expect(Tag(section));
  internal::StateReader in(bytes, file->name(), shared);
  read(in);
  in.ExpectEnd();
}

struct Head {
  std::string fingerprint;
  std::int32_t keyframes = 0, landmarks = 0, pieces = 0;

  template <class Archive>
  void State(Archive& archive) {
    archive(fingerprint, keyframes, landmarks, pieces);
  }
};

}  // namespace

void Odometry::Impl::Save(const internal::SectionSink& sink) const {
  internal::SharedObjectsOut shared;
  const auto write = [&](OdometrySection section, const auto& put) {
    internal::StateWriter out(&shared);
    put(out);
    sink(Tag(section), out.Take());
  };
  const Head head{Fingerprint(rig_, map().scales()), map().KeyframeCount(), map().LandmarkCount(),
                  map().NextPiece()};
  write(OdometrySection::kHead, [&](auto& out) { out(head); });
  for (int id = 0; id < head.keyframes; ++id) {
    const tutti::Keyframe& keyframe = map().keyframe(id);
    // Before it: what is like the keyframe, a view, is like none of its image.
    if (keyframe.features->pyramid)
      write(OdometrySection::kImage, [&](auto& out) { out(keyframe.features->pyramid); });
    write(OdometrySection::kKeyframe, [&](auto& out) { out(keyframe); });
  }
  for (int first = 0; first < head.landmarks; first += kLandmarksPerSection) {
    const int end = std::min(first + kLandmarksPerSection, head.landmarks);
    write(OdometrySection::kLandmarks, [&](auto& out) {
      for (int id = first; id < end; ++id) {
        const Landmark& landmark = map().landmark(id);
        out(landmark.alive);
        if (landmark.alive) {
          out(landmark);
        } else {  // nobody asks for more than what replaced it
          out(map().ReplacedBy(id));
        }
      }
      out(internal::PutGrey(PatchesOf(map(), first, end)));
      LandmarkDescriptors descriptors;
      for (int id = first; id < end; ++id) {
        if (map().landmark(id).alive) descriptors.Add(map().landmark(id), map());
      }
      out(descriptors);
    });
  }
  write(OdometrySection::kTracking, [&](auto& out) { out(*this); });
  if (!imu_.empty()) write(OdometrySection::kImu, [&](auto& out) { out(imu_, gravity_); });
  write(OdometrySection::kTimes, [&](auto& out) { out(stages_.milliseconds); });
  sink(Tag(OdometrySection::kEndOfOdometry), "");
}

void Odometry::Impl::Load(internal::SectionReader* file) {
  internal::SharedObjectsIn shared;
  Head head;
  ReadSection(OdometrySection::kHead, file, &shared, [&](auto& in) { in(head); });
  const std::string here = Fingerprint(rig_, map().scales());
  if (head.fingerprint != here) {
    throw InputError(file->name() + ": was saved with another camera or image pyramid (" + head.fingerprint +
                     "; here: " + here + "); go on with the data set and the settings that it was made with");
  }
  Map* const map = mapper_.RestoredMap();
  for (int id = 0; id < head.keyframes; ++id) {
    std::shared_ptr<const Pyramid> image;
    if (file->Peek() == Tag(OdometrySection::kImage))
      ReadSection(OdometrySection::kImage, file, &shared, [&](auto& in) { in(image); });
    tutti::Keyframe keyframe;
    ReadSection(OdometrySection::kKeyframe, file, &shared, [&](auto& in) { in(keyframe); });
    map->Restore(std::move(keyframe));
  }
  internal::CheckIndex(head.pieces, map->NextPiece(), kMostPieces + 1, *file);
  map->RestorePieces(head.pieces);
  for (int first = 0; first < head.landmarks; first += kLandmarksPerSection) {
    ReadSection(OdometrySection::kLandmarks, file, &shared, [&](auto& in) {
      ReadLandmarks(std::min(kLandmarksPerSection, head.landmarks - first), in, map);
    });
  }
  ReadSection(OdometrySection::kTracking, file, &shared, [&](auto& in) { in(*this); });
  if (file->Peek() == Tag(OdometrySection::kImu))
    ReadSection(OdometrySection::kImu, file, &shared, [&](auto& in) { in(imu_, gravity_); });
  ReadSection(OdometrySection::kTimes, file, &shared, [&](auto& in) { in(stages_.milliseconds); });
  file->Expect(Tag(OdometrySection::kEndOfOdometry));
  Check(*file);
  mapper_.Resume(stages_);
}

void Odometry::Impl::Check(const internal::SectionReader& file) const {
  mapper_.Check(file);
  initializer_.Check(map(), file);
  tracker_.Check(map(), file);
  relocalizer_.Check(map(), file);
  if (mapper_.interrupted() && last().reference < 0) file.Damaged("mapping that began from nowhere");
  internal::CheckIndex(static_cast<int>(result_.state), 0, static_cast<int>(TrackingState::kLost) + 1, file);
  internal::CheckKeyframe(result_.keyframe, map(), file, true);
  internal::CheckIndex(session_piece_, 0, initializer_.piece() + 1, file);
  internal::CheckIndex(first_unmoved_, 0, map().KeyframeCount() + 1, file);
  if (!imu_.IsPossible() || !gravity_.IsPossible()) file.Damaged("measurements of an IMU that are none");
  if (!height_.IsPossible()) file.Damaged("a height above the ground that is none");
  if (frame_offset_ < 0) file.Damaged("frames with impossible numbers");
  for (const std::vector<double>* numbers : {&row_errors_, &stereo_matches_}) {
    if (!std::all_of(numbers->begin(), numbers->end(), [](double v) { return std::isfinite(v); }))
      file.Damaged("a row error that is none");
  }
}

void OdometryFile::Save(const Odometry& odometry, const Sink& sink) { odometry.impl_->Save(sink); }

void OdometryFile::Load(internal::SectionReader* file, Odometry* odometry) {
  const Odometry::Impl& before = *odometry->impl_;
  auto loaded = std::make_unique<Odometry::Impl>(before.options(), before.rig());
  loaded->UseOwnThreads(before.mapper().own_threads());
  loaded->SetRecorder(before.recorder());
  loaded->Load(file);
  odometry->impl_ = std::move(loaded);
}

void OdometryFile::Save(const GlobalAdjustment& adjustment, const Sink& sink) {
  internal::SharedObjectsOut shared;
  internal::StateWriter out(&shared);
  out(adjustment.work_->moving(), adjustment.work_->Result());
  sink(Tag(OdometrySection::kGlobalAdjustment), out.Take());
}

GlobalAdjustment OdometryFile::LoadAdjustment(const Map& map, internal::SectionReader* file) {
  std::vector<int> moving;
  GlobalAdjustment::Work::Outcome outcome;
  internal::SharedObjectsIn shared;
  ReadSection(OdometrySection::kGlobalAdjustment, file, &shared, [&](auto& in) { in(moving, outcome); });
  for (const int id : moving) internal::CheckKeyframe(id, map, *file);
  if (outcome.S_world_keyframe.size() != (outcome.better ? moving.size() : 0))
    file->Damaged("an adjustment without its poses");
  for (const Similarity& S : outcome.S_world_keyframe) {
    internal::CheckPose(S.RigidPart(), *file);
    if (!(S.scale > 0) || !std::isfinite(S.scale)) file->Damaged("a scale that is none");
  }
  for (const AdjustedLandmark& landmark : outcome.landmarks) {
    internal::CheckIndex(landmark.id, 0, map.LandmarkCount(), *file);
    for (const int id : landmark.without) internal::CheckKeyframe(id, map, *file);
    if (landmark.position) internal::CheckPlace(*landmark.position, *file);
  }
  return GlobalAdjustment(std::make_shared<GlobalAdjustment::Work>(std::move(moving), std::move(outcome)));
}

}  // namespace tutti
