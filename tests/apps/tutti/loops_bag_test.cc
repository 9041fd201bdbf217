// `tutti loops` on a bag of ROS.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/loops_fixture.h"
#include "tests/support/bag_writer.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::ReadAll;

double StampOfFrame(int i) { return 1500 + 0.5 * i; }

class LoopsOfABag : public testing::LoopsFixture {
 protected:
  void SetUp() override {
    WriteImages();
    const std::string type = "sensor_msgs/Image";
    testing::BagWriter one, two;
    for (int i = 0; i < testing::kLoopImages; ++i) {
      const cv::Mat image = testing::LoopImage(i);
      const std::string message =
          testing::ImageMessage(image, image.channels() == 3 ? "bgr8" : "mono8", StampOfFrame(i));
      one.Write("/left/image", type, message);
      two.Write("/left/image", type, message);
      two.Write("/right/image", type, message);
    }
    testing::WriteAll(folder_ / "one.bag", one.Finish());
    testing::WriteAll(folder_ / "two.bag", two.Finish());
  }
};

TEST_F(LoopsOfABag, AreThoseOfItsImages) {
  const auto of_bag = List(folder_ / "one.bag", "a"), of_images = List(images_, "b");
  ASSERT_EQ(of_bag.status, 0) << of_bag.output;
  ASSERT_EQ(of_images.status, 0) << of_images.output;
  EXPECT_THAT(of_bag.output, Not(HasSubstr("no calibration"))) << "loops need none";
  EXPECT_EQ(Listed("a"), Listed("b"));
  EXPECT_THAT(Listed("a"), HasSubstr("\n17,2,"));
  EXPECT_THAT(ReadAll(folder_ / "a" / "loops.csv"), HasSubstr("\"frame 17\",\"frame 2\""));
}

TEST_F(LoopsOfABag, AreOfTheTopicThatIsNamed) {
  const auto which = List(folder_ / "two.bag", "which");
  EXPECT_EQ(which.status, 1);
  EXPECT_THAT(which.output, HasSubstr("Set --topic to one of: /left/image /right/image"));
  const auto right = List(folder_ / "two.bag", "right", {"--topic", "/right/image"});
  EXPECT_EQ(right.status, 0) << right.output;
  EXPECT_THAT(Listed("right"), HasSubstr("\n17,2,"));
  const auto images = List(images_, "images_out", {"--topic", "/right/image"});
  EXPECT_EQ(images.status, 1);
  EXPECT_THAT(images.output, HasSubstr("is no bag of ROS; leave --topic out"));
}

// A trajectory need not have a pose at each.
TEST_F(LoopsOfABag, AreJudgedByTheStampsOfItsMessages) {
  std::string poses;
  for (int i = 0; i < testing::kLoopImages; ++i) {
    if (i == 7) continue;
    poses += std::to_string(StampOfFrame(i)) + " " + std::to_string(100 * (i % testing::kLoopPlaces)) +
             " 0 0 0 0 0 1\n";
  }
  testing::WriteAll(folder_ / "poses.txt", poses);
  const auto run = List(folder_ / "one.bag", "judged",
                        {"--ground-truth", (folder_ / "poses.txt").string(), "--gt-exclude-s", "3"});
  ASSERT_EQ(run.status, 0) << run.output;
  const std::string results = ReadAll(folder_ / "judged" / "results.json");
  EXPECT_THAT(results, HasSubstr("of 1 images it says nothing"));
  testing::WriteAll(folder_ / "poses.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n");
  const auto other = List(folder_ / "one.bag", "other", {"--ground-truth", (folder_ / "poses.txt").string()});
  EXPECT_EQ(other.status, 1);
  EXPECT_THAT(other.output, HasSubstr("their time stamps are not among its"));
}

}  // namespace
}  // namespace tutti
