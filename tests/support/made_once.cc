#include "tests/support/made_once.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace tutti::testing {
namespace {

namespace fs = std::filesystem;

std::string ContentsOf(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

// Held by one program at a time.
class Lock {
 public:
  explicit Lock(const fs::path& file) : file_(open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644)) {
    if (file_ < 0 || flock(file_, LOCK_EX) != 0)
      throw std::runtime_error(file.string() + ": can't be locked");
  }
  ~Lock() { close(file_); }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

 private:
  int file_;
};

}  // namespace

std::string DigestOf(const std::string& text) {
  std::uint64_t sum = 14695981039346656037ULL;  // FNV-1a
  for (const char c : text) sum = (sum ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(sum));
  return digits;
}

fs::path MadeOnce(const std::string& name, const fs::path& made_by,
                  const std::function<void(const fs::path&)>& make) {
  const fs::path all = TUTTI_MADE_ONCE;
  fs::create_directories(all);
  const fs::path place = all / name, mark = place / "made-by";
  fs::path folder = place / "content";
  const Lock lock(all / (name + ".lock"));
  const std::string maker = DigestOf(ContentsOf(made_by));
  if (ContentsOf(mark) == maker) return folder;
  fs::remove_all(place);
  fs::create_directories(place);
  make(folder);
  std::ofstream(mark, std::ios::binary) << maker;  // last: what is half made is made anew
  return folder;
}

}  // namespace tutti::testing
