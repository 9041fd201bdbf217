// OdometryFile::Load of damaged files: refused by name, and nothing has changed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

#include "tests/frontend/odometry/odometry_rider.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::ExpectEqual;
using ::testing::HasSubstr;
using testing::kKeyframe;
using testing::kLandmarks;
using testing::kLoop;
using testing::kStateFile;
using testing::RideOf;
using testing::Rider;
using testing::SavedSection;
using testing::Sections;
using testing::SectionsOf;

class DamagedOdometryState : public ::testing::Test {
 protected:
  DamagedOdometryState() {
    while (run_.next() < 10) run_.Next();
    sections_ = SectionsOf(run_.odometry());
    testing::WriteSections(file_, sections_);
    std::ifstream in(file_, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    while (other_.next() < 4) other_.Next();
    before_ = SectionsOf(other_.odometry());
  }
  void WriteBytes(const std::string& bytes) const { std::ofstream(file_, std::ios::binary) << bytes; }
  std::string Error(Odometry* odometry) const {
    return testing::ErrorOf([&] { testing::LoadOdometry(file_, odometry); });
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
  for (const SavedSection& section : sections_) {
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
    testing::WriteSections(file_, damaged);
    ExpectRefused("is damaged");
    if (i + 1 == sections_.size()) break;  // what comes after the end is somebody else's
    damaged = sections_;
    damaged.insert(damaged.begin() + static_cast<std::ptrdiff_t>(i), sections_[i]);
    testing::WriteSections(file_, damaged);
    ExpectRefused("is damaged");
  }
}

TEST_F(DamagedOdometryState, WrongNumbersWithRightChecksumsAreRefusedOrHarmless) {
  std::mt19937 random(5);
  int refused = 0, taken = 0;
  for (int i = 0; i < 200; ++i) {
    Sections damaged = sections_;
    SavedSection& section = damaged[random() % damaged.size()];
    if (section.bytes.size() < 8) continue;
    const std::uint32_t values[] = {
        0xffffffff, 0x7fffffff, 0x80000000, 0x7fc00000, 1000000, 3, std::uint32_t(random())};
    // The images and descriptors are most of it, and can't be wrong: mostly what comes before and after.
    std::size_t at = random() % (section.bytes.size() - 4);
    if (i % 2 == 0) at = random() % 2 == 0 ? at % 256 : section.bytes.size() - 4 - at % 256;
    at = std::min(at, section.bytes.size() - 4);
    std::memcpy(&section.bytes[at], &values[random() % std::size(values)], 4);
    testing::WriteSections(file_, damaged);
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
    FrameTrajectory(odometry.map());
    for (const int id : odometry.map().KeyframeIds()) ViewOf(odometry.map(), id);
  }
  EXPECT_GT(refused, 50);
  EXPECT_GT(taken, 20);
}

// What is at this place of the first section with this tag becomes another number, under a right checksum.
template <class T>
Sections WithValue(Sections sections, std::uint32_t tag, std::size_t at, T value) {
  const auto section =
      std::find_if(sections.begin(), sections.end(), [&](const SavedSection& s) { return s.tag == tag; });
  std::memcpy(&section->bytes.at(at), &value, sizeof value);
  return sections;
}

TEST_F(DamagedOdometryState, WrongNumbersAreCalledByTheirName) {
  testing::WriteSections(file_, WithValue(sections_, kKeyframe, 0, 1));
  ExpectRefused("an index out of range");
  testing::WriteSections(file_, WithValue(sections_, kKeyframe, 28, std::nan("")));
  ExpectRefused("a rotation that is none");
  const auto landmarks = std::find_if(sections_.begin(), sections_.end(),
                                      [](const SavedSection& section) { return section.tag == kLandmarks; });
  std::size_t alive = 0;
  while (landmarks->bytes.at(alive) == 0) alive += 1 + sizeof(int);  // a dead one: what replaced it
  testing::WriteSections(file_, WithValue(sections_, kLandmarks, alive + 1, std::nan("")));
  ExpectRefused("a place that is none");
  testing::WriteSections(file_, WithValue(sections_, kLandmarks, alive + 1, 1e300));
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
  testing::WriteSections(file_, SectionsOf(AdjustGlobally(run_.odometry(), 0)));
  internal::SectionReader in(file_, kStateFile);
  EXPECT_THAT(testing::ErrorOf([&] { OdometryFile::LoadAdjustment(other_.odometry().map(), &in); }),
              HasSubstr("is damaged"));
}

}  // namespace
}  // namespace tutti
