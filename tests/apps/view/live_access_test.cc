#include "apps/view/live_access.h"

#include <gtest/gtest.h>

namespace tutti::view {
namespace {

TEST(LiveAccess, LoopbackIsWhatThisMachineAloneReaches) {
  for (const char* address : {"127.0.0.1", "127.8.9.10", "::1", "localhost"})
    EXPECT_TRUE(IsLoopback(address)) << address;
  for (const char* address :
       {"0.0.0.0", "::", "192.168.1.7", "127.evil.example", "127.0.0.1.evil.example", ""})
    EXPECT_FALSE(IsLoopback(address)) << address;
}

TEST(LiveAccess, AHostHeaderMustNameThisMachine) {
  for (const char* host : {"127.0.0.1:8077", "localhost:8077", "localhost", "[::1]:8077"})
    EXPECT_TRUE(NamesLoopback(host)) << host;
  for (const char* host : {"evil.example", "127.evil.example:8077", "localhost.evil.example",
                           "[::1].evil.example", "[::1]evil", "127.0.0.1.evil.example", ""})
    EXPECT_FALSE(NamesLoopback(host)) << host;
}

TEST(LiveAccess, TokensHave128BitsAndDiffer) {
  const std::string token = RandomToken();
  EXPECT_EQ(token.size(), 32U);
  EXPECT_NE(token, RandomToken());
  EXPECT_TRUE(SameToken(token, token));
  EXPECT_FALSE(SameToken(token, token + "0"));
  EXPECT_FALSE(SameToken(token, ""));
}

}  // namespace
}  // namespace tutti::view
