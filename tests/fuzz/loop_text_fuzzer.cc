// Loop matrices and loop pairs as text: any text gives a ground truth that can be asked, or an InputError.
#include <algorithm>
#include <cstdlib>

#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/ground_truth.h"

namespace {

// What is no text goes to OpenCV's image decoders, which are not ours to fuzz.
bool GoesToTheTextReader(const std::uint8_t* data, std::size_t size) {
  return std::all_of(data, data + std::min<std::size_t>(size, 512), [](std::uint8_t c) {
    return c == '\n' || c == '\r' || c == '\t' || (c >= 32 && c < 127);
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (!GoesToTheTextReader(data, size)) return 0;
  constexpr int kImages = 50;
  try {
    const tutti::LoopGroundTruth truth = tutti::ReadLoopMatrix(tutti::fuzz::MemoryFile(data, size), kImages);
    const int rows = truth.RowsWithLoop();
    if (rows < 0 || rows > truth.size() || truth.Strided(2).size() != (truth.size() + 1) / 2) std::abort();
  } catch (const tutti::InputError&) {
  }
  return 0;
}
