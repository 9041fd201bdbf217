// Seeds for bag_fuzzer: tutti_make_bag_seeds FOLDER writes small bags there.
#include <string>

#include "tests/fuzz/seed_file.h"
#include "tests/support/bag_writer.h"

int main(int argc, char** argv) {
  using tutti::testing::BagPacking;
  const std::filesystem::path folder = tutti::fuzz::SeedFolder(argc, argv);
  const cv::Mat grey(6, 8, CV_8UC1, cv::Scalar(77)), depth(6, 8, CV_16UC1, cv::Scalar(1500));
  for (int sensor = 0; sensor < 3; ++sensor) {
    for (const auto packing : {BagPacking::kPlain, BagPacking::kBz2, BagPacking::kLz4}) {
      tutti::testing::BagWriter bag(packing, 200);
      for (int i = 0; i < 2; ++i) {
        const double stamp = 100 + 0.1 * i;
        const std::string type = "sensor_msgs/Image";
        bag.Write("/left", type, tutti::testing::ImageMessage(grey, "mono8", stamp));
        if (sensor == 1) bag.Write("/right", type, tutti::testing::ImageMessage(grey, "mono8", stamp));
        if (sensor == 2) bag.Write("/depth", type, tutti::testing::ImageMessage(depth, "16UC1", stamp));
      }
      tutti::fuzz::WriteSeed(
          folder / (std::to_string(sensor) + "_" + std::to_string(static_cast<int>(packing))),
          std::string(1, static_cast<char>(sensor)) + bag.Finish());
    }
  }
  return 0;
}
