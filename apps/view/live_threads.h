// The threads of the live view.
#pragma once

#include <httplib.h>

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "apps/view/live_connections.h"

namespace tutti::view {

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
