#include "apps/view/live_server.h"

#include <httplib.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "apps/view/live_connections.h"
#include "apps/view/live_stream.h"
#include "tutti/core/error.h"

namespace tutti {

namespace assets {  // made by CMake
std::string ViewHead();
std::string ViewScript();
}  // namespace assets

namespace view {
namespace {

constexpr int kMostViewers = 4;
constexpr double kNewsEvery_s = 0.1;            // at most ten messages a second to each
constexpr double kHeartbeat_s = 1;              // a comment, so that a dead one is noticed
constexpr std::size_t kPauseBytes = 64 * 1024;  // of that, while the run stands still
constexpr double kGoodbye_s = 1;                // for viewers to take the last message, once the run is over

// One viewer's stream.
class Viewer {
 public:
  Viewer(LiveState& state, std::atomic<int>& viewers) : state_(state), viewers_(viewers) {
    state_.AddViewer(1);
  }
  ~Viewer() {
    state_.AddViewer(-1);
    --viewers_;
  }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  // The next message; false ends the stream.
  bool Send(httplib::DataSink& sink) {
    LiveNews news;
    if (!state_.WaitForNews(&cursor_, kHeartbeat_s, &news)) {
      if (state_.Closed()) {
        sink.done();
        return true;
      }
      // While the run stands still for it, it has to take more than a connection's buffers hold.
      return Write(sink, ": still here" + std::string(standing_ ? kPauseBytes : 0, ' ') + "\n\n");
    }
    standing_ = news.standing;
    const bool sent = Write(sink, "data: " + LiveMessage(news) + "\n\n");
    std::this_thread::sleep_for(std::chrono::duration<double>(kNewsEvery_s));
    return sent;
  }

 private:
  static bool Write(httplib::DataSink& sink, const std::string& text) {
    sink.write(text.data(), text.size());
    return sink.is_writable();
  }

  LiveState& state_;
  std::atomic<int>& viewers_;
  LiveCursor cursor_;
  bool standing_ = false;
};

// httplib's server, with bounds on what a client may send and hold open.
class BoundedServer : public httplib::Server {
 public:
  explicit BoundedServer(LiveConnections& connections) : connections_(connections) {
    new_task_queue = [&connections] { return new LiveThreads(connections); };  // httplib deletes it
  }

 private:
  // In place of httplib's own, which reads headers of any size for as long as they come.
  bool process_and_close_socket(socket_t socket) override {
    bool served = false;
    try {
      served = connections_.Open(socket) && Serve(socket);
    } catch (const std::exception&) {  // no memory for an answer: the run goes on without it
    }
    connections_.Leave(socket);
    shutdown(socket, SHUT_RDWR);
    close(socket);
    return served;
  }

  bool Serve(int socket) {
    LiveStream stream(socket);
    bool closed = false;
    return process_request(stream, true, closed, [this, socket](httplib::Request& request) {
      connections_.Asked(socket);
      // No request has a body, and nothing is served in parts: neither is read, unpacked or answered.
      request.ranges.clear();
      for (const char* name : {"Content-Length", "Content-Encoding", "Content-Type", "Transfer-Encoding"})
        request.headers.erase(name);
      request.headers.emplace("Content-Length", "0");
    });
  }

  LiveConnections& connections_;
};

}  // namespace

class LiveServer::Impl {
 public:
  Impl(const LiveViewOptions& options, LiveState& state) : options_(options), state_(state) {
    if (!IsLoopback(options.address)) token_ = RandomToken();
    server_.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      Harden(response);
      if (Allowed(request)) return httplib::Server::HandlerResponse::Unhandled;
      Refuse(response, 403, "not allowed");
      return httplib::Server::HandlerResponse::Handled;
    });
    server_.Get("/", [](const httplib::Request&, httplib::Response& response) {
      response.set_content(
          assets::ViewHead() + "<script>" + assets::ViewScript() + "</script>\n</body>\n</html>\n",
          "text/html; charset=utf-8");
    });
    server_.Get("/events",
                [this](const httplib::Request&, httplib::Response& response) { Stream(response); });
    server_.Post("/control", [this](const httplib::Request& request, httplib::Response& response) {
      Control(request, response);
    });
    Listen();
  }

  ~Impl() {
    state_.Close();
    connections_.Close(kGoodbye_s);
    server_.stop();
    if (thread_.joinable()) thread_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  std::string Url() const {
    const bool v6 = options_.address.find(':') != std::string::npos;
    return "http://" + (v6 ? "[" + options_.address + "]" : options_.address) + ":" + std::to_string(port_) +
           "/" + (token_.empty() ? "" : "?token=" + token_);
  }

 private:
  void Listen() {
    port_ = options_.port;
    const bool bound = port_ == 0 ? (port_ = server_.bind_to_any_port(options_.address)) > 0
                                  : server_.bind_to_port(options_.address, port_);
    if (!bound) {
      throw InputError(
          "--view: can't listen at " + options_.address + ", port " + std::to_string(options_.port) +
          "; is it in use, or the address of another machine? --view-port 0 takes any free port");
    }
    thread_ = std::thread([this] {
      try {
        server_.listen_after_bind();
      } catch (const std::exception&) {  // no memory: the run goes on without a view
      }
      over_ = true;
    });
    // httplib's stop() does nothing before the loop runs: a run that fails at once would wait for it for
    // ever.
    while (!server_.is_running() && !over_) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }

  bool Allowed(const httplib::Request& request) const {
    if (!token_.empty()) return SameToken(request.get_param_value("token"), token_);
    return NamesLoopback(request.get_header_value("Host"));
  }

  static void Harden(httplib::Response& response) {
    response.set_header("Cache-Control", "no-store");
    response.set_header("X-Content-Type-Options", "nosniff");
    response.set_header("X-Frame-Options", "DENY");
    response.set_header("Referrer-Policy", "no-referrer");
    response.set_header(
        "Content-Security-Policy",
        "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; "
        "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'");
  }

  static void Refuse(httplib::Response& response, int status, const char* why) {
    response.status = status;
    response.set_content(why, "text/plain");
  }

  void Stream(httplib::Response& response) {
    if (++viewers_ > kMostViewers) {
      --viewers_;
      Refuse(response, 503, "too many viewers");
      return;
    }
    const auto viewer = std::make_shared<Viewer>(state_, viewers_);
    response.set_chunked_content_provider(
        "text/event-stream", [viewer](std::size_t, httplib::DataSink& sink) { return viewer->Send(sink); });
  }

  // Other sites' pages can send a POST, but not this header.
  void Control(const httplib::Request& request, httplib::Response& response) {
    if (!request.has_header("X-Tutti")) return Refuse(response, 403, "not allowed");
    const std::string what = request.get_param_value("do");
    if (what == "pause") {
      state_.Pause(true);
    } else if (what == "resume") {
      state_.Pause(false);
    } else if (what == "step") {
      state_.Step();
    } else {
      return Refuse(response, 400, "pause, resume or step");
    }
    response.status = 204;
  }

  LiveViewOptions options_;
  LiveState& state_;
  std::string token_;
  std::atomic<int> viewers_{0};
  LiveConnections connections_;
  BoundedServer server_{connections_};
  int port_ = 0;
  std::atomic<bool> over_{false};  // no longer listens
  std::thread thread_;
};

LiveServer::LiveServer(const LiveViewOptions& options, LiveState& state)
    : impl_(std::make_unique<Impl>(options, state)) {}
LiveServer::~LiveServer() = default;
std::string LiveServer::Url() const { return impl_->Url(); }

}  // namespace view

std::string LiveViewOptions::Validate() const {
  if (address.empty()) return "the address to listen at must not be empty";
  if (port < 0 || port > 65535) return "the port must be 0 to 65535";
  if (!(abandoned_s >= 0)) return "abandoned_s must be 0 s or more";
  if (!(idle_s >= 0)) return "the time to wait for a viewer must be 0 s or more";
  return {};
}

LiveView OpenLiveView(const LiveViewOptions& options) {
  struct Opened {
    explicit Opened(const LiveViewOptions& given) : state(given), server(given, state) {}
    view::LiveState state;
    view::LiveServer server;  // last: serves the rest
  };
  const auto opened = std::make_shared<Opened>(options);
  return {std::shared_ptr<RunObserver>(opened, &opened->state), opened->server.Url()};
}

}  // namespace tutti
