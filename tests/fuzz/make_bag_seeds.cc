// Seeds for bag_fuzzer: tutti_make_bag_seeds FOLDER writes small bags there.
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/fuzz/seed_file.h"

namespace {

sensor_msgs::Image Message(const std::string& encoding, std::uint32_t bytes_per_pixel, double stamp_s) {
  sensor_msgs::Image message;
  message.header.stamp = ros::Time(stamp_s);
  message.width = 8;
  message.height = 6;
  message.step = message.width * bytes_per_pixel;
  message.encoding = encoding;
  message.data.assign(message.step * message.height, 77);
  return message;
}

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path folder = tutti::fuzz::SeedFolder(argc, argv);
  for (int sensor = 0; sensor < 3; ++sensor) {
    for (const auto compression :
         {rosbag::compression::Uncompressed, rosbag::compression::BZ2, rosbag::compression::LZ4}) {
      const std::filesystem::path file = folder / "written";
      {
        rosbag::Bag bag(file.string(), rosbag::bagmode::Write);
        bag.setCompression(compression);
        for (int i = 0; i < 2; ++i) {
          const double stamp = 100 + 0.1 * i;
          const ros::Time received(stamp);
          bag.write("/left", received, Message("mono8", 1, stamp));
          if (sensor == 1) bag.write("/right", received, Message("mono8", 1, stamp));
          if (sensor == 2) bag.write("/depth", received, Message("16UC1", 2, stamp));
        }
      }
      std::ifstream in(file, std::ios::binary);
      const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
      tutti::fuzz::WriteSeed(
          folder / (std::to_string(sensor) + "_" + std::to_string(static_cast<int>(compression))),
          std::string(1, static_cast<char>(sensor)) + bytes);
      std::filesystem::remove(file);
    }
  }
  return 0;
}
