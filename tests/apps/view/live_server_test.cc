#include "apps/view/live_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tutti/core/error.h"

namespace tutti::view {
namespace {

LiveViewOptions AnyPort() {
  LiveViewOptions options;
  options.port = 0;
  return options;
}

// A run whose data set is missing ends before anybody has looked at it.
TEST(LiveServer, StopsAtOnceHoweverEarly) {
  for (int k = 0; k < 200; ++k) {
    LiveState state;
    const LiveServer server(AnyPort(), state);
    EXPECT_THAT(server.Url(), ::testing::StartsWith("http://127.0.0.1:"));
  }
}

TEST(LiveServer, SaysThatItCanNotListen) {
  LiveState state;
  LiveViewOptions options = AnyPort();
  options.address = "192.0.2.1";  // of no machine (RFC 5737)
  EXPECT_THROW(LiveServer(options, state), InputError);
}

}  // namespace
}  // namespace tutti::view
