// Sends bytes through a pipe with a name, from another thread.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>

namespace tutti::testing {

/// Makes the pipe if it is not there. Ends when somebody has read all, or when it is destroyed: a reader that
/// never comes, or goes early, holds up no test.
class PipeSender {
 public:
  PipeSender(const std::filesystem::path& pipe, std::string bytes) {
    std::signal(SIGPIPE, SIG_IGN);
    mkfifo(pipe.c_str(), 0600);
    thread_ = std::thread([this, pipe, bytes = std::move(bytes)] { Send(pipe, bytes); });
  }
  ~PipeSender() {
    stop_ = true;
    thread_.join();
  }
  PipeSender(const PipeSender&) = delete;
  PipeSender& operator=(const PipeSender&) = delete;

 private:
  void Send(const std::filesystem::path& pipe, const std::string& bytes) const {
    int end = -1;
    while (!stop_ && (end = open(pipe.c_str(), O_WRONLY | O_NONBLOCK)) < 0) Wait();
    for (std::size_t sent = 0; !stop_ && end >= 0 && sent < bytes.size();) {
      const ssize_t now = write(end, bytes.data() + sent, bytes.size() - sent);
      if (now < 0 && errno != EAGAIN) break;  // the reader has gone
      if (now < 0) Wait();
      if (now > 0) sent += static_cast<std::size_t>(now);
    }
    if (end >= 0) close(end);
  }
  static void Wait() { std::this_thread::sleep_for(std::chrono::milliseconds(2)); }

  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace tutti::testing
