// Preloaded into a program, it makes a server of it: each request is a copy of the process that calls the
// program's own main with the words, the environment, the folder and the streams of the request. Loading the
// libraries of tutti-images takes longer than most tests of it; here they are loaded once for a test program.
#include <dlfcn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "tests/support/served_program.h"

extern "C" __attribute__((weak)) void __lsan_do_leak_check();  // NOLINT: the leak checker's

namespace {

using Main = int (*)(int, char**, char**);
Main real_main = nullptr;

bool ReadAll(int from, void* bytes, std::size_t count) {
  auto* at = static_cast<char*>(bytes);
  while (count > 0) {
    const ssize_t n = read(from, at, count);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += n;
    count -= static_cast<std::size_t>(n);
  }
  return true;
}

// Its streams, and the socket that the exit status goes to; false at the end of all requests.
bool ReceiveStreams(int socket, int* streams) {
  using tutti::testing::kServedStreams;
  char byte = 0, control[CMSG_SPACE(kServedStreams * sizeof(int))];
  iovec data = {&byte, 1};
  msghdr message = {};
  message.msg_iov = &data;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  ssize_t n = 0;
  while ((n = recvmsg(socket, &message, 0)) < 0 && errno == EINTR) {
  }
  const cmsghdr* header = n > 0 ? CMSG_FIRSTHDR(&message) : nullptr;
  if (header == nullptr || header->cmsg_type != SCM_RIGHTS) return false;
  std::memcpy(streams, CMSG_DATA(header), kServedStreams * sizeof(int));
  return true;
}

std::vector<std::string> ReceiveTexts(int socket) {
  std::uint64_t size = 0;
  std::vector<std::string> texts;
  if (!ReadAll(socket, &size, sizeof size)) _exit(0);
  std::string all(size, '\0');
  if (!ReadAll(socket, all.data(), all.size())) _exit(0);
  for (std::size_t at = 0; at < all.size(); at += texts.back().size() + 1)
    texts.emplace_back(all.c_str() + at);
  return texts;
}

// Ends a copy before what libraries registered when they were loaded: it would wait for threads that a copy
// does not have (log4cplus, which OpenVDB brings).
void EndHere(int status, void*) {
  std::fflush(nullptr);
  if (__lsan_do_leak_check != nullptr) __lsan_do_leak_check();
  _exit(status);
}

// `texts`: the folder, the number of words, the words, the environment.
[[noreturn]] void BecomeTheProgram(std::vector<std::string> texts, const int* streams) {
  for (int stream = 0; stream < 3; ++stream) dup2(streams[stream], stream);
  for (int k = 0; k < tutti::testing::kServedStreams; ++k) close(streams[k]);
  std::signal(SIGCHLD, SIG_DFL);
  if (chdir(texts[0].c_str()) != 0) _exit(127);
  const auto words = static_cast<std::size_t>(std::stoul(texts[1]));
  std::vector<char*> argv;
  for (std::size_t k = 0; k < words; ++k) argv.push_back(texts[2 + k].data());
  argv.push_back(nullptr);
  clearenv();
  for (std::size_t k = 2 + words; k < texts.size(); ++k) putenv(texts[k].data());
  on_exit(EndHere, nullptr);
  std::exit(real_main(static_cast<int>(words), argv.data(), environ));
}

int Serve(int argc, char** argv, char** environment) {
  const char* number = std::getenv("TUTTI_SERVE");
  if (number == nullptr) return real_main(argc, argv, environment);
  const int socket = std::atoi(number);
  std::signal(SIGCHLD, SIG_IGN);  // of those that wait for the programs
  for (int streams[tutti::testing::kServedStreams]; ReceiveStreams(socket, streams);) {
    const std::vector<std::string> texts = ReceiveTexts(socket);
    if (fork() == 0) {
      close(socket);
      std::signal(SIGCHLD, SIG_DFL);
      const pid_t program = fork();
      if (program == 0) BecomeTheProgram(texts, streams);
      for (int stream = 0; stream < 3; ++stream) close(streams[stream]);
      int status = 127 << 8;
      while (program > 0 && waitpid(program, &status, 0) < 0 && errno == EINTR) {
      }
      const ssize_t sent = write(streams[3], &status, sizeof status);
      _exit(sent == sizeof status ? 0 : 1);
    }
    for (const int stream : streams) close(stream);
  }
  _exit(0);
}

}  // namespace

// What the C library's start-up code calls, instead of its own.
extern "C" int __libc_start_main(Main main, int argc, char** argv, void (*init)(), void (*fini)(),  // NOLINT
                                 void (*rtld_fini)(), void* stack_end) {
  using Start = int (*)(Main, int, char**, void (*)(), void (*)(), void (*)(), void*);
  Start start = nullptr;
  void* const found = dlsym(RTLD_NEXT, "__libc_start_main");
  std::memcpy(&start, &found, sizeof start);
  real_main = main;
  return start(Serve, argc, argv, init, fini, rtld_fini, stack_end);
}
