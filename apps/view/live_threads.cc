#include "apps/view/live_threads.h"

#include <system_error>
#include <utility>

namespace tutti::view {

void LiveThreads::enqueue(std::function<void()> task) {
  connections_.Enter();
  if (!Hand(task)) task();  // no thread to be had: served here, and the others wait
  connections_.MakeRoom();
}

bool LiveThreads::Hand(const std::function<void()>& task) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (idle_ <= tasks_.size() && !Start()) return false;
  tasks_.push_back(task);
  changed_.notify_one();
  return true;
}

void LiveThreads::shutdown() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    over_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

bool LiveThreads::Start() {
  if (threads_.size() == LiveConnections::kMost) return true;  // one is about to be idle
  try {
    threads_.emplace_back([this] { Work(); });
  } catch (const std::system_error&) {
    return !threads_.empty();
  }
  return true;
}

void LiveThreads::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    ++idle_;
    changed_.wait(lock, [this] { return over_ || !tasks_.empty(); });
    --idle_;
    if (tasks_.empty()) return;
    const std::function<void()> task = std::move(tasks_.front());
    tasks_.pop_front();
    lock.unlock();
    task();
    lock.lock();
  }
}

}  // namespace tutti::view
