#include "apps/view/live_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <memory>
#include <thread>
#include <vector>

#include "apps/view/live_connections.h"
#include "core/stopwatch.h"
#include "tests/apps/view/live_client.h"
#include "tutti/core/error.h"

namespace tutti::view {
namespace {

LiveViewOptions AnyPort() {
  LiveViewOptions options;
  options.port = 0;
  return options;
}

std::string Get(const std::string& path, const std::string& headers = "") {
  return "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
}

const std::string kPause = "POST /control?do=pause HTTP/1.1\r\nHost: localhost\r\nX-Tutti: 1\r\n\r\n";

class LiveServerTest : public ::testing::Test {
 protected:
  // What comes for a request.
  std::string Answer(const std::string& request, double seconds = 2) const {
    LiveClient client(server.Url());
    client.Send(request);
    return client.Answer(seconds);
  }

  LiveState state;
  const LiveServer server{AnyPort(), state};
};

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

int OpenDescriptors() {
  int n = 0;
  for (auto it = std::filesystem::directory_iterator("/proc/self/fd");
       it != std::filesystem::directory_iterator(); ++it)
    ++n;
  return n;
}

void Wait(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

TEST_F(LiveServerTest, AThousandConnectionsUseUpNoDescriptors) {
  const int before = OpenDescriptors();
  std::vector<std::unique_ptr<LiveClient>> clients;
  int most = 0;
  for (int k = 0; k < 400; ++k) {
    clients.push_back(std::make_unique<LiveClient>(server.Url()));
    if (k % 10 == 0) Wait(0.005);
    most = std::max(most, OpenDescriptors() - before - static_cast<int>(clients.size()));
  }
  Wait(0.3);
  most = std::max(most, OpenDescriptors() - before - static_cast<int>(clients.size()));
  EXPECT_LE(most, 32);
}

TEST_F(LiveServerTest, LastDescriptorsAreTheRuns) {
  EXPECT_THAT(Answer(Get("/")), ::testing::StartsWith("HTTP/1.1 200"));
  rlimit all{};
  getrlimit(RLIMIT_NOFILE, &all);
  const rlimit few{60, all.rlim_max};
  setrlimit(RLIMIT_NOFILE, &few);
  EXPECT_EQ(Answer(Get("/")), "");
  setrlimit(RLIMIT_NOFILE, &all);
}

TEST_F(LiveServerTest, SlowClientsDoNotHoldUpThePage) {
  std::vector<std::unique_ptr<LiveClient>> slow;
  for (int k = 0; k < 50; ++k) {
    slow.push_back(std::make_unique<LiveClient>(server.Url()));
    slow.back()->Send("GET / HT");
    Wait(0.005);
  }
  EXPECT_THAT(Answer(Get("/"), 3), ::testing::StartsWith("HTTP/1.1 200"));
}

// Until the server has written all that it can: messages of megabytes take a sanitizer's build seconds to
// make, and far longer beside other programs.
void WaitUntilIdle() {
  constexpr double kWindow_s = 0.5, kIdle = 0.02;
  for (int k = 0; k < 200; ++k) {
    const std::clock_t before = std::clock();  // processor time of all threads
    Wait(kWindow_s);
    if (static_cast<double>(std::clock() - before) < kIdle * kWindow_s * CLOCKS_PER_SEC) return;
  }
  FAIL() << "it is never idle";
}

TEST(LiveServer, EndsWithinTwoSecondsWhateverClientsDo) {
  LiveState state;
  auto server = std::make_unique<LiveServer>(AnyPort(), state);
  std::vector<std::unique_ptr<LiveClient>> slow;
  slow.reserve(14);
  for (int k = 0; k < 10; ++k) slow.push_back(std::make_unique<LiveClient>(server->Url()));
  for (int k = 0; k < 4; ++k) {  // viewers that take nothing
    slow.push_back(std::make_unique<LiveClient>(server->Url()));
    slow.back()->Send(Get("/events"));
  }
  std::atomic<bool> over{false};
  std::thread byte_for_byte([&] {
    while (!over) {
      for (int k = 0; k < 10; ++k) slow[static_cast<std::size_t>(k)]->Send("G");
      Wait(0.2);
    }
  });
  for (int k = 0; k < 200; ++k) state.Log(std::string(100000, 'x'));  // more than the sockets' buffers hold
  WaitUntilIdle();
  state.Finish();
  const double begin_s = internal::SteadySeconds();
  server.reset();
  EXPECT_LT(internal::SteadySeconds() - begin_s, 2);
  over = true;
  byte_for_byte.join();
}

// The system's buffers take what is sent to them for a long time, and pauses say little.
TEST_F(LiveServerTest, ViewersThatReadNothingDoNotHoldUpAPause) {
  std::vector<std::unique_ptr<LiveClient>> silent;
  for (int k = 0; k < 6; ++k) {
    silent.push_back(std::make_unique<LiveClient>(server.Url()));
    silent.back()->Send(Get("/events"));
  }
  for (int k = 0; k < 500 && state.Viewers() < 4; ++k) Wait(0.01);
  ASSERT_EQ(state.Viewers(), 4);
  state.Log("a frame");
  EXPECT_THAT(Answer(kPause), ::testing::StartsWith("HTTP/1.1 204"));
  std::atomic<bool> goes_on{false};
  std::thread run([&] {
    state.WaitWhilePaused(0.5);
    goes_on = true;
  });
  for (int k = 0; k < 600 && !goes_on; ++k) Wait(0.1);
  EXPECT_TRUE(goes_on);
  state.Close();
  run.join();
}

// Whoever reads holds it up as long as it likes.
TEST_F(LiveServerTest, AViewerThatReadsHoldsUpAPause) {
  LiveClient reads(server.Url());
  reads.Send(Get("/events"));
  for (int k = 0; k < 500 && state.Viewers() < 1; ++k) Wait(0.01);
  state.Pause(true);
  std::atomic<bool> goes_on{false};
  std::thread run([&] {
    state.WaitWhilePaused(0.5);
    goes_on = true;
  });
  EXPECT_GT(reads.Answer(8).size(), 100000u);
  EXPECT_FALSE(goes_on);
  state.Pause(false);
  run.join();
}

TEST_F(LiveServerTest, HeadersHaveABound) {
  LiveClient client(server.Url());
  std::size_t sent = client.Send("GET / HTTP/1.1\r\n");
  const std::string header = "X: " + std::string(1000, 'a') + "\r\n";
  while (sent < 100000000 && client.Send(header) == header.size()) sent += header.size();
  EXPECT_LT(sent, 20000000U);  // what the sockets' buffers take
}

TEST_F(LiveServerTest, RangesAreNotCopies) {
  std::string ranges = "Range: bytes=0-";
  for (int k = 0; k < 1500; ++k) ranges += ",0-";
  EXPECT_EQ(Answer(Get("/", ranges + "\r\n")), Answer(Get("/")));
}

TEST_F(LiveServerTest, BodiesAreNotWaitedFor) {
  EXPECT_THAT(Answer(kPause.substr(0, kPause.size() - 2) + "Content-Length: 1000\r\n\r\n"),
              ::testing::StartsWith("HTTP/1.1 204"));
}

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
