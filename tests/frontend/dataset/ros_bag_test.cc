// Bags as librosbag wrote them (bags/, by rosbag 1.15 of Debian 12), and damaged ones.
#include "frontend/dataset/bag.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/bag_writer.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::BagPacking, testing::BagWriter, testing::ErrorOf, testing::FreshFile;
using ::testing::HasSubstr;

std::string Message(int i) { return std::string(12, '\0') + "message " + std::to_string(i); }

BagWriter FourChunks(BagPacking packing) {
  BagWriter bag(packing);
  for (int i = 0; i < 4; ++i) bag.Write("/a", "any/Type", Message(i));
  return bag;
}

std::string Of(BagPacking packing) { return FourChunks(packing).Finish(); }

std::vector<std::string> All(const Bag& bag) {
  std::vector<std::string> texts;
  for (const BagMessage& message : bag.Messages("/a")) texts.push_back(bag.Read(message));
  return texts;
}

class EveryPacking : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryPacking, OfLibrosbagIsRead) {
  const auto bag = Bag::Open(testing::SourceDir() / "tests/frontend/dataset/bags" / (GetParam() + ".bag"));
  EXPECT_EQ(bag->damage(), "");
  ASSERT_EQ(bag->topics().size(), 3u);
  EXPECT_EQ(bag->topics()[0].name, "/left/camera_info");
  EXPECT_EQ(bag->topics()[1].type, "sensor_msgs/Image");
  EXPECT_EQ(bag->topics()[2].type, "sensor_msgs/CompressedImage");
  const std::vector<BagMessage> images = bag->Messages("/left/image");
  ASSERT_EQ(images.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    EXPECT_DOUBLE_EQ(images[k].stamp_s, 100.5 + i);
    const cv::Mat image = testing::Picture(16, 12, i);
    const std::string bytes = bag->Read(images[k]);
    EXPECT_EQ(bytes.substr(bytes.size() - image.total()), std::string(image.datastart, image.dataend));
  }
}
INSTANTIATE_TEST_SUITE_P(RosBag, EveryPacking, ::testing::Values("plain", "bz2", "lz4"),
                         [](const auto& tested) { return tested.param; });

TEST(RosBag, MessagesInAnyOrder) {
  for (const BagPacking packing : {BagPacking::kPlain, BagPacking::kBz2, BagPacking::kLz4}) {
    const auto bag = Bag::Open(FreshFile("x.bag", Of(packing)));
    const std::vector<BagMessage> messages = bag->Messages("/a");
    ASSERT_EQ(messages.size(), 4u);
    for (const std::size_t i : {3u, 0u, 2u, 2u, 1u})
      EXPECT_EQ(bag->Read(messages[i]), Message(static_cast<int>(i)));
    EXPECT_TRUE(bag->Messages("/b").empty());
  }
}

TEST(RosBag, CutOffWhileRecordingGivesWhatLiesBefore) {
  BagWriter open(BagPacking::kPlain, 1000000);
  for (int i = 0; i < 4; ++i) open.Write("/a", "any/Type", Message(i));
  const std::string bytes = open.Finish(true);
  EXPECT_THAT(All(*Bag::Open(FreshFile("open.bag", bytes))),
              ::testing::ElementsAre(Message(0), Message(1), Message(2), Message(3)));
  const auto cut = Bag::Open(FreshFile("cut.bag", bytes.substr(0, bytes.size() - 5)));
  EXPECT_EQ(cut->Messages("/a").size(), 3u);
  EXPECT_THAT(cut->damage(), HasSubstr("was cut off while recording, at byte "));
}

TEST(RosBag, ACutAnywhereGivesTheMessagesBeforeIt) {
  for (const BagPacking packing : {BagPacking::kPlain, BagPacking::kBz2, BagPacking::kLz4}) {
    const std::string bytes = Of(packing);
    std::size_t before = 0;
    for (std::size_t size = 13; size < bytes.size(); size += 7) {
      const auto bag = Bag::Open(FreshFile("x.bag", bytes.substr(0, size)));
      const std::vector<std::string> messages = All(*bag);
      EXPECT_GE(messages.size(), before);
      before = messages.size();
      for (std::size_t i = 0; i < messages.size(); ++i) EXPECT_EQ(messages[i], Message(static_cast<int>(i)));
    }
    EXPECT_EQ(before, 4u);
  }
}

TEST(RosBag, ADamagedChunkIsCountedByItsIndexAndTheOthersAreRead) {
  std::string bytes = Of(BagPacking::kLz4);
  std::size_t chunk = 0;
  for (int i = 0; i < 2; ++i) chunk = bytes.find("compression=lz4", chunk + 1);
  for (std::size_t i = 50; i < 90; ++i) bytes[chunk + i] = '\xff';
  const auto bag = Bag::Open(FreshFile("x.bag", bytes));
  EXPECT_THAT(All(*bag), ::testing::ElementsAre(Message(0), Message(2), Message(3)));
  EXPECT_EQ(bag->Lost("/a"), 1u);
  EXPECT_THAT(bag->damage(), HasSubstr("can't be unpacked"));
}

// Who reads a frame says which file it is of.
TEST(RosBag, AMessageThatIsGoneIsSaidWithoutTheFilesName) {
  const std::filesystem::path file = FreshFile("x.bag", Of(BagPacking::kLz4));
  const auto bag = Bag::Open(file);
  const std::vector<BagMessage> messages = bag->Messages("/a");
  std::filesystem::resize_file(file, 20);
  const std::string error = ErrorOf([&] { bag->Read(messages.front()); });
  EXPECT_THAT(error, HasSubstr("can't be read"));
  EXPECT_EQ(error.find("x.bag"), std::string::npos) << error;
}

TEST(RosBag, ADamagedRecordLosesTheRestOfItsChunkAlone) {
  std::string bytes = Of(BagPacking::kPlain);
  const std::size_t second = bytes.find("message 1") - Message(0).size() - 60;
  const std::size_t op = bytes.find("op=\x02", second);
  ASSERT_NE(op, std::string::npos);
  bytes[op - 1] = '\x7f';  // the length of the field
  const auto bag = Bag::Open(FreshFile("x.bag", bytes));
  EXPECT_THAT(All(*bag), ::testing::ElementsAre(Message(0), Message(2), Message(3)));
  EXPECT_THAT(bag->damage(), HasSubstr("is damaged"));
}

TEST(RosBag, AFileThatIsAllHolesHasNoRecord) {
  const fs::path holes = FreshFile("x.bag", "#ROSBAG V2.0\n");
  fs::resize_file(holes, std::uintmax_t{1} << 40U);
  EXPECT_THAT(Bag::Open(holes)->damage(), HasSubstr("at byte 13"));
}

}  // namespace
}  // namespace tutti
