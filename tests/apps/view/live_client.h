// A client that may send what no browser does.
#pragma once

#include <string>

namespace tutti::view {

class LiveClient {
 public:
  /// Connects to `url` (http://127.0.0.1:PORT/) without waiting for it.
  explicit LiveClient(const std::string& url);
  ~LiveClient();
  LiveClient(const LiveClient&) = delete;
  LiveClient& operator=(const LiveClient&) = delete;

  /// Sends what is taken within a second; returns how much that was.
  std::size_t Send(const std::string& text);
  /// What comes until the server closes the connection, or within the time.
  std::string Answer(double seconds);

 private:
  int socket_;
};

}  // namespace tutti::view
