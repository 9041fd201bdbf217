// Long-term memories: any records give a detector that can go on, or an InputError. The first byte chooses
// the options; records follow (memory_records.h).
#include <filesystem>
#include <limits>
#include <string>

#include "tests/fuzz/detector_state.h"
#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/memory_records.h"
#include "tutti/core/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  static const std::string file = tutti::fuzz::ScratchPath("memory").string();
  std::filesystem::remove(file);
  tutti::fuzz::WriteRecords({reinterpret_cast<const char*>(data) + 1, size - 1}, file);
  tutti::LoopDetectorOptions options = tutti::fuzz::StateOptions(data[0] % tutti::fuzz::kKinds);
  options.ltm_file = file;
  try {
    tutti::LoopDetector detector(options);
    for (int k = 0; k < 3 && detector.LastId() < std::numeric_limits<std::int64_t>::max() - 4; ++k) {
      detector.Detect(tutti::fuzz::StateQuery(detector.LastId() + 1, static_cast<std::uint32_t>(k), k < 2));
    }
  } catch (const tutti::InputError&) {
  }
  return 0;
}
