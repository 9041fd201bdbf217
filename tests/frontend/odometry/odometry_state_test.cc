// Odometry::SaveSections and LoadSections: saved and loaded at any frame, it goes on as if nothing had been.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <future>
#include <iterator>
#include <random>

#include "core/section_file.h"
#include "tests/support/error_of.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::Black;
using ::testing::HasSubstr;
using testing::Recording;
using testing::Snow;

constexpr internal::SectionFileKind kFile = {{'T', 'E', 'S', 'T', 'O', 'D', 'O', '\n'}, 1, "test", "a test"};
constexpr std::uint32_t kKeyframe = 101, kLandmarks = 102, kTimes = 104;

struct Section {
  std::uint32_t tag = 0;
  std::string bytes;
  bool operator==(const Section& other) const { return tag == other.tag && bytes == other.bytes; }
};
using Sections = std::vector<Section>;

template <class Object>  // Odometry, GlobalAdjustment
Sections SectionsOf(const Object& object) {
  Sections sections;
  object.SaveSections([&](std::uint32_t tag, std::string_view bytes) {
    sections.push_back({tag, std::string(bytes)});
  });
  return sections;
}

Sections WithoutTimes(Sections sections) {
  sections.erase(std::remove_if(sections.begin(), sections.end(),
                                [](const Section& section) { return section.tag == kTimes; }),
                 sections.end());
  return sections;
}

// Which one differs says more than their bytes.
void ExpectEqual(const Sections& a, const Sections& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_TRUE(a[i] == b[i]) << "section " << i << ", tag " << a[i].tag;
}

void Write(const fs::path& file, const Sections& sections) {
  internal::SectionWriter out(file, kFile);
  for (const Section& section : sections) out.Write(section.tag, section.bytes);
  out.Finish();
}

void Load(const fs::path& file, Odometry* odometry) {
  internal::SectionReader in(file, kFile);
  odometry->LoadSections(&in);
}

constexpr std::size_t kFrames = 44, kDark = 14, kLoop = 20, kEnter = 24, kElsewhere = 28, kBack = 34;

// 44 frames: a covered lens, a loop that bends the map, an adjustment of everything, and a while elsewhere
// after which another piece begins.
Recording Ride(Sensor sensor) {
  SyntheticOptions options = testing::SmallStereoTown(400, 200);
  if (sensor == Sensor::kRgbd) {
    options.scene = SyntheticScene::kRoom;
    options.sensor = SyntheticSensor::kRgbd;
    options.height = 300;
  }
  Recording ride = testing::Record(testing::RenderedWorld(options), kFrames);
  if (sensor == Sensor::kMono) {
    ride.rig.sensor = Sensor::kMono;
    ride.rig.baseline_m = 0;
    for (InputFrame& frame : ride.frames) frame.right.release();
  }
  ride.frames[kDark] = Black(ride.frames[kDark]);
  for (std::size_t i = kElsewhere; i < kBack; ++i) ride.frames[i] = Snow(ride.frames[i]);
  return ride;
}

const Recording& RideOf(Sensor sensor) {
  static const std::map<Sensor, Recording> all = {{Sensor::kMono, Ride(Sensor::kMono)},
                                                  {Sensor::kStereo, Ride(Sensor::kStereo)},
                                                  {Sensor::kRgbd, Ride(Sensor::kRgbd)}};
  return all.at(sensor);
}

// An odometry on that ride, with what its owner does at times.
class Rider {
 public:
  explicit Rider(Sensor sensor, bool own_threads = true)
      : ride_(&RideOf(sensor)), odometry_(OptionsFor(ride_->rig), ride_->rig) {
    odometry_.UseOwnThreads(own_threads);
  }

  TrackResult Next() {
    const std::size_t i = next_++;
    TrackResult result = odometry_.Track(ride_->frames[i]);
    if (i == kLoop) Loop();
    if (i == kEnter && adjustment_) {
      const auto corrected = odometry_.CorrectionOf(*adjustment_);
      if (corrected) odometry_.Enter(*adjustment_, *corrected);
      entered_ = corrected.has_value();
      adjustment_.reset();
    }
    return result;
  }
  // The same, saved and loaded into objects that are new.
  Rider Again(const fs::path& file, bool own_threads = true) const {
    Sections sections = SectionsOf(odometry_);
    if (adjustment_) {
      for (Section& section : SectionsOf(*adjustment_)) sections.push_back(std::move(section));
    }
    Write(file, sections);
    Rider again = *this;
    again.odometry_ = Odometry(OptionsFor(ride_->rig), ride_->rig);
    again.odometry_.UseOwnThreads(own_threads);
    internal::SectionReader in(file, kFile);
    again.odometry_.LoadSections(&in);
    if (adjustment_) again.adjustment_ = again.odometry_.LoadGlobalAdjustment(&in);
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
    const std::vector<int> ids = odometry_.KeyframeIds();
    if (ids.size() < 3) return;
    std::map<int, Similarity> bent;
    for (const int id : ids) {
      const double way = 0.02 * id;
      bent[id] =
          Similarity(Pose(ExpSO3({0, 0.1 * way, 0}), {way, 0.3 * way, 0}) * odometry_.KeyframePose(id));
    }
    odometry_.ApplyCorrection(bent);
    const int a = ids[ids.size() - 3], b = ids.back();
    odometry_.FuseLoop(a, b, Similarity(odometry_.KeyframePose(a).Inverse() * odometry_.KeyframePose(b)));
    adjustment_ = odometry_.BeginGlobalAdjustment(0);
  }

  const Recording* ride_;
  Odometry odometry_;
  std::optional<GlobalAdjustment> adjustment_;
  std::size_t next_ = 0;
  bool entered_ = false;
};

void ExpectSame(const TrackResult& a, const TrackResult& b) {
  EXPECT_EQ(a.state, b.state);
  EXPECT_EQ(a.reason, b.reason);
  EXPECT_EQ(a.T_world_camera.Matrix(), b.T_world_camera.Matrix());
  EXPECT_EQ(a.features, b.features);
  EXPECT_EQ(a.inliers, b.inliers);
  EXPECT_EQ(a.keyframe, b.keyframe);
}

// What others see of an odometry.
void ExpectSame(const Odometry& a, const Odometry& b) {
  ASSERT_EQ(a.KeyframeIds(), b.KeyframeIds());
  for (const int id : a.KeyframeIds()) {
    const KeyframeView x = a.Keyframe(id), y = b.Keyframe(id);
    EXPECT_EQ(x.T_world_camera.Matrix(), y.T_world_camera.Matrix()) << id;
    EXPECT_EQ(x.landmarks, y.landmarks);
    EXPECT_EQ(x.map_piece, y.map_piece);
    ASSERT_EQ(x.points.size(), y.points.size());
    for (std::size_t f = 0; f < x.points.size(); ++f) {
      EXPECT_TRUE(x.points[f] == y.points[f] || (x.points[f].hasNaN() && y.points[f].hasNaN()));
      EXPECT_EQ(x.keypoints[f].pt, y.keypoints[f].pt);
      EXPECT_EQ(x.keypoints[f].size, y.keypoints[f].size);
      EXPECT_EQ(x.keypoints[f].angle, y.keypoints[f].angle);
      EXPECT_EQ(x.keypoints[f].response, y.keypoints[f].response);
      EXPECT_EQ(x.keypoints[f].octave, y.keypoints[f].octave);
      EXPECT_EQ(x.keypoints[f].class_id, y.keypoints[f].class_id);
    }
    EXPECT_TRUE(x.descriptors.empty() == y.descriptors.empty() &&
                (x.descriptors.empty() || cv::norm(x.descriptors, y.descriptors, cv::NORM_L1) == 0));
  }
  EXPECT_EQ(a.Pieces(), b.Pieces());
  for (const int piece : a.Pieces()) {
    const Trajectory x = a.FrameTrajectory(piece), y = b.FrameTrajectory(piece);
    ASSERT_EQ(x.size(), y.size());
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_EQ(x[i].pose.Matrix(), y[i].pose.Matrix()) << i;
  }
  EXPECT_EQ(a.Covisibility(1), b.Covisibility(1));
}

class OdometryState : public ::testing::TestWithParam<Sensor> {
 protected:
  fs::path file_ = testing::FreshFolder() / "odometry.tutti";
};

std::string SensorName(const ::testing::TestParamInfo<Sensor>& info) { return WordOf(info.param); }
INSTANTIATE_TEST_SUITE_P(All, OdometryState, ::testing::Values(Sensor::kMono, Sensor::kStereo, Sensor::kRgbd),
                         SensorName);

TEST_P(OdometryState, SavedAndLoadedAfterEachFrameItIsTheOneThatNeverWas) {
  Rider plain(GetParam(), false), handed_on(GetParam());
  std::map<TrackingState, int> states;
  int keyframes = 0;
  while (plain.next() < kFrames) {
    const TrackResult expected = plain.Next();
    ExpectSame(handed_on.Next(), expected);
    ++states[expected.state];
    keyframes += expected.keyframe >= 0 ? 1 : 0;
    const Sections before = SectionsOf(handed_on.odometry());
    handed_on = handed_on.Again(file_);
    ExpectEqual(SectionsOf(handed_on.odometry()), before);
    ExpectEqual(WithoutTimes(before), WithoutTimes(SectionsOf(plain.odometry())));
    if (::testing::Test::HasFailure()) FAIL() << "after frame " << plain.next() - 1;
  }
  EXPECT_TRUE(plain.entered()) << "the adjustment";
  EXPECT_TRUE(handed_on.entered());
  EXPECT_GE(plain.odometry().Pieces().size(), 2U);
  EXPECT_GE(keyframes, 5);
  EXPECT_GT(states[TrackingState::kLost], 2);
  EXPECT_GT(states[TrackingState::kTracking], 20);
  plain.Finish();
  handed_on.Finish();
  ExpectSame(plain.odometry(), handed_on.odometry());
}

TEST_P(OdometryState, SavedOnceItGoesOnAsTheOneThatWentOn) {
  for (const std::size_t k : {std::size_t(1), kLoop + 1, kElsewhere + 5}) {
    Rider run(GetParam());
    while (run.next() < k) run.Next();
    Rider again = run.Again(file_, false);
    EXPECT_EQ(run.odometry().StageMilliseconds(), again.odometry().StageMilliseconds());
    while (run.next() < kFrames) ExpectSame(again.Next(), run.Next());
    ExpectEqual(WithoutTimes(SectionsOf(again.odometry())), WithoutTimes(SectionsOf(run.odometry())));
    run.Finish();
    again.Finish();
    ExpectSame(run.odometry(), again.odometry());
  }
}

TEST_P(OdometryState, ACopyIsSavedOnAnotherThreadWhileTheOriginalGoesOn) {
  Rider run(GetParam());
  while (run.next() < kLoop) run.Next();
  const Sections expected = SectionsOf(run.odometry());
  for (int i = 0; i < 4; ++i) {
    auto saved =
        std::async(std::launch::async, [copy = std::make_unique<Odometry>(run.odometry())]() mutable {
          Sections sections = SectionsOf(*copy);
          copy.reset();
          return sections;
        });
    const Sections now = i == 0 ? expected : SectionsOf(Odometry(run.odometry()));
    run.Next();
    run.Next();
    ExpectEqual(saved.get(), now);
  }
}

class DamagedOdometryState : public ::testing::Test {
 protected:
  DamagedOdometryState() {
    while (run_.next() < 10) run_.Next();
    sections_ = SectionsOf(run_.odometry());
    Write(file_, sections_);
    std::ifstream in(file_, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    while (other_.next() < 4) other_.Next();
    before_ = SectionsOf(other_.odometry());
  }
  void WriteBytes(const std::string& bytes) const { std::ofstream(file_, std::ios::binary) << bytes; }
  std::string Error(Odometry* odometry) const {
    return testing::ErrorOf([&] { Load(file_, odometry); });
  }
  // Refused with these words, and the object is as it was.
  void ExpectRefused(const std::string& words) {
    Odometry odometry = other_.odometry();
    const std::string error = Error(&odometry);
    EXPECT_THAT(error, HasSubstr(words));
    EXPECT_THAT(error, HasSubstr(file_.string()));
    ExpectEqual(SectionsOf(odometry), before_);
  }

  fs::path file_ = testing::FreshFolder() / "odometry.tutti";
  Rider run_{Sensor::kStereo}, other_{Sensor::kStereo};
  Sections sections_, before_;
  std::string bytes_;
};

TEST_F(DamagedOdometryState, UndamagedItIsTaken) {
  Odometry odometry = other_.odometry();
  EXPECT_EQ(Error(&odometry), "no error");
  ExpectEqual(SectionsOf(odometry), sections_);
}

TEST_F(DamagedOdometryState, CutOffBeforeOrWithinASectionItIsRefused) {
  std::size_t at = 16;  // magic, version, byte order
  for (const Section& section : sections_) {
    internal::SectionHeader header;
    std::memcpy(&header, bytes_.data() + at, sizeof header);
    const std::size_t content = at + sizeof header;
    for (const std::size_t size : {at, content, content + header.stored / 2}) {
      if (section == sections_.back() && size > at) continue;  // complete
      WriteBytes(bytes_.substr(0, size));
      ExpectRefused("is damaged");
    }
    at = content + header.stored;
  }
  EXPECT_EQ(at + sizeof(internal::SectionHeader), bytes_.size()) << "of the end";
}

TEST_F(DamagedOdometryState, AFlippedBitIsFound) {
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    // The end of the file is read by whoever opened it.
    const std::size_t at = 16 + random() % (bytes_.size() - 16 - sizeof(internal::SectionHeader));
    std::string damaged = bytes_;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << random() % 8));
    WriteBytes(damaged);
    SCOPED_TRACE("byte " + std::to_string(at) + " of " + std::to_string(bytes_.size()));
    ExpectRefused("is damaged");
  }
}

TEST_F(DamagedOdometryState, ASectionThatIsMissingOrTwiceThereIsFound) {
  for (std::size_t i = 0; i < sections_.size(); ++i) {
    Sections damaged = sections_;
    damaged.erase(damaged.begin() + static_cast<std::ptrdiff_t>(i));
    Write(file_, damaged);
    ExpectRefused("is damaged");
    if (i + 1 == sections_.size()) break;  // what comes after the end is somebody else's
    damaged = sections_;
    damaged.insert(damaged.begin() + static_cast<std::ptrdiff_t>(i), sections_[i]);
    Write(file_, damaged);
    ExpectRefused("is damaged");
  }
}

TEST_F(DamagedOdometryState, WrongNumbersWithRightChecksumsAreRefusedOrHarmless) {
  std::mt19937 random(5);
  int refused = 0, taken = 0;
  for (int i = 0; i < 200; ++i) {
    Sections damaged = sections_;
    Section& section = damaged[random() % damaged.size()];
    if (section.bytes.size() < 8) continue;
    const std::uint32_t values[] = {
        0xffffffff, 0x7fffffff, 0x80000000, 0x7fc00000, 1000000, 3, std::uint32_t(random())};
    // The images and descriptors are most of it, and can't be wrong: mostly what comes before and after.
    std::size_t at = random() % (section.bytes.size() - 4);
    if (i % 2 == 0) at = random() % 2 == 0 ? at % 256 : section.bytes.size() - 4 - at % 256;
    at = std::min(at, section.bytes.size() - 4);
    std::memcpy(&section.bytes[at], &values[random() % std::size(values)], 4);
    Write(file_, damaged);
    Odometry odometry = other_.odometry();
    const std::string error = Error(&odometry);
    if (error != "no error") {
      EXPECT_THAT(error, HasSubstr(file_.string()));
      ++refused;
      continue;
    }
    ++taken;
    for (std::size_t k = 10; k < 12; ++k) odometry.Track(RideOf(Sensor::kStereo).frames[k]);
    odometry.FinishMapping();
    odometry.FrameTrajectory();
    for (const int id : odometry.KeyframeIds()) odometry.Keyframe(id);
  }
  EXPECT_GT(refused, 50);
  EXPECT_GT(taken, 20);
}

// What is at this place of the first section with this tag becomes another number, under a right checksum.
template <class T>
Sections WithValue(Sections sections, std::uint32_t tag, std::size_t at, T value) {
  const auto section =
      std::find_if(sections.begin(), sections.end(), [&](const Section& s) { return s.tag == tag; });
  std::memcpy(&section->bytes.at(at), &value, sizeof value);
  return sections;
}

TEST_F(DamagedOdometryState, WrongNumbersAreCalledByTheirName) {
  Write(file_, WithValue(sections_, kKeyframe, 0, 1));
  ExpectRefused("an index out of range");
  Write(file_, WithValue(sections_, kKeyframe, 28, std::nan("")));
  ExpectRefused("a rotation that is none");
  const auto landmarks = std::find_if(sections_.begin(), sections_.end(),
                                      [](const Section& section) { return section.tag == kLandmarks; });
  std::size_t alive = 0;
  while (landmarks->bytes.at(alive) == 0) alive += 1 + sizeof(int);  // a dead one: what replaced it
  Write(file_, WithValue(sections_, kLandmarks, alive + 1, std::nan("")));
  ExpectRefused("a place that is none");
  Write(file_, WithValue(sections_, kLandmarks, alive + 1, 1e300));
  ExpectRefused("a place that is none");
}

TEST_F(DamagedOdometryState, AnotherRigOrPyramidIsRefused) {
  const CameraRig& rig = RideOf(Sensor::kStereo).rig;
  const auto error = [&](const OdometryOptions& options, const CameraRig& other) {
    Odometry odometry(options, other);
    return Error(&odometry);
  };
  CameraRig other = rig;
  other.camera.fx += 1e-9;
  EXPECT_THAT(error({}, other), HasSubstr("another camera"));
  other = rig;
  other.baseline_m *= 2;
  EXPECT_THAT(error({}, other), HasSubstr("baseline"));
  other = rig;
  other.sensor = Sensor::kMono;
  EXPECT_THAT(error({}, other), HasSubstr("stereo"));
  OdometryOptions options;
  options.pyramid_levels = 7;
  EXPECT_THAT(error(options, rig), HasSubstr("7 pyramid levels"));
  options = {};
  options.features = 900;
  EXPECT_EQ(error(options, rig), "no error") << "may differ";
}

TEST_F(DamagedOdometryState, AnAdjustmentOfAnotherMapIsRefused) {
  while (run_.next() <= kLoop + 1) run_.Next();
  Write(file_, SectionsOf(run_.odometry().BeginGlobalAdjustment(0)));
  internal::SectionReader in(file_, kFile);
  EXPECT_THAT(testing::ErrorOf([&] { other_.odometry().LoadGlobalAdjustment(&in); }),
              HasSubstr("is damaged"));
}

}  // namespace
}  // namespace tutti
