// A camera in the network.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "tests/frontend/dataset/dataset_files.h"

namespace tutti {
namespace {
using ::testing::AllOf, ::testing::HasSubstr;
using testing::FrameOf, testing::OpenError, testing::With;

// Sends so many pictures as network cameras do (motion JPEG) to everyone who asks, and then hangs up.
class NetworkCamera {
 public:
  explicit NetworkCamera(int frames) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(listen(socket_, 4), 0);
    EXPECT_EQ(getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    url_ = "http://127.0.0.1:" + std::to_string(ntohs(address.sin_port)) + "/video";
    thread_ = std::thread([this, frames] { Serve(frames); });
  }
  ~NetworkCamera() {
    shutdown(socket_, SHUT_RDWR);
    thread_.join();
    close(socket_);
  }
  const std::string& url() const { return url_; }

 private:
  void Serve(int frames) const {
    while (true) {
      const int client = accept(socket_, nullptr, nullptr);
      if (client < 0) return;
      char request[2000];
      if (recv(client, request, sizeof request, 0) > 0) Send(client, frames);
      close(client);
    }
  }
  static void Send(int client, int frames) {
    std::string text = "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=next\r\n\r\n";
    for (int i = 0; i < frames; ++i) {
      std::vector<unsigned char> jpeg;
      cv::imencode(".jpg", cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(20 + i)), jpeg);
      text += "--next\r\nContent-Type: image/jpeg\r\nContent-Length: " + std::to_string(jpeg.size()) +
              "\r\n\r\n" + std::string(jpeg.begin(), jpeg.end()) + "\r\n";
    }
    for (std::size_t sent = 0; sent < text.size();) {
      const ssize_t now = send(client, text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
      if (now <= 0) return;
      sent += static_cast<std::size_t>(now);
    }
  }

  int socket_;
  std::string url_;
  std::thread thread_;
};

TEST(Stream, GivesItsFramesOnceInOrderUntilItEnds) {
  constexpr int kFrames = 60;
  const NetworkCamera camera(kFrames);
  const auto dataset = OpenDataset(camera.url(), With(Sensor::kMono, true));
  EXPECT_EQ(dataset->FrameSupply(), Supply::kOnce);
  std::size_t frames = 0;
  double before = 0;
  for (; dataset->WaitFor(frames, [] { return false; }); ++frames) {
    const InputFrame read = FrameOf(*dataset, frames);
    EXPECT_EQ(read.image.size(), cv::Size(64, 48));
    EXPECT_GT(read.stamp_s, before);
    before = read.stamp_s;
  }
  EXPECT_GE(frames, std::size_t{kFrames - 2});  // FFmpeg may keep the last for itself
  EXPECT_LE(frames, std::size_t{kFrames});
}

TEST(Stream, IsToldByItsAddressAndNoFile) {
  for (const char* name :
       {"rtsp://robot/front", "rtsps://a/b", "http://10.0.0.1:8080/", "https://a/b.mjpg"}) {
    EXPECT_TRUE(IsStream(name)) << name;
    EXPECT_TRUE(IsCamera(name)) << name;
    EXPECT_TRUE(IsCameraDevice(name)) << name;  // keeps its own time
  }
  for (const char* name : {"camera:0", "http.avi", "rtsp:", "/data/http://x", "ftp://a/b"})
    EXPECT_FALSE(IsStream(name)) << name;
}

TEST(Stream, ThatIsNotThereIsNamed) {
  EXPECT_THAT(OpenError("http://127.0.0.1:1/nobody", With(Sensor::kMono, true)),
              AllOf(HasSubstr("http://127.0.0.1:1/nobody"), HasSubstr("no stream of video")));
  EXPECT_THAT(OpenError("rtsp://127.0.0.1:1/nobody", With(Sensor::kRgbd, true)),
              HasSubstr("needs two cameras"));
}

}  // namespace
}  // namespace tutti
