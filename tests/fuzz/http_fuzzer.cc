// The live view's server: whatever a client sends, the connection ends in bounded time and the next one is
// answered.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>

#include "apps/view/live_server.h"

namespace {

int Port(const tutti::view::LiveServer& server) {
  const std::string url = server.Url();
  return std::stoi(url.substr(url.rfind(':') + 1));
}

// What comes until the server closes.
std::string Answer(int port, std::string_view request) {
  const int client = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const linger at_once = {1, 0};  // or the ports are used up
  const timeval patience = {10, 0};
  setsockopt(client, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  setsockopt(client, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    throw std::logic_error("no connection");
  while (!request.empty()) {
    const ssize_t sent = send(client, request.data(), request.size(), MSG_NOSIGNAL);
    if (sent <= 0) break;  // refused
    request.remove_prefix(static_cast<std::size_t>(sent));
  }
  shutdown(client, SHUT_WR);
  std::string answer;
  char buffer[4096];
  ssize_t got = 0;
  while ((got = recv(client, buffer, sizeof buffer, 0)) > 0)
    answer.append(buffer, static_cast<std::size_t>(got));
  const bool in_time = got == 0 || errno != EAGAIN;
  close(client);
  if (!in_time) throw std::logic_error("the connection stays open");
  return answer;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static auto* const state = [] {
    auto* made = new tutti::view::LiveState;
    made->Finish();  // streams of news end
    return made;
  }();
  static const auto* const server = [] {
    tutti::LiveViewOptions options;
    options.port = 0;
    return new tutti::view::LiveServer(options, *state);
  }();
  static const int port = Port(*server);
  static std::uint64_t inputs = 0;
  Answer(port, {reinterpret_cast<const char*>(data), size});
  if (++inputs % 256 == 0) {
    const std::string answer = Answer(port, "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    if (answer.rfind("HTTP/1.1 200", 0) != 0) std::abort();
  }
  return 0;
}
