#include "tests/apps/view/live_client.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>

#include "core/stopwatch.h"

namespace tutti::view {

LiveClient::LiveClient(const std::string& url) : socket_(socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(url.substr(url.rfind(':') + 1))));
  inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
  static_cast<void>(connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address));
}

LiveClient::~LiveClient() { close(socket_); }

std::size_t LiveClient::Send(const std::string& text) {
  std::size_t sent = 0;
  while (sent < text.size()) {
    pollfd entry{socket_, POLLOUT, 0};
    if (poll(&entry, 1, 1000) <= 0) break;
    const ssize_t n = send(socket_, text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) break;
    sent += static_cast<std::size_t>(n);
  }
  return sent;
}

std::string LiveClient::Answer(double seconds) {
  const double end_s = internal::SteadySeconds() + seconds;
  std::string answer;
  while (true) {
    const double left_s = end_s - internal::SteadySeconds();
    pollfd entry{socket_, POLLIN, 0};
    if (left_s <= 0 || poll(&entry, 1, static_cast<int>(left_s * 1000) + 1) <= 0) return answer;
    char buffer[4096];
    const ssize_t n = recv(socket_, buffer, sizeof buffer, 0);
    if (n <= 0) return answer;
    answer.append(buffer, static_cast<std::size_t>(n));
  }
}

}  // namespace tutti::view
