#include "apps/view/live_access.h"

#include <cstdio>
#include <random>

namespace tutti::view {
namespace {

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

}  // namespace tutti::view
