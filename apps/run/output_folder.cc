#include "apps/run/output_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kRoomBytes = 32u << 20;      // a long run writes a few MB
constexpr const char* kHidden = ".tutti-";            // how names begin that are not shown
constexpr const char* kLock = ".tutti-lock";          // stays: it marks the folder as tutti's
constexpr const char* kNew = ".tutti-new";            // files that wait
constexpr const char* kComplete = ".tutti-complete";  // the same, when all are there; may end with -NUMBER
constexpr const char* kEnter = ".tutti-enter";        // the same, when the earlier result has made way
constexpr const char* kUnfinished = "unfinished";

bool IsNumber(const std::string& name) {
  return !name.empty() && name.size() < 9 && name[0] != '0' &&
         std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

// Waits until the disk has it: some file systems say only then that they are full.
void Sync(const fs::path& file) {
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) throw std::system_error(errno, std::generic_category());
  const int status = fsync(descriptor), error = errno;
  close(descriptor);
  if (status != 0 && error != EINVAL && error != EROFS)
    throw std::system_error(error, std::generic_category());
}

void LastAtTheEnd(const std::string& last, std::vector<fs::path>& files) {
  std::stable_partition(files.begin(), files.end(),
                        [&last](const fs::path& file) { return file.filename() != last; });
}

// What the system said of a write, if it said something; it tells more than what the writer made of it.
std::string Reason(int error, const std::exception& thrown) {
  for (const int known : {ENOSPC, EDQUOT, EFBIG, EIO, ENOMEM, EMFILE, EROFS}) {
    if (error == known) return std::strerror(error);
  }
  return thrown.what();
}

nlohmann::json ReadJson(const fs::path& file) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return nlohmann::json::object();
  std::ifstream in(file);
  nlohmann::json json = nlohmann::json::parse(in, nullptr, false);
  return json.is_object() ? json : nlohmann::json::object();
}

bool Within(const fs::path& folder, const fs::path& file) {
  std::error_code ignored;
  const fs::path inner = fs::weakly_canonical(file, ignored), outer = fs::weakly_canonical(folder, ignored);
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

// Says what is wrong with a folder, and that another one does.
[[noreturn]] void Refuse(const fs::path& folder, const OutputLayout& layout, const std::string& wrong,
                         const std::string& advice = "choose another ", const std::string& rest = "") {
  throw InputError(folder.string() + ": " + wrong + "; " + advice + layout.option + rest);
}

constexpr const char* kFreeSpace = "free some space or choose another ";

// Throws InputError if the folder has files that tutti did not write.
void RefuseForeign(const fs::path& folder, const OutputLayout& layout, const std::optional<fs::path>& own) {
  std::error_code error;
  bool empty = true;
  const std::vector<std::string> passing = layout.Passing();
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename();
    if (name[0] == '.') continue;
    if (own && Within(entry.path(), *own)) continue;
    if (layout.is_part != nullptr && layout.is_part(entry.path())) continue;
    empty = false;
    if (layout.is_result(entry.path()) || std::count(passing.begin(), passing.end(), name) > 0) continue;
    if (entry.is_directory(error) && (name == kUnfinished || IsNumber(name))) continue;
    Refuse(folder, layout, "holds " + name + ", which is no result of tutti", "choose another ",
           ", or move it away");
  }
  if (error) Refuse(folder, layout, "can't be read (" + error.message() + ")");
  if (empty || layout.known || fs::exists(folder / kLock, error) ||
      ReadJson(folder / layout.last).contains(layout.key))
    return;
  Refuse(folder, layout, "is not empty, and has no " + layout.last + " by which a result of tutti is known",
         "choose another ", ", or empty it");
}

}  // namespace

void RefuseToReplace(const fs::path& folder, const fs::path& file) {
  if (!Within(folder, file)) return;
  throw InputError(folder.string() + ": holds " + file.string() +
                   ", which this run reads; choose another --out");
}

void ThrowFailures(const std::vector<std::string>& failures, const fs::path& rest) {
  if (failures.empty()) return;
  std::string message = "not everything could be written:";
  for (const std::string& failure : failures) message += "\n  " + failure;
  throw InputError(message + "\n  the rest is in " + rest.string());
}

std::vector<std::string> OutputLayout::Passing() const {
  std::vector<std::string> names = live;
  names.insert(names.end(), until_finished.begin(), until_finished.end());
  return names;
}

void OutputFolder::Check(const fs::path& folder, const OutputLayout& layout,
                         const std::optional<fs::path>& own) {
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_directory(folder, error))
    throw InputError(folder.string() + ": is a file; " + layout.option + " needs a folder");
  std::vector<fs::path> made;  // the innermost first
  for (fs::path at = fs::absolute(folder).lexically_normal();
       at.has_relative_path() && !fs::exists(at, error); at = at.parent_path())
    made.push_back(at);
  fs::create_directories(folder, error);
  const std::string failed = error ? error.message() : "";
  const std::string denied = access(folder.c_str(), W_OK | X_OK) == 0 ? "" : std::strerror(errno);
  for (const fs::path& at : made) fs::remove(at, error);  // empty as they are
  if (!failed.empty()) Refuse(folder, layout, "the folder can't be made (" + failed + ")");
  if (!denied.empty()) Refuse(folder, layout, "no permission to write there (" + denied + ")");
  if (made.empty()) RefuseForeign(folder, layout, own);
}

OutputFolder::OutputFolder(fs::path folder, OutputLayout layout, bool keep,
                           const std::optional<fs::path>& own)
    : folder_(std::move(folder)), staging_(folder_ / kNew), layout_(std::move(layout)), keep_(keep) {
  Check(folder_, layout_, own);
  fs::create_directories(folder_);
  RefuseLinks();
  Lock();
  try {
    CheckRoom();
    Enter();
    RefuseLinks();  // in what a process left that was killed
    fs::remove_all(staging_);
    if (keep_) KeepLeftovers();
  } catch (const fs::filesystem_error& thrown) {
    close(lock_);
    Refuse(folder_, layout_, std::string("can't be written to (") + thrown.what() + ")");
  } catch (...) {
    close(lock_);
    throw;
  }
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
  close(lock_);
}

// What is written in its place, not moved there: behind a link it would be another folder's file.
void OutputFolder::RefuseLinks() const {
  const std::vector<std::string> passing = layout_.Passing();
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
    const std::string name = entry.path().filename();
    const bool hidden = name.rfind(kHidden, 0) == 0, folder = name == kUnfinished || IsNumber(name);
    if (!hidden && !folder && std::count(passing.begin(), passing.end(), name) == 0) continue;
    const fs::file_status status = entry.symlink_status();
    if (fs::is_regular_file(status) || fs::is_directory(status)) continue;
    Refuse(entry.path(), layout_, "is a link or a device, and results are written into their folder alone",
           "remove it, or choose another ");
  }
}

void OutputFolder::Lock() {
  const fs::path file = folder_ / kLock;
  lock_ = open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
  if (lock_ < 0)
    Refuse(folder_, layout_, std::string("no permission to write there (") + std::strerror(errno) + ")");
  // Where a file system has no locks, runs are on their own.
  if (flock(lock_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    char holder[24] = {};
    const ssize_t size = read(lock_, holder, sizeof holder - 1);
    close(lock_);
    const std::string id = size > 0 ? " (process " + std::string(holder) + ")" : "";
    Refuse(folder_, layout_, "another tutti" + id + " is writing there", "wait for it, or choose another ");
  }
  const std::string id = std::to_string(getpid());
  if (ftruncate(lock_, 0) != 0 || write(lock_, id.data(), id.size()) < 0) {
    const int error = errno;
    close(lock_);
    Refuse(folder_, layout_, std::string("can't be written to (") + std::strerror(error) + ")", kFreeSpace);
  }
}

void OutputFolder::CheckRoom() const {
  const fs::path probe = folder_ / ".tutti-write-test";
  std::error_code error;
  std::ofstream file(probe, std::ios::binary);
  file << std::string(1 << 10, 'x');
  file.close();
  const int reason = errno;
  fs::remove(probe, error);
  if (!file)
    Refuse(folder_, layout_, std::string("can't be written to (") + std::strerror(reason) + ")", kFreeSpace);
  const fs::space_info space = fs::space(folder_, error);
  if (!error && space.available < kRoomBytes)
    Refuse(folder_, layout_, "less than 32 MB are free there", kFreeSpace);
}

// The file that marks a result as complete is the last one.
std::vector<fs::path> OutputFolder::Results() const {
  std::vector<fs::path> results;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
    if (layout_.is_result(entry.path())) results.push_back(entry.path());
  }
  LastAtTheEnd(layout_.last, results);
  return results;
}

fs::path OutputFolder::NextNumber() const {
  int highest = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
    const std::string name = entry.path().filename();
    if (IsNumber(name)) highest = std::max(highest, std::stoi(name));
  }
  return folder_ / std::to_string(highest + 1);
}

// What a run computed that was killed or could not write everything.
void OutputFolder::KeepLeftovers() const {
  if (fs::exists(folder_ / kUnfinished)) fs::rename(folder_ / kUnfinished, NextNumber());
  fs::path number;
  for (const std::string& name : layout_.Passing()) {
    if (!fs::exists(folder_ / name)) continue;
    if (number.empty()) fs::create_directories(number = NextNumber());
    fs::rename(folder_ / name, number / name);
  }
}

const fs::path& OutputFolder::Staging() {
  std::error_code error;
  fs::create_directories(staging_, error);
  if (error) throw InputError(staging_.string() + ": the folder can't be made (" + error.message() + ")");
  return staging_;
}

void OutputFolder::Write(const OutputFile& file) noexcept {
  std::error_code ignored;
  const fs::path waiting = staging_ / file.name;
  try {
    Staging();
    errno = 0;
    file.write(waiting);
    Sync(waiting);
  } catch (const std::exception& thrown) {
    failures_.push_back((folder_ / file.name).string() + ": " + Reason(errno, thrown));
    fs::remove_all(waiting, ignored);
  }
}

fs::path OutputFolder::Finish(bool finished) {
  try {
    const bool complete = finished && failures_.empty();
    const fs::path last = folder_ / layout_.last;
    const bool earlier = fs::exists(last) && ReadJson(last).value("finished", nlohmann::json(true)) != false;
    fs::path where = folder_;
    if (!fs::exists(staging_)) return where;
    if (earlier && !complete) {
      where = folder_ / kUnfinished;
      fs::remove_all(where);
      fs::rename(staging_, where);
    } else {
      const std::string number = keep_ && !Results().empty() ? "-" + NextNumber().filename().string() : "";
      fs::rename(staging_, folder_ / (kComplete + number));
      Enter();
      if (complete && !keep_) fs::remove_all(folder_ / kUnfinished);
    }
    if (!failures_.empty()) return where;
    for (const std::string& name : complete ? layout_.Passing() : layout_.live) fs::remove(folder_ / name);
    if (complete) RemoveParts();
    return where;
  } catch (const fs::filesystem_error& error) {
    throw InputError(folder_.string() + ": the results can't be moved into place (" + error.what() + ")");
  }
}

// What was left of files that were being written when a process was killed.
void OutputFolder::RemoveParts() const {
  std::error_code ignored;
  for (const std::string& name : layout_.until_finished) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_, ignored)) {
      if (entry.path().filename().string().rfind("." + name + ".part-", 0) == 0)
        fs::remove(entry.path(), ignored);
    }
  }
}

// Each step can be taken again after it was cut short: the name of the folder says how far it went.
void OutputFolder::Enter() const {
  std::vector<fs::path> complete;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
    if (entry.path().filename().string().rfind(kComplete, 0) == 0) complete.push_back(entry.path());
  }
  for (const fs::path& fresh : complete) {
    const std::string number = fresh.filename().string().substr(std::strlen(kComplete));
    if (!number.empty() && !IsNumber(number.substr(1))) continue;  // no name that Finish gives
    const fs::path kept = number.empty() ? fs::path() : folder_ / number.substr(1);
    if (!number.empty()) fs::create_directories(kept);
    for (const fs::path& old : Results()) {
      if (!number.empty()) {
        fs::rename(old, kept / old.filename());
      } else if (fs::is_directory(old) || !fs::exists(fresh / old.filename())) {
        fs::remove_all(old);
      }
    }
    fs::rename(fresh, folder_ / kEnter);
  }
  if (!fs::exists(folder_ / kEnter)) return;
  std::vector<fs::path> files(fs::directory_iterator(folder_ / kEnter), {});
  LastAtTheEnd(layout_.last, files);
  for (const fs::path& file : files) fs::rename(file, folder_ / file.filename());
  fs::remove_all(folder_ / kEnter);
}

}  // namespace tutti
