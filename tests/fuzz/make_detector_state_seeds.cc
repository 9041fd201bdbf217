// Seeds for detector_state_fuzzer: tutti_make_detector_state_seeds FOLDER saves small detectors there, in its
// format.
#include <filesystem>
#include <string>

#include "tests/fuzz/detector_state.h"
#include "tests/fuzz/seed_file.h"

int main(int argc, char** argv) {
  const std::filesystem::path folder = tutti::fuzz::SeedFolder(argc, argv);
  for (int kind = 0; kind < tutti::fuzz::kKinds; ++kind) {
    tutti::LoopDetector detector(tutti::fuzz::StateOptions(kind));
    for (int images = 0; images <= 7; ++images) {
      const std::filesystem::path saved = folder / "saved";
      detector.Save(saved);
      tutti::fuzz::WriteSeed(
          folder / (std::to_string(kind) + "_" + std::to_string(images)),
          std::string(1, static_cast<char>(kind)) +
              tutti::fuzz::SectionsOf(saved, tutti::internal::kDetectorFile, tutti::fuzz::kEndTag));
      std::filesystem::remove(saved);
      detector.Detect(
          tutti::fuzz::StateQuery(images, static_cast<std::uint32_t>(images % 5), images % 3 != 2));
    }
  }
  return 0;
}
