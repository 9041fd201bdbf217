#include "apps/view/live_stream.h"

#include <linux/sockios.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "core/stopwatch.h"

namespace tutti::view {
namespace {

// False: not within the time.
bool WaitUntil(double end_s, int socket, short event) {
  while (true) {
    const double left_s = end_s - internal::SteadySeconds();
    if (left_s <= 0) return false;
    pollfd entry{socket, event, 0};
    const int ready = poll(&entry, 1, static_cast<int>(left_s * 1000) + 1);
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return false;
  }
}

bool TryAgain() { return errno == EAGAIN || errno == EINTR; }

}  // namespace

LiveStream::LiveStream(int socket)
    : socket_(socket),
      request_end_s_(internal::SteadySeconds() + kRequest_s),
      taken_s_(internal::SteadySeconds()) {}

bool LiveStream::is_writable() const {
  char byte = 0;
  const ssize_t n = recv(socket_, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  return (n > 0 || (n < 0 && TryAgain())) && Takes();  // 0: the other side has gone
}

// The system's buffers hold megabytes: that a message could be written does not say that somebody reads.
bool LiveStream::Takes() const {
  int queued = 0;
  if (ioctl(socket_, SIOCOUTQ, &queued) != 0) return true;
  const double now_s = internal::SteadySeconds();
  if (queued == 0 || sent_ - queued > taken_) {
    taken_ = sent_ - queued;
    taken_s_ = now_s;
  }
  return now_s - taken_s_ <= kWrite_s;
}

bool LiveStream::Fill() {
  const std::size_t room = std::min(buffer_.size(), kMostRequest - received_);
  while (room > 0 && WaitUntil(request_end_s_, socket_, POLLIN)) {
    const ssize_t n = recv(socket_, buffer_.data(), room, MSG_DONTWAIT);
    if (n < 0 && TryAgain()) continue;
    if (n <= 0) return false;
    begin_ = 0;
    end_ = static_cast<std::size_t>(n);
    received_ += end_;
    return true;
  }
  return false;
}

ssize_t LiveStream::read(char* to, size_t size) {
  if (begin_ == end_ && !Fill()) return -1;
  const std::size_t n = std::min(size, end_ - begin_);
  std::memcpy(to, buffer_.data() + begin_, n);
  begin_ += n;
  return static_cast<ssize_t>(n);
}

ssize_t LiveStream::write(const char* from, size_t size) {
  const double end_s = internal::SteadySeconds() + kWrite_s;
  std::size_t sent = 0;
  while (sent < size) {
    if (!WaitUntil(end_s, socket_, POLLOUT)) return -1;
    const ssize_t n = send(socket_, from + sent, size - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n < 0 && TryAgain()) continue;
    if (n < 0) return -1;
    sent += static_cast<std::size_t>(n);
    sent_ += n;
  }
  return static_cast<ssize_t>(size);
}

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
