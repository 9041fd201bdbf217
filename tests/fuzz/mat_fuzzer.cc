// MATLAB v5 loop matrices: any bytes give a matrix or an InputError.
#include <cstdlib>

#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/ground_truth.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    int rows = 0;
    const std::vector<double> values = tutti::ReadMatSquareMatrix(tutti::fuzz::MemoryFile(data, size), rows);
    const auto n = static_cast<std::size_t>(rows);
    if (values.size() != n * n || rows < 2) std::abort();
  } catch (const tutti::InputError&) {
  }
  return 0;
}
