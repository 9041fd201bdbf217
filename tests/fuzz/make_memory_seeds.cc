// Seeds for memory_fuzzer: tutti_make_memory_seeds FOLDER fills small long-term memories, in its format.
#include <filesystem>
#include <string>

#include "tests/fuzz/detector_state.h"
#include "tests/fuzz/memory_records.h"
#include "tests/fuzz/seed_file.h"

int main(int argc, char** argv) {
  const std::filesystem::path folder = tutti::fuzz::SeedFolder(argc, argv);
  for (int kind = 0; kind < tutti::fuzz::kKinds; ++kind) {
    for (const int images : {1, 2, 4, 8}) {
      const std::filesystem::path file = folder / "filled";
      tutti::LoopDetectorOptions options = tutti::fuzz::StateOptions(kind);
      options.ltm_file = file.string();
      {
        tutti::LoopDetector detector(options);
        for (int i = 0; i < images; ++i)
          detector.Detect(tutti::fuzz::StateQuery(i, static_cast<std::uint32_t>(i % 5), i % 3 != 2));
      }
      tutti::fuzz::WriteSeed(folder / (std::to_string(kind) + "_" + std::to_string(images)),
                             std::string(1, static_cast<char>(kind)) + tutti::fuzz::RecordsOf(file.string()));
      for (const char* ending : {"", "-wal", "-shm"}) std::filesystem::remove(file.string() + ending);
    }
  }
  return 0;
}
