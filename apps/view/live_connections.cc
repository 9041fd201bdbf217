#include "apps/view/live_connections.h"

#include <sys/resource.h>
#include <sys/socket.h>

#include <chrono>
#include <cstdio>
#include <random>

namespace tutti::view {
namespace {

// The system gives the lowest free number, so a high one says that few are left.
bool DescriptorsAreScarce(int socket) {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return false;
  return static_cast<rlim_t>(socket) + LiveConnections::kReserve >= limit.rlim_cur;
}

// 127.0.0.0/8. Numbers alone: "127.evil.example" is a name.
bool IsLoopbackV4(const std::string& host) {
  return host.rfind("127.", 0) == 0 && host.find_first_not_of("0123456789.") == std::string::npos;
}

}  // namespace

bool IsLoopback(const std::string& address) {
  return address == "localhost" || address == "::1" || IsLoopbackV4(address);
}

std::string RandomToken() {
  std::random_device device;  // the system's generator
  std::string token;
  for (int i = 0; i < 4; ++i) {
    char word[9];
    std::snprintf(word, sizeof word, "%08x", static_cast<unsigned>(device()));
    token += word;
  }
  return token;
}

bool SameToken(const std::string& a, const std::string& b) {
  unsigned difference = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i)
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  return difference == 0;
}

bool NamesLoopback(const std::string& host_header) {
  const std::string v6 = "[::1]";
  if (host_header == v6 || host_header.rfind(v6 + ":", 0) == 0) return true;
  const std::string host = host_header.substr(0, host_header.find(':'));
  return host == "localhost" || IsLoopbackV4(host);
}

void LiveConnections::Enter() {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++entered_;
}

void LiveConnections::MakeRoom() {
  std::unique_lock<std::mutex> lock(mutex_);
  const auto room = [this] { return closed_ || entered_ < kMost; };
  while (!room()) {
    EvictOldest();
    changed_.wait_for(lock, std::chrono::duration<double>(kEvictEvery_s), [this] { return closed_; });
  }
}

bool LiveConnections::Open(int socket) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (closed_ || DescriptorsAreScarce(socket)) return false;
  open_[socket].number = next_++;
  return true;
}

void LiveConnections::Asked(int socket) {
  const std::lock_guard<std::mutex> lock(mutex_);
  open_[socket].asked = true;
}

void LiveConnections::Leave(int socket) {
  const std::lock_guard<std::mutex> lock(mutex_);
  open_.erase(socket);
  --entered_;
  changed_.notify_all();
}

void LiveConnections::Close(double grace_s) {
  std::unique_lock<std::mutex> lock(mutex_);
  closed_ = true;
  changed_.notify_all();
  for (const auto& [socket, connection] : open_) {
    if (!connection.asked) shutdown(socket, SHUT_RDWR);
  }
  changed_.wait_for(lock, std::chrono::duration<double>(grace_s), [this] { return open_.empty(); });
  for (const auto& entry : open_) shutdown(entry.first, SHUT_RDWR);
}

void LiveConnections::EvictOldest() {
  auto oldest = open_.end();
  for (auto it = open_.begin(); it != open_.end(); ++it) {
    if (!it->second.asked && (oldest == open_.end() || it->second.number < oldest->second.number))
      oldest = it;
  }
  if (oldest != open_.end()) shutdown(oldest->first, SHUT_RDWR);
}

}  // namespace tutti::view
