// tutti: visual SLAM with an ensemble of Bayesian loop-closure filters. The commands that read no images; the
// others are in images_main.cc.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "apps/tutti/commands.h"
#include "core/terminal.h"

namespace {

// Becomes tutti-images, with these words: the same process, so that input, output, signals and the exit
// status are the program's own. It lies beside this program, or where it is installed. Comes back only if it
// can't be started.
int HandOver(char** argv) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path folder = fs::read_symlink("/proc/self/exe", ignored).parent_path();
  const fs::path beside = folder / TUTTI_IMAGES_NAME;
  const fs::path installed = (folder / TUTTI_IMAGES_FOLDER / TUTTI_IMAGES_NAME).lexically_normal();
  for (const fs::path& program : {beside, installed}) {
    execv(program.c_str(), argv);
    if (errno == ENOENT) continue;
    tutti::internal::Say("%s can't be started (%s)", program.c_str(), std::strerror(errno));
    return 1;
  }
  tutti::internal::Say("'%s' needs the program %s, which is neither %s nor %s; install or build tutti again",
                       argv[1], TUTTI_IMAGES_NAME, beside.c_str(), installed.c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace tutti::cli;  // NOLINT(google-build-using-namespace)
  return RunProgram(argc, argv,
                    {{"evaluate", SetUpEvaluate},
                     {"convert", SetUpConvert},
                     {"plot", SetUpPlot},
                     {"collect", SetUpCollect},
                     {"compare-loops", SetUpCompareLoops},
                     {"optimize", SetUpOptimize}},
                    HandOver);
}
