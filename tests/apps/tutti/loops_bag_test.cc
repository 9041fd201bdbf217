// `tutti loops` on a bag of ROS.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/executable.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tests/support/bag_writer.h"
#include "tests/support/test_data.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;

constexpr int kBagPlaces = 15, kBagFrames = 20;

double StampOfFrame(int i) { return 1500 + 0.5 * i; }

// Frames 15 to 19 show the places of 0 to 4 again.
class LoopsOfABag : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "images");
    const std::string type = "sensor_msgs/Image";
    testing::BagWriter one, two;
    for (int i = 0; i < kBagFrames; ++i) {
      cv::Mat image = testing::TexturedImage(static_cast<std::uint32_t>(i % kBagPlaces));
      if (i >= kBagPlaces) image = testing::SeenAgain(image);
      cv::imwrite((folder_ / "images" / (std::to_string(i) + ".png")).string(), image);
      const std::string message =
          testing::ImageMessage(image, image.channels() == 3 ? "bgr8" : "mono8", StampOfFrame(i));
      one.Write("/left/image", type, message);
      two.Write("/left/image", type, message);
      two.Write("/right/image", type, message);
    }
    testing::WriteAll(folder_ / "one.bag", one.Finish());
    testing::WriteAll(folder_ / "two.bag", two.Finish());
  }

  testing::ProcessResult Loops(const std::string& images, const std::string& out,
                               const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words{
        "loops", (folder_ / images).string(), "--out", (folder_ / out).string(), "--set", "stm_size=3"};
    words.insert(words.end(), more.begin(), more.end());
    return RunTutti(words);
  }

  // Without the names of the images.
  std::string LoopsIn(const std::string& out) const {
    std::string text;
    for (const std::string& line : SplitText(ReadAll(folder_ / out / "loops.csv"), "\n"))
      text += line.substr(0, line.find(",\"")) + "\n";
    return text;
  }

  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(LoopsOfABag, AreThoseOfItsImages) {
  const auto of_bag = Loops("one.bag", "a"), of_images = Loops("images", "b");
  ASSERT_EQ(of_bag.status, 0) << of_bag.output;
  ASSERT_EQ(of_images.status, 0) << of_images.output;
  EXPECT_EQ(LoopsIn("a"), LoopsIn("b"));
  EXPECT_THAT(LoopsIn("a"), HasSubstr("\n17,2,"));
  EXPECT_THAT(ReadAll(folder_ / "a" / "loops.csv"), HasSubstr("\"frame 17\",\"frame 2\""));
}

TEST_F(LoopsOfABag, AreOfTheTopicThatIsNamed) {
  const auto which = Loops("two.bag", "which");
  EXPECT_EQ(which.status, 1);
  EXPECT_THAT(which.output, HasSubstr("Set --topic to one of: /left/image /right/image"));
  const auto right = Loops("two.bag", "right", {"--topic", "/right/image"});
  EXPECT_EQ(right.status, 0) << right.output;
  EXPECT_THAT(LoopsIn("right"), HasSubstr("\n17,2,"));
  const auto images = Loops("images", "images_out", {"--topic", "/right/image"});
  EXPECT_EQ(images.status, 1);
  EXPECT_THAT(images.output, HasSubstr("is no bag of ROS; leave --topic out"));
}

// A trajectory need not have all stamps, in whatever order of frames.
TEST_F(LoopsOfABag, AreJudgedByTheStampsOfItsMessages) {
  std::string poses;
  for (int i = 0; i < kBagFrames; ++i) {
    if (i == 7) continue;
    poses +=
        std::to_string(StampOfFrame(i)) + " " + std::to_string(100 * (i % kBagPlaces)) + " 0 0 0 0 0 1\n";
  }
  testing::WriteAll(folder_ / "poses.txt", poses);
  const auto run =
      Loops("one.bag", "judged", {"--ground-truth", (folder_ / "poses.txt").string(), "--gt-exclude-s", "3"});
  ASSERT_EQ(run.status, 0) << run.output;
  const std::string results = ReadAll(folder_ / "judged" / "results.json");
  EXPECT_THAT(results, HasSubstr("of 1 images it says nothing"));
  testing::WriteAll(folder_ / "poses.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n");
  const auto other = Loops("one.bag", "other", {"--ground-truth", (folder_ / "poses.txt").string()});
  EXPECT_EQ(other.status, 1);
  EXPECT_THAT(other.output, HasSubstr("their time stamps are not among its"));
}

}  // namespace
}  // namespace tutti
