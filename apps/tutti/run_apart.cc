#include "apps/tutti/run_apart.h"

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <exception>

#include "core/terminal.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {
constexpr int kNever = -1;
}

int RunApart(const std::function<int()>& work) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) throw InputError("no new process can be started; is the machine out of memory?");
  if (child == 0) {
    int status = 2;
    try {
      status = work();
    } catch (const std::exception& error) {
      internal::Say("%s", error.what());
    }
    std::fflush(nullptr);
    _exit(status);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int StatusOf(const RunResult& result) { return result.interrupted ? 130 : result.Void() ? 1 : 0; }

SharedStatuses::SharedStatuses(std::size_t count) : count_(count) {
  void* memory =
      mmap(nullptr, count * sizeof(int), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw InputError("the machine is out of memory");
  statuses_ = static_cast<int*>(memory);
  for (std::size_t i = 0; i < count; ++i) statuses_[i] = kNever;
}

SharedStatuses::~SharedStatuses() { munmap(statuses_, count_ * sizeof(int)); }

std::vector<int> SharedStatuses::Take(int otherwise) const {
  std::vector<int> out(statuses_, statuses_ + count_);
  for (int& status : out) {
    if (status == kNever) status = otherwise == 0 ? 2 : otherwise;
  }
  return out;
}

}  // namespace tutti::cli
