// An odometry on a ride on which everything happens that its state must hold, and its state in a file.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/section_file.h"
#include "frontend/odometry/odometry_file.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"

namespace tutti::testing {

constexpr internal::SectionFileKind kStateFile = {
    {'T', 'E', 'S', 'T', 'O', 'D', 'O', '\n'}, 1, "test", "a test"};
constexpr std::uint32_t kKeyframe = 101, kLandmarks = 102, kTimes = 104;

struct SavedSection {
  std::uint32_t tag = 0;
  std::string bytes;
  bool operator==(const SavedSection& other) const { return tag == other.tag && bytes == other.bytes; }
};
using Sections = std::vector<SavedSection>;

template <class Object>  // Odometry, GlobalAdjustment
Sections SectionsOf(const Object& object) {
  Sections sections;
  OdometryFile::Save(object, [&](std::uint32_t tag, std::string_view bytes) {
    sections.push_back({tag, std::string(bytes)});
  });
  return sections;
}

inline Sections WithoutTimes(Sections sections) {
  sections.erase(std::remove_if(sections.begin(), sections.end(),
                                [](const SavedSection& section) { return section.tag == kTimes; }),
                 sections.end());
  return sections;
}

// Which one differs says more than their bytes.
inline void ExpectEqual(const Sections& a, const Sections& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_TRUE(a[i] == b[i]) << "section " << i << ", tag " << a[i].tag;
}

inline void WriteSections(const std::filesystem::path& file, const Sections& sections) {
  internal::SectionWriter out(file, kStateFile);
  for (const SavedSection& section : sections) out.Write(section.tag, section.bytes);
  out.Finish();
}

inline void LoadOdometry(const std::filesystem::path& file, Odometry* odometry) {
  internal::SectionReader in(file, kStateFile);
  OdometryFile::Load(&in, odometry);
}

constexpr std::size_t kFrames = 44, kDark = 14, kLoop = 20, kEnter = 24, kElsewhere = 28, kBack = 34;

// 44 frames: a covered lens, a loop that bends the map, an adjustment of everything, and a while elsewhere
// after which another piece begins.
inline Recording Ride(Sensor sensor) {
  SyntheticOptions options = SmallStereoTown(400, 200);
  if (sensor == Sensor::kRgbd) {
    options.scene = SyntheticScene::kRoom;
    options.sensor = SyntheticSensor::kRgbd;
    options.height = 300;
  }
  Recording ride = Record(RenderedWorld(options), kFrames);
  if (sensor == Sensor::kMono) {
    ride.rig.sensor = Sensor::kMono;
    ride.rig.baseline_m = 0;
    for (InputFrame& frame : ride.frames) frame.right.release();
  }
  ride.frames[kDark] = Black(ride.frames[kDark]);
  for (std::size_t i = kElsewhere; i < kBack; ++i) ride.frames[i] = Snow(ride.frames[i]);
  return ride;
}

inline const Recording& RideOf(Sensor sensor) {
  static std::map<Sensor, Recording> all;
  const auto found = all.find(sensor);
  return found != all.end() ? found->second : all.emplace(sensor, Ride(sensor)).first->second;
}

// An odometry on that ride, with what its owner does at times.
class Rider {
 public:
  explicit Rider(Sensor sensor, bool own_threads = true)
      : ride_(&RideOf(sensor)), odometry_(OptionsFor(ride_->rig), ride_->rig, {own_threads, nullptr}) {}

  TrackResult Next() {
    const std::size_t i = next_++;
    TrackResult result = odometry_.Track(ride_->frames[i]);
    if (i == kLoop) Loop();
    if (i == kEnter && adjustment_) {
      const auto corrected = adjustment_->Correction(odometry_.map());
      if (corrected)
        odometry_.Correct({*corrected, {}, std::make_shared<const GlobalAdjustment>(*adjustment_), {}});
      entered_ = corrected.has_value();
      adjustment_.reset();
    }
    return result;
  }
  // The same, saved and loaded into objects that are new.
  Rider Again(const std::filesystem::path& file, bool own_threads = true) const {
    Sections sections = SectionsOf(odometry_);
    if (adjustment_) {
      for (SavedSection& section : SectionsOf(*adjustment_)) sections.push_back(std::move(section));
    }
    WriteSections(file, sections);
    Rider again = *this;
    again.odometry_ = Odometry(OptionsFor(ride_->rig), ride_->rig, {own_threads, nullptr});
    internal::SectionReader in(file, kStateFile);
    OdometryFile::Load(&in, &again.odometry_);
    if (adjustment_) again.adjustment_ = OdometryFile::LoadAdjustment(again.odometry_.map(), &in);
    return again;
  }
  void Finish() { odometry_.FinishMapping(); }

  const Odometry& odometry() const { return odometry_; }
  std::size_t next() const { return next_; }
  bool entered() const { return entered_; }

 private:
  static OdometryOptions OptionsFor(const CameraRig& rig) {
    OdometryOptions options;
    options.features = 700;
    options.relocalize_s = 3.5 / rig.rate_hz;
    options.mapping_delay_frames = rig.sensor == Sensor::kMono ? 1 : 3;  // so that frames come meanwhile
    return options;
  }
  void Loop() {
    const std::vector<int> ids = odometry_.map().KeyframeIds();
    if (ids.size() < 3) return;
    std::map<int, Similarity> bent;
    for (const int id : ids) {
      const double way = 0.02 * id;
      bent[id] = Similarity(Pose(ExpSO3({0, 0.1 * way, 0}), {way, 0.3 * way, 0}) *
                            odometry_.map().keyframe(id).T_world_camera);
    }
    odometry_.Correct({bent, {}, {}, {}});
    const int a = ids[ids.size() - 3], b = ids.back();
    const Pose T_a_b =
        odometry_.map().keyframe(a).T_world_camera.Inverse() * odometry_.map().keyframe(b).T_world_camera;
    odometry_.Correct({{}, {}, {}, {{a, b, Similarity(T_a_b)}}});
    adjustment_ = AdjustGlobally(odometry_, 0);
  }

  const Recording* ride_;
  Odometry odometry_;
  std::optional<GlobalAdjustment> adjustment_;
  std::size_t next_ = 0;
  bool entered_ = false;
};

}  // namespace tutti::testing
