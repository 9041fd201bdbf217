#include "apps/tutti/hand_over.h"
#include "core/terminal.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>

namespace tutti::cli {

int HandOver(char** argv) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path folder = fs::read_symlink("/proc/self/exe", ignored).parent_path();
  const fs::path beside = folder / TUTTI_IMAGES_NAME;
  const fs::path installed = (folder / TUTTI_IMAGES_FOLDER / TUTTI_IMAGES_NAME).lexically_normal();
  for (const fs::path& program : {beside, installed}) {
    execv(program.c_str(), argv);
    if (errno == ENOENT) continue;
    internal::Say("%s can't be started (%s)", program.c_str(), std::strerror(errno));
    return 1;
  }
  internal::Say("'%s' needs the program %s, which is neither %s nor %s; install or build tutti again",
                argv[1], TUTTI_IMAGES_NAME, beside.c_str(), installed.c_str());
  return 1;
}

}  // namespace tutti::cli
