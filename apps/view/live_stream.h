// A connection to the live view as httplib reads and writes it, and the threads that serve connections.
#pragma once

#include <httplib.h>

#include <array>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "apps/view/live_connections.h"

namespace tutti::view {

/// Reads no more bytes and no longer than a request may have, and gives up on who takes nothing.
class LiveStream : public httplib::Stream {
 public:
  static constexpr std::size_t kMostRequest = 16384;  ///< bytes of a request, with its headers and body
  static constexpr double kRequest_s = 5;             ///< for the whole request, from the beginning
  static constexpr double kWrite_s = 5;               ///< for some of what was written to be taken

  /// Does not own `socket`.
  explicit LiveStream(int socket);

  bool is_readable() const override { return begin_ < end_ || received_ < kMostRequest; }
  /// False: the other side has gone, or takes nothing.
  bool is_writable() const override;
  ssize_t read(char* to, size_t size) override;
  ssize_t write(const char* from, size_t size) override;
  void get_remote_ip_and_port(std::string& /*ip*/, int& /*port*/) const override {}
  void get_local_ip_and_port(std::string& /*ip*/, int& /*port*/) const override {}
  socket_t socket() const override { return socket_; }

 private:
  bool Fill();
  bool Takes() const;

  int socket_;
  double request_end_s_;
  std::array<char, 4096> buffer_{};
  std::size_t begin_ = 0, end_ = 0;  // what of the buffer is unread
  std::size_t received_ = 0;
  long long sent_ = 0;  // bytes that the system has taken
  // What of that the other side had when that last grew.
  mutable long long taken_ = 0;
  mutable double taken_s_;
};

/// A thread for each open connection, so that slow ones delay none; started as they are needed. httplib
/// accepts the next connection when `enqueue` returns: as long as there are too many, none is.
class LiveThreads : public httplib::TaskQueue {
 public:
  explicit LiveThreads(LiveConnections& connections) : connections_(connections) {}

  void enqueue(std::function<void()> task) override;
  void shutdown() override;

 private:
  bool Hand(const std::function<void()>& task);  // to a thread; false: there is none
  void Work();
  bool Start();  // one more thread; with mutex_ held

  LiveConnections& connections_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;
  std::vector<std::thread> threads_;
  std::size_t idle_ = 0;
  bool over_ = false;
};

}  // namespace tutti::view
