#include "tests/support/served_program.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <map>
#include <mutex>
#include <stdexcept>

namespace tutti::testing {
namespace {

void Require(bool done, const char* what) {
  if (!done) throw std::runtime_error(std::string("the server of a program: ") + what + " failed");
}

// A socket to a server of the program; it ends when this process does.
int StartServer(const std::filesystem::path& program) {
  int ends[2];
  Require(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0, "socketpair");
  if (fork() == 0) {
    fcntl(ends[1], F_SETFD, 0);
    setenv("LD_PRELOAD", TUTTI_SERVE_MAIN, 1);
    setenv("TUTTI_SERVE", std::to_string(ends[1]).c_str(), 1);
    execl(program.c_str(), program.c_str(), nullptr);
    _exit(127);
  }
  close(ends[1]);
  return ends[0];
}

void SendStreams(int server, const int* streams) {
  char byte = 0, control[CMSG_SPACE(kServedStreams * sizeof(int))] = {};
  iovec data = {&byte, 1};
  msghdr message = {};
  message.msg_iov = &data;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  cmsghdr* header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = SCM_RIGHTS;
  header->cmsg_len = CMSG_LEN(kServedStreams * sizeof(int));
  std::memcpy(CMSG_DATA(header), streams, kServedStreams * sizeof(int));
  Require(sendmsg(server, &message, MSG_NOSIGNAL) == 1, "sendmsg");
}

void SendTexts(int server, const std::vector<std::string>& words) {
  std::string all = std::filesystem::current_path().string() + '\0' + std::to_string(words.size()) + '\0';
  for (const std::string& word : words) all += word + '\0';
  for (char** text = environ; *text != nullptr; ++text) all += std::string(*text) + '\0';
  const std::uint64_t size = all.size();
  all.insert(0, reinterpret_cast<const char*>(&size), sizeof size);  // NOLINT
  for (std::size_t at = 0; at < all.size();) {
    const ssize_t n = send(server, all.data() + at, all.size() - at, MSG_NOSIGNAL);
    Require(n > 0, "send");
    at += static_cast<std::size_t>(n);
  }
}

}  // namespace

int BeginServed(const std::filesystem::path& program, const std::vector<std::string>& words, int output) {
  static std::mutex mutex;
  static std::map<std::string, int> servers;
  int ends[2];
  Require(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0, "socketpair");
  {
    const std::lock_guard<std::mutex> lock(mutex);
    const auto [server, is_new] = servers.emplace(program.string(), -1);
    if (is_new) server->second = StartServer(program);
    const int streams[kServedStreams] = {STDIN_FILENO, output, output, ends[1]};
    SendStreams(server->second, streams);
    SendTexts(server->second, words);
  }
  close(ends[1]);
  return ends[0];
}

int EndServed(int served) {
  int status = 0;
  const bool told = recv(served, &status, sizeof status, MSG_WAITALL) == sizeof status;
  close(served);
  Require(told, "the program");
  return status;
}

bool CanBeServed() {
#if defined(__has_feature)
#if __has_feature(thread_sanitizer)
  return false;
#endif
#endif
  rlimit files = {};
  return getrlimit(RLIMIT_FSIZE, &files) == 0 && files.rlim_cur == RLIM_INFINITY;
}

}  // namespace tutti::testing
