// tutti-images: the commands of tutti that read or make images. Users call `tutti`, which becomes this
// program.
#include <malloc.h>  // glibc, or another C library's without mallopt

#include <algorithm>
#include <thread>

#include "apps/tutti/commands.h"

namespace {
// Images are of one size: memory that one of them has left is kept for the next. To give it back to the
// system and have each page anew costs a run about 4 % of its time. What threads leave is shared: else each
// of up to eight a processor keeps some of its own, 50 MB in a run and as much again for clients of the live
// view.
void KeepMemory() {
#ifdef __GLIBC__
  constexpr int kLargest = 64 << 20, kSpare = 256 << 20;  // [bytes]
  mallopt(M_MMAP_THRESHOLD, kLargest);
  mallopt(M_TRIM_THRESHOLD, kSpare);
  mallopt(M_ARENA_MAX, static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 4U)));
#endif
}
}  // namespace

int main(int argc, char** argv) {
  KeepMemory();
  using namespace tutti::cli;  // NOLINT(google-build-using-namespace)
  return RunProgram(argc, argv,
                    {{"run", SetUpRun},
                     {"calibrate-check", SetUpCalibrateCheck},
                     {"compare", SetUpCompare},
                     {"loops", SetUpLoops},
                     {"generate", SetUpGenerate},
                     {"demo", SetUpDemo},
                     {"map", SetUpMap},
                     {"localize", SetUpLocalize},
                     {"export", SetUpExport},
                     {"dense", SetUpDense},
                     {"merge", SetUpMerge},
                     {"close", SetUpClose}},
                    nullptr);
}
