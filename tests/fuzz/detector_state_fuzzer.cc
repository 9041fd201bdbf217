// Saved loop detectors: any sections under right checksums give a detector that can go on and be saved again,
// or an InputError. The first byte chooses the options.
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>

#include "tests/fuzz/detector_state.h"
#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"

namespace {

// A descriptor of another kind than the file's is the one thing that a loaded detector may refuse.
bool GoesOn(tutti::LoopDetector& detector) {
  for (const bool calibrated : {true, false}) {
    try {
      const std::int64_t id = detector.LastId() + 1;
      const tutti::LoopResult result =
          detector.Detect(tutti::fuzz::StateQuery(id, calibrated ? 0 : 1, calibrated));
      const bool good = result.hypothesis >= 0.0 && result.hypothesis <= 1.0 + 1e-6;
      if (!good || detector.LastId() != id || detector.NumLocations() == 0) std::abort();
      if (result.candidate >= 0) detector.AddLink(id, result.candidate);
    } catch (const tutti::InputError& error) {
      if (std::string(error.what()).find("descriptors are ") == std::string::npos)
        throw std::logic_error(error.what());
      return false;
    }
  }
  return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const tutti::LoopDetectorOptions options = tutti::fuzz::StateOptions(data[0] % tutti::fuzz::kKinds);
  const std::string file = tutti::fuzz::WrapState({reinterpret_cast<const char*>(data) + 1, size - 1});
  tutti::LoopDetector detector(options);
  try {
    detector.Load(tutti::fuzz::MemoryFile(reinterpret_cast<const std::uint8_t*>(file.data()), file.size()));
  } catch (const tutti::InputError&) {
    return 0;
  }
  if (detector.LastId() > std::numeric_limits<std::int64_t>::max() - 4 || !GoesOn(detector)) return 0;
  static const std::filesystem::path again = tutti::fuzz::ScratchPath("state");
  detector.Save(again);
  tutti::LoopDetector(options).Load(again);
  std::filesystem::remove(again);
  return 0;
}
