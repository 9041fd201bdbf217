// Bags of ROS 2 as others' programs wrote them (bags/make_ros2.mjs), damaged ones, and recordings in parts.
#include "frontend/dataset/bag.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <zstd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::Difference, testing::ErrorOf, testing::FreshFile, testing::FreshFolder;
using ::testing::HasSubstr;

fs::path OfOthers(const std::string& name) {
  return testing::SourceDir() / "tests/frontend/dataset/bags" / name;
}

std::string BytesOf(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// How many of the three images can be read, each of which must be the right one.
std::size_t ImagesOf(const Bag& bag) {
  const std::vector<BagMessage> images = bag.Messages("/left/image");
  std::size_t count = 0;
  for (const BagMessage& message : images) {
    MessageImage read;
    try {
      read = DecodeImageMessage(bag.Read(message), "sensor_msgs/Image", Serialization::kCdr, Pixels::kGrey);
    } catch (const InputError&) {  // it is gone since
      continue;
    }
    if (read.image.empty()) continue;
    const int i = static_cast<int>(message.stamp_s) - 100;
    EXPECT_DOUBLE_EQ(message.stamp_s, 100.5 + i);
    EXPECT_EQ(Difference(read.image, testing::Picture(16, 12, i)), 0);
    ++count;
  }
  return count;
}

class EveryFormat : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryFormat, OfOthersIsRead) {
  const auto bag = Bag::Open(OfOthers(GetParam()));
  EXPECT_EQ(bag->damage(), "");
  ASSERT_EQ(bag->topics().size(), 3u);
  EXPECT_EQ(bag->topics()[0].name, "/left/camera_info");
  EXPECT_EQ(bag->topics()[1].type, "sensor_msgs/Image");
  EXPECT_EQ(bag->topics()[1].serialization, Serialization::kCdr);
  EXPECT_EQ(bag->topics()[2].type, "sensor_msgs/CompressedImage");
  EXPECT_EQ(bag->Find("/right/image"), nullptr);
  EXPECT_EQ(bag->Messages("/left/image").size(), 3u);
  EXPECT_EQ(ImagesOf(*bag), 3u);
  EXPECT_EQ(bag->Lost("/left/image"), 0u);
  const std::vector<BagMessage> compressed = bag->Messages("/right/image/compressed");
  ASSERT_EQ(compressed.size(), 3u);
  const MessageImage picture = DecodeImageMessage(bag->Read(compressed[2]), "sensor_msgs/CompressedImage",
                                                  Serialization::kCdr, Pixels::kGrey);
  EXPECT_EQ(Difference(picture.image, testing::Picture(16, 12, 1)), 0) << picture.error;
  const CameraInfo info =
      DecodeCameraInfo(bag->Read(bag->Messages("/left/camera_info").at(1)), Serialization::kCdr, "x.mcap");
  EXPECT_EQ(info.Raw("").fy, 21);
  EXPECT_EQ(info.Raw("").cx, 8);
  EXPECT_EQ(info.Raw("").width, 16);
  EXPECT_EQ(info.Raw("").coefficients[4], 0.5);
  EXPECT_EQ(info.R[8], 1);
  EXPECT_EQ(info.P[6], 6);
  EXPECT_TRUE(info.window.IsWhole());
}

TEST_P(EveryFormat, ACutAnywhereGivesWhatLiesBefore) {
  const std::string bytes = BytesOf(OfOthers(GetParam()));
  std::size_t most = 0;
  for (std::size_t size = 0; size < bytes.size(); size += 61) {
    const fs::path file = FreshFile("cut", bytes.substr(0, size));
    std::size_t images = 0;
    const std::string error = ErrorOf([&] {
      const auto bag = Bag::Open(file);
      images = ImagesOf(*bag);
      // But for the eight bytes after the last record of MCAP.
      if (GetParam() != "sqlite.db3" && size + 8 < bytes.size()) {
        EXPECT_NE(bag->damage(), "") << size;
      }
    });
    if (images == 0) continue;
    EXPECT_EQ(error, "no error");
    EXPECT_GE(images, most) << size;
    most = images;
  }
  if (GetParam() != "sqlite.db3") {  // whose first page says how many there are
    EXPECT_EQ(most, 3u);
  }
}

TEST_P(EveryFormat, DamageAnywhereIsSaidAndCrashesNothing) {
  const std::string bytes = BytesOf(OfOthers(GetParam()));
  for (std::size_t at = 0; at < bytes.size(); at += 37) {
    std::string damaged = bytes;
    for (std::size_t i = at; i < std::min(at + 5, bytes.size()); ++i) damaged[i] = '\xff';
    const fs::path file = FreshFile("damaged", damaged);
    ErrorOf([&] {
      const auto bag = Bag::Open(file);
      for (const Bag::Topic& topic : bag->topics()) {
        for (const BagMessage& message : bag->Messages(topic.name)) {
          ErrorOf([&] {
            DecodeImageMessage(bag->Read(message), topic.type, topic.serialization, Pixels::kGrey);
          });
        }
      }
    });
  }
}
INSTANTIATE_TEST_SUITE_P(Bag, EveryFormat,
                         ::testing::Values("plain.mcap", "lz4.mcap", "zstd.mcap", "unchunked.mcap",
                                           "sqlite.db3"),
                         [](const auto& tested) {
                           std::string name = tested.param;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

TEST(Bag, ADamagedChunkOfMcapIsCountedByItsIndexAndTheOthersAreRead) {
  for (const char* packing : {"lz4", "zstd"}) {
    std::string bytes = BytesOf(OfOthers(std::string(packing) + ".mcap"));
    std::size_t chunk = 0;
    for (int i = 0; i < 2; ++i) chunk = bytes.find(packing, chunk + 1);
    ASSERT_NE(chunk, std::string::npos);
    for (std::size_t i = 60; i < 90; ++i) bytes[chunk + i] = '\xff';
    const auto bag = Bag::Open(FreshFile("x.mcap", bytes));
    EXPECT_GT(
        bag->Lost("/left/image") + bag->Lost("/left/camera_info") + bag->Lost("/right/image/compressed"), 0u);
    EXPECT_EQ(bag->Lost("/left/image") + ImagesOf(*bag), 3u) << packing;
    EXPECT_THAT(bag->damage(), HasSubstr("can't be unpacked"));
  }
}

// The sum of a chunk is what notices a changed byte in what Zstandard unpacks without a word.
TEST(Bag, AChunkWithAnotherSumIsDamaged) {
  std::string bytes = BytesOf(OfOthers("zstd.mcap"));
  const std::size_t packing = bytes.find("zstd");
  bytes[packing - 5] = static_cast<char>(bytes[packing - 5] ^ 1);
  EXPECT_THAT(Bag::Open(FreshFile("x.mcap", bytes))->damage(), HasSubstr("can't be unpacked"));
}

TEST(Bag, ARecordingInPartsIsOneInTheOrderOfTheirNumbers) {
  const fs::path folder = FreshFolder() / "recording";
  fs::create_directories(folder);
  fs::copy_file(OfOthers("plain.mcap"), folder / "recording_10.mcap");
  fs::copy_file(OfOthers("zstd.mcap"), folder / "recording_2.mcap");
  testing::WriteText(folder / "metadata.yaml", "rosbag2_bagfile_information:\n");
  const auto bag = Bag::Open(folder);
  EXPECT_EQ(bag->topics().size(), 3u);
  const std::vector<BagMessage> images = bag->Messages("/left/image");
  ASSERT_EQ(images.size(), 6u);
  EXPECT_GE(images[0].chunk, 0);  // zstd's
  EXPECT_EQ(images[3].chunk, -1);
  EXPECT_EQ(ImagesOf(*bag), 6u);
  EXPECT_EQ(bag->damage(), "");
  testing::WriteText(folder / "recording_11.mcap", "nothing");
  const auto with_damage = Bag::Open(folder);
  EXPECT_EQ(ImagesOf(*with_damage), 6u);
  EXPECT_THAT(with_damage->damage(), AllOf(HasSubstr("a part is skipped: "), HasSubstr("recording_11.mcap")));
}

// 'ros2 bag record --compression-mode message' leaves such a file.
TEST(Bag, MessagesThatAreCompressedEachForItselfAreUnpacked) {
  const fs::path file = FreshFolder() / "packed.db3";
  fs::copy_file(OfOthers("sqlite.db3"), file);
  fs::permissions(file, fs::perms::owner_write, fs::perm_options::add);
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  const auto zstd = [](sqlite3_context* context, int, sqlite3_value** values) {
    std::string packed(ZSTD_compressBound(static_cast<std::size_t>(sqlite3_value_bytes(*values))), '\0');
    packed.resize(ZSTD_compress(packed.data(), packed.size(), sqlite3_value_blob(*values),
                                static_cast<std::size_t>(sqlite3_value_bytes(*values)), 1));
    sqlite3_result_blob(context, packed.data(), static_cast<int>(packed.size()), SQLITE_TRANSIENT);
  };
  sqlite3_create_function(database, "zstd", 1, SQLITE_UTF8, nullptr, zstd, nullptr, nullptr);
  EXPECT_EQ(sqlite3_exec(database, "UPDATE messages SET data = zstd(data)", nullptr, nullptr, nullptr),
            SQLITE_OK);
  sqlite3_close(database);
  DatasetOptions options = testing::With(Sensor::kStereo, true);
  options.camera->width = options.camera->height = 0;
  options.camera->cx = options.camera->cy = 6;
  options.topic = "/left/image";
  options.right_topic = "/right/image/compressed";
  options.baseline_m = 0.5;
  const auto packed = OpenDataset(file, options), plain = OpenDataset(OfOthers("sqlite.db3"), options);
  ASSERT_EQ(packed->Size(), plain->Size());
  EXPECT_TRUE(packed->Warnings().empty());
  for (std::size_t i = 0; i < plain->Size(); ++i) {
    const ReadResult a = packed->Read(i), b = plain->Read(i);
    ASSERT_TRUE(a.frame && b.frame) << a.error << b.error;
    EXPECT_EQ(a.frame->stamp_s, b.frame->stamp_s);
    EXPECT_EQ(Difference(a.frame->image, b.frame->image), 0);
    EXPECT_EQ(Difference(a.frame->right, b.frame->right), 0);
  }
}

TEST(Bag, AFolderOfPackedFilesSaysHowToUnpackThem) {
  const fs::path folder = FreshFolder() / "recording";
  testing::WriteText(folder / "recording_0.db3.zstd", "\x28\xb5\x2f\xfd");
  testing::WriteText(folder / "recording_1.db3.zstd", "\x28\xb5\x2f\xfd");
  EXPECT_EQ(DetectDatasetType(folder), DatasetType::kBag);
  EXPECT_THAT(ErrorOf([&] { Bag::Open(folder); }), HasSubstr("unpack them: zstd -d " + folder.string()));
  fs::copy_file(OfOthers("sqlite.db3"), folder / "recording_0.db3");
  fs::copy_file(OfOthers("sqlite.db3"), folder / "recording_1.db3");
  EXPECT_EQ(Bag::Files(folder).size(), 2u);  // the packed ones that were unpacked do not count
}

TEST(Bag, WhatIsNoneIsRefused) {
  const auto error = [](const std::string& content) {
    return ErrorOf([&] { Bag::Open(FreshFile("x.bag", content)); });
  };
  EXPECT_THAT(error("no bag at all"), HasSubstr("begins neither with '#ROSBAG V2.0'"));
  EXPECT_THAT(error(""), HasSubstr("begins neither with"));
  EXPECT_THAT(error("SQLite format 3" + std::string(20, 'x')), HasSubstr("can't be read as a ROS bag"));
  EXPECT_THAT(error("\x28\xb5\x2f\xfd and so on"), HasSubstr("unpack it: zstd -d"));
  EXPECT_THAT(ErrorOf([] { Bag::Open(FreshFolder() / "none.bag"); }), HasSubstr("is missing"));
  EXPECT_THAT(ErrorOf([] { Bag::Open(FreshFolder()); }), HasSubstr("holds no files of 'ros2 bag record'"));
  const fs::path holes = FreshFile("x.mcap", "\x89MCAP0\r\n");
  fs::resize_file(holes, std::uintmax_t{1} << 40U);
  EXPECT_THAT(Bag::Open(holes)->damage(), HasSubstr("at byte 8"));
}

// The fuzzer found such a file: SQLite would have walked through it for as long as one had patience.
TEST(Bag, ADatabaseWhosePagesAreARingEnds) {
  EXPECT_THAT(Bag::Open(OfOthers("ring.db3"))->damage(), HasSubstr("rows are not in their order"));
}

TEST(Bag, ADatabaseThatRunsInsteadOfHoldingIsRefused) {
  const fs::path file = FreshFolder() / "x.db3";
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  const char* const endless =
      "CREATE TABLE topics(id, name, type, serialization_format);"
      "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
      "SELECT i AS id, 1 AS topic_id, 0 AS timestamp, x'00' AS data FROM n;";
  EXPECT_EQ(sqlite3_exec(database, endless, nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(database);
  EXPECT_THAT(ErrorOf([&] { Bag::Open(file); }), HasSubstr("no tables \"topics\" and \"messages\""));
}

}  // namespace
}  // namespace tutti
