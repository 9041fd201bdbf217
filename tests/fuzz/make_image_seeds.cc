// Seeds for image_fuzzer: tutti_make_image_seeds FOLDER writes small images of all kinds there.
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "tests/fuzz/seed_file.h"

int main(int argc, char** argv) {
  const std::filesystem::path folder = tutti::fuzz::SeedFolder(argc, argv);
  for (const int type : {CV_8UC1, CV_8UC3, CV_16UC1}) {
    cv::Mat image(12, 16, type);
    cv::RNG random(1);
    random.fill(image, cv::RNG::UNIFORM, 0, 256);
    for (const char* ending : {".png", ".jpg", ".bmp", ".pgm", ".ppm", ".tiff", ".webp", ".jp2"}) {
      std::vector<unsigned char> bytes;
      try {
        if (!cv::imencode(ending, image, bytes)) continue;
      } catch (const cv::Exception&) {
        continue;  // a kind that has no such pixels
      }
      tutti::fuzz::WriteSeed(folder / (std::to_string(type) + ending),
                             std::string(bytes.begin(), bytes.end()));
    }
  }
  return 0;
}
