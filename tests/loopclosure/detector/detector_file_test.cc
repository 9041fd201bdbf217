// LoopDetector::Save and Load.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include "core/section_file.h"
#include "core/state_archive.h"
#include "loopclosure/detector/detector_file.h"
#include "loopclosure/geometry/verification.h"
#include "tests/loopclosure/detector/two_laps.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/detector.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::Walk;

constexpr int kFilePlaces = 14;

LoopDetectorOptions BoundedOptions() {
  LoopDetectorOptions options = testing::SmallOptions();
  options.wm_limit = 7;
  options.threads = 1;
  return options;
}

std::string Content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return std::string((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
}

void WriteContent(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

class SavedDetector : public ::testing::Test {
 protected:
  // Saved after 20 images, and loaded: both see the same from then on.
  void ExpectToGoOnExactly(const LoopDetectorOptions& options) {
    LoopDetector saved(options);
    Walk(saved, 0, 20, kFilePlaces);
    saved.Save(file_);
    LoopDetector loaded(options);
    loaded.Load(file_);
    testing::ExpectEqual(Walk(saved, 20, 28, kFilePlaces), Walk(loaded, 20, 28, kFilePlaces));
  }

  fs::path folder_ = testing::FreshFolder();
  fs::path file_ = folder_ / "places.tutti";
};

// All of the second lap that can be merged into the first is.
TEST_F(SavedDetector, MergedLocationsAreForgottenAndTheirPlacesFoundInTheOlderOnes) {
  for (const MemoryKind memory : {MemoryKind::kShared, MemoryKind::kPerMember}) {
    LoopDetectorOptions options = testing::SmallOptions();
    if (memory == MemoryKind::kPerMember) SetRule("mean", options);
    options.memory = memory;
    LoopDetector whole(options);
    Walk(whole, 0, 24, kFilePlaces);
    whole.Save(file_);
    const auto size = fs::file_size(file_);
    LoopDetector merged(options);
    merged.Load(file_);
    EXPECT_FALSE(merged.Merge(23, 23 - kFilePlaces)) << "the newest stays";
    EXPECT_FALSE(merged.Merge(3, 17)) << "only into an older one";
    EXPECT_FALSE(merged.Merge(99, 3));
    EXPECT_FALSE(merged.Merge(22, 99));
    for (int id = kFilePlaces; id < 23; ++id) EXPECT_TRUE(merged.Merge(id, id - kFilePlaces)) << id;
    EXPECT_TRUE(merged.Merge(20, 3)) << "it is merged already";
    EXPECT_EQ(merged.NumLocations(), kFilePlaces + 1u);
    merged.Save(file_);
    EXPECT_LT(static_cast<double>(fs::file_size(file_)), 0.8 * static_cast<double>(size));
    LoopDetector loaded(options);
    loaded.Load(file_);
    const std::vector<LoopResult> later = Walk(merged, 24, 42, kFilePlaces);
    testing::ExpectEqual(later, Walk(loaded, 24, 42, kFilePlaces));
    EXPECT_GE(testing::CountTrue(later, kFilePlaces), 15);
    for (const LoopResult& result : later) {
      const bool gone = result.accepted && result.candidate >= kFilePlaces && result.candidate < 23;
      EXPECT_FALSE(gone) << result.query;
    }
    EXPECT_EQ(testing::CountFalse(later, kFilePlaces), 0);
  }
}

TEST_F(SavedDetector, MergedLocationsOfLongTermMemoryAreNotSavedAndStayAwayFromItsFile) {
  LoopDetectorOptions options = BoundedOptions();
  options.ltm_file = (folder_ / "memory.ltm").string();
  std::size_t long_term = 0;
  {
    LoopDetector detector(options);
    Walk(detector, 0, 18, kFilePlaces);
    long_term = detector.NumLongTerm();
    ASSERT_GT(long_term, 3u);
    for (int id = 1; id < 12; ++id) EXPECT_TRUE(detector.Merge(id, 0));
    EXPECT_LT(detector.NumLongTerm(), long_term);
    detector.Save(file_);
    LoopDetectorOptions without = options;
    without.ltm_file.clear();
    LoopDetector loaded(without);
    loaded.Load(file_);
    EXPECT_EQ(loaded.NumLongTerm(), detector.NumLongTerm());
    testing::ExpectEqual(Walk(detector, 18, 24, kFilePlaces), Walk(loaded, 18, 24, kFilePlaces));
    long_term = detector.NumLongTerm();
  }
  const LoopDetector again(options);
  EXPECT_EQ(again.NumLongTerm(), long_term);
}

TEST_F(SavedDetector, ALoadedOneGoesOnExactlyAsTheSavedOne) {
  for (const char* rule : {"mean", "naive"}) {
    for (const MemoryKind memory : {MemoryKind::kShared, MemoryKind::kPerMember}) {
      LoopDetectorOptions options = BoundedOptions();
      SetRule(rule, options);
      options.memory = memory;
      LoopDetector saved(options);
      Walk(saved, 0, 18, kFilePlaces);
      EXPECT_GT(saved.NumLongTerm(), 0u);
      saved.Save(file_);
      LoopDetector loaded(options);
      Walk(loaded, 0, 3, kFilePlaces);  // what it knew before is replaced
      loaded.Load(file_);
      EXPECT_EQ(loaded.NumLocations(), saved.NumLocations());
      EXPECT_EQ(loaded.NumLongTerm(), saved.NumLongTerm());
      testing::ExpectEqual(Walk(saved, 18, 28, kFilePlaces), Walk(loaded, 18, 28, kFilePlaces));
    }
  }
}

TEST_F(SavedDetector, FlannsTreesGoOnExactlyToo) {
  LoopDetectorOptions options = BoundedOptions();
  options.vocabulary.float_index = FloatIndex::kFlann;
  ExpectToGoOnExactly(options);
}

TEST_F(SavedDetector, SavingChangesNothingAndTwiceGivesTheSameFile) {
  LoopDetector saved(BoundedOptions());
  LoopDetector other(BoundedOptions());
  Walk(saved, 0, 16, kFilePlaces);
  Walk(other, 0, 16, kFilePlaces);
  saved.Save(file_);
  saved.Save(folder_ / "again.tutti");
  EXPECT_TRUE(Content(file_) == Content(folder_ / "again.tutti"));
  testing::ExpectEqual(Walk(saved, 16, 22, kFilePlaces), Walk(other, 16, 22, kFilePlaces));
}

TEST_F(SavedDetector, AnEmptyOneCanBeSavedAndLoaded) {
  LoopDetector(BoundedOptions()).Save(file_);
  LoopDetector loaded(BoundedOptions());
  Walk(loaded, 0, 5, kFilePlaces);
  loaded.Load(file_);
  EXPECT_EQ(loaded.NumLocations(), 0u);
  EXPECT_EQ(loaded.LastId(), -1);
  EXPECT_NO_THROW(Walk(loaded, 0, 2, kFilePlaces));
}

TEST_F(SavedDetector, LoadingIntoAFileOfItsOwnFillsThatFile) {
  LoopDetector saved(BoundedOptions());
  Walk(saved, 0, 16, kFilePlaces);
  saved.Save(file_);
  LoopDetectorOptions options = BoundedOptions();
  options.ltm_file = (folder_ / "places.ltm").string();
  {
    LoopDetector durable(options);
    Walk(durable, 0, 4, kFilePlaces);
    durable.Load(file_);
    testing::ExpectEqual(Walk(saved, 16, 20, kFilePlaces), Walk(durable, 16, 20, kFilePlaces));
  }
  LoopDetector reopened(options);
  EXPECT_EQ(reopened.LastId(), 19);
  EXPECT_EQ(reopened.NumLocations() + reopened.NumLongTerm(), 20u);
}

// The message that loading fails with, after which the object must be as it was.
std::string RefusedFile(const fs::path& file) {
  LoopDetector detector(BoundedOptions());
  Walk(detector, 0, 6, kFilePlaces);
  std::string message;
  try {
    detector.Load(file);
  } catch (const InputError& error) {
    message = error.what();
  }
  EXPECT_EQ(detector.NumLocations(), 6u);
  EXPECT_EQ(detector.LastId(), 5);
  return message;
}

TEST_F(SavedDetector, OtherFilesVersionsAndMembersAreRefused) {
  LoopDetector saved(BoundedOptions());
  Walk(saved, 0, 5, kFilePlaces);
  saved.Save(file_);
  const std::string bytes = Content(file_);

  EXPECT_NE(RefusedFile(folder_ / "absent").find("no such file"), std::string::npos);
  WriteContent(folder_ / "text", "this is no detector at all");
  EXPECT_NE(RefusedFile(folder_ / "text").find("is no saved loop detector"), std::string::npos);
  std::string newer = bytes;
  ++newer[8];
  WriteContent(folder_ / "newer", newer);
  EXPECT_NE(RefusedFile(folder_ / "newer").find("version " + std::to_string(newer[8])), std::string::npos);

  LoopDetectorOptions options = BoundedOptions();
  options.members = {"orb"};
  LoopDetector other(options);
  try {
    other.Load(file_);
    FAIL() << "loaded with other members";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("surf sift orb"), std::string::npos) << error.what();
  }
}

TEST_F(SavedDetector, ADamagedFileIsRefusedWhereverItIsDamaged) {
  LoopDetector saved(BoundedOptions());
  Walk(saved, 0, 12, kFilePlaces);
  saved.Save(file_);
  const std::string bytes = Content(file_);
  const fs::path damaged = folder_ / "damaged";
  LoopDetector detector(BoundedOptions());
  Walk(detector, 0, 4, kFilePlaces);
  for (std::size_t i = 0; i < 60; ++i) {
    const std::size_t at = i * bytes.size() / 60;
    WriteContent(damaged, bytes.substr(0, at));
    EXPECT_THROW(detector.Load(damaged), InputError) << "cut off at " << at;
    std::string flipped = bytes;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
    WriteContent(damaged, flipped);
    EXPECT_THROW(detector.Load(damaged), InputError) << "another byte at " << at;
  }
  EXPECT_EQ(detector.NumLocations(), 4u);
  EXPECT_NO_THROW(Walk(detector, 4, 6, kFilePlaces));
}

// A saved detector with the content of all sections of one kind changed, under right checksums.
void Change(const fs::path& from, const fs::path& to, std::uint32_t kind,
            const std::function<std::string(const std::string&)>& change) {
  internal::SectionReader in(from, internal::kDetectorFile);
  internal::SectionWriter out(to, internal::kDetectorFile);
  std::string content;
  for (std::uint32_t tag = in.Next(&content); tag != internal::kEndOfSections; tag = in.Next(&content))
    out.Write(tag, tag == kind ? change(content) : content);
  out.Finish();
}

TEST_F(SavedDetector, FeaturesThatNoImageCouldHaveAreRefusedThoughTheChecksumsAreRight) {
  LoopDetector saved(BoundedOptions());
  Walk(saved, 0, 5, kFilePlaces);
  saved.Save(file_);
  const fs::path changed = folder_ / "changed";
  const auto load = [&](const std::function<void(View&)>& change) {
    Change(file_, changed, internal::kViewSection, [&](const std::string& section) {
      int slot = 0;
      View view;
      internal::ReadStateBytes(section, "test", slot, view);
      change(view);
      return internal::StateBytes(slot, view);
    });
    LoopDetector(BoundedOptions()).Load(changed);
  };
  EXPECT_NO_THROW(load([](View&) {}));
  EXPECT_THROW(load([](View& view) { view.id += 1000; }), InputError);
  EXPECT_THROW(load([](View& view) { view.size = {0, 0}; }), InputError);
  EXPECT_THROW(load([](View& view) { view.members.pop_back(); }), InputError);
  EXPECT_THROW(load([](View& view) { view.members[0].pixels[0].x = std::nanf(""); }), InputError);
  EXPECT_THROW(load([](View& view) { view.members[1].pixels[0].y = -1e30f; }), InputError);
}

TEST_F(SavedDetector, MemoriesOfOtherLocationsThanTheStatisticsSayAreRefused) {
  constexpr std::uint32_t kStatistics = 7;
  LoopDetector saved(BoundedOptions());
  Walk(saved, 0, 5, kFilePlaces);
  saved.Save(file_);
  const fs::path changed = folder_ / "changed";
  const auto load = [&](std::size_t at, const auto& value) {
    Change(file_, changed, kStatistics, [&](std::string section) {
      std::memcpy(section.data() + at, &value, sizeof value);
      return section;
    });
    LoopDetector(BoundedOptions()).Load(changed);
  };
  constexpr std::size_t kLastId = 0, kCallerType = 8;
  const std::size_t kLastHypothesis =
      16 + 16 * BoundedOptions().members.size();  // after those of the members
  EXPECT_NO_THROW(load(kLastId, std::int64_t{4}));
  EXPECT_THROW(load(kLastId, std::int64_t{3}), InputError);
  EXPECT_THROW(load(kLastHypothesis, std::numeric_limits<double>::quiet_NaN()), InputError);
  EXPECT_THROW(load(kCallerType, std::int32_t{77}), InputError);
}

TEST_F(SavedDetector, AFullDiskOrNoFolderIsSaidAndTheOldFileStays) {
  LoopDetector saved(BoundedOptions());
  Walk(saved, 0, 8, kFilePlaces);
  EXPECT_THROW(saved.Save(folder_ / "no" / "such" / "folder"), InputError);
  saved.Save(file_);
  const std::string before = Content(file_);
  Walk(saved, 8, 9, kFilePlaces);
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit limit{};
  getrlimit(RLIMIT_FSIZE, &limit);
  const rlimit little = {64 << 10, limit.rlim_max};
  setrlimit(RLIMIT_FSIZE, &little);
  EXPECT_THROW(saved.Save(file_), InputError);
  setrlimit(RLIMIT_FSIZE, &limit);
  EXPECT_TRUE(Content(file_) == before);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

}  // namespace
}  // namespace tutti
