#include "core/replaced_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <system_error>

#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::internal {
namespace {

namespace fs = std::filesystem;

constexpr mode_t kPermissions = 0777;

[[noreturn]] void RefuseTarget(const std::string& file, const std::string& why) {
  throw InputError(file + ": can't be written: it is " + why + "; give the name of a file");
}

// Closed at the end.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }

 private:
  int number_;
};

// The number of a descriptor of this process that a path stands for, as /dev/stdout's link does.
std::optional<int> OpenDescriptor(const fs::path& link) {
  std::error_code ignored;
  const fs::path folder = fs::canonical(link.parent_path(), ignored);
  const std::string process = "/proc/" + std::to_string(getpid());
  if (folder != process + "/fd" && folder != process + "/task/" + std::to_string(gettid()) + "/fd")
    return std::nullopt;
  const std::optional<std::int64_t> number = ParseInteger(link.filename().string());
  return number ? std::optional(static_cast<int>(*number)) : std::nullopt;
}

// Where a file is to be written.
struct Target {
  fs::path file;                  // no symbolic link, unless to a descriptor
  std::optional<int> descriptor;  // of this process: it is open
  std::optional<struct stat> there;
  // Takes bytes one after the other, and nothing takes its place.
  bool IsStream() const {
    return descriptor || (there && (S_ISCHR(there->st_mode) || S_ISFIFO(there->st_mode)));
  }
};

Target TargetOf(const fs::path& name) {
  constexpr int kMostLinks = 40;  // as many as Linux follows
  Target target{name, {}, {}};
  struct stat status = {};
  for (int links = 0; lstat(target.file.c_str(), &status) == 0 && S_ISLNK(status.st_mode); ++links) {
    target.descriptor = OpenDescriptor(target.file);
    if (target.descriptor) return target;
    std::error_code error;
    const fs::path next = fs::read_symlink(target.file, error);
    if (links == kMostLinks || error) FailToWrite(name.string(), ELOOP);
    // What is behind a link of another process's descriptors has no name that can be trusted.
    if (next.is_relative() && next.string().find(":[") != std::string::npos) break;
    target.file = target.file.parent_path() / next;
  }
  if (stat(target.file.c_str(), &status) == 0) {
    target.there = status;
  } else if (errno != ENOENT) {
    FailToWrite(name.string(), errno);
  }
  if (!target.there) return target;
  if (S_ISDIR(status.st_mode)) RefuseTarget(name.string(), "a folder");
  if (S_ISBLK(status.st_mode) || S_ISSOCK(status.st_mode))
    RefuseTarget(name.string(), "a device or a socket");
  if (access(target.file.c_str(), W_OK) != 0) FailToWrite(name.string(), errno);
  return target;
}

// A name that nothing has yet. A link that somebody put there is not followed.
fs::path MakePart(const Target& target, const std::string& name) {
  static std::atomic<int> count = 0;
  while (true) {
    fs::path part = target.file.parent_path() /
                    (PartPrefix(target.file) + std::to_string(getpid()) + "-" + std::to_string(count++));
    const Descriptor made(
        open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, target.there ? 0600 : 0666));
    if (made.number() >= 0) {
      if (!target.there) return part;
      const bool owned = fchown(made.number(), target.there->st_uid, target.there->st_gid) == 0;
      // A group that it could not be given to has no rights.
      const mode_t rights = owned || target.there->st_gid == getegid() ? kPermissions : 0707;
      if (fchmod(made.number(), target.there->st_mode & rights) == 0) return part;
      const int error = errno;
      unlink(part.c_str());
      FailToWrite(name, error);
    }
    if (errno != EEXIST) FailToWrite(name, errno);
  }
}

void WriteAll(int descriptor, std::string_view bytes, const std::string& name) {
  while (!bytes.empty()) {
    const ssize_t size = write(descriptor, bytes.data(), bytes.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) FailToWrite(name, errno);
    bytes.remove_prefix(static_cast<std::size_t>(size));
  }
}

void WriteStream(const Target& target, std::string_view bytes, const std::string& name) {
  std::fflush(nullptr);  // what was printed there before comes first
  const Descriptor out(target.descriptor ? fcntl(*target.descriptor, F_DUPFD_CLOEXEC, 0)
                                         : open(target.file.c_str(), O_WRONLY | O_NOCTTY | O_CLOEXEC));
  if (out.number() < 0) FailToWrite(name, errno);
  WriteAll(out.number(), bytes, name);
}

}  // namespace

void FailToWrite(const std::string& file, int error) {
  throw InputError(file + ": can't be written (" + (error != 0 ? std::strerror(error) : "unknown error") +
                   "); check that its folder exists, is writable and not full; what was there before is "
                   "untouched");
}

std::string PartPrefix(const fs::path& file) {
  constexpr std::size_t kMostBytes = 200;  // file systems take 255
  return "." + file.filename().string().substr(0, kMostBytes) + ".part-";
}

ReplacedFile::ReplacedFile(const fs::path& file) : name_(file.string()) {
  const Target target = TargetOf(file);
  if (target.IsStream()) RefuseTarget(name_, "a device or a pipe");
  target_ = target.file;
  part_ = MakePart(target, name_);
}

ReplacedFile::~ReplacedFile() {
  if (!committed_) unlink(part_.c_str());
}

void ReplacedFile::Commit() {
  if (rename(part_.c_str(), target_.c_str()) != 0) FailToWrite(name_, errno);
  committed_ = true;
}

void WriteFile(const fs::path& file, std::string_view bytes) {
  const Target target = TargetOf(file);
  if (target.IsStream()) return WriteStream(target, bytes, file.string());
  ReplacedFile out(file);
  {
    const Descriptor part(open(out.part().c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC));
    if (part.number() < 0) FailToWrite(file.string(), errno);
    WriteAll(part.number(), bytes, file.string());
  }
  out.Commit();
}

void CheckWritable(const fs::path& file, Needs needs) {
  if (needs == Needs::kFile || !TargetOf(file).IsStream()) ReplacedFile checked(file);
}

}  // namespace tutti::internal
