// The HTTP side of the live view, and what it sends.
#pragma once

#include <memory>
#include <string>

#include "apps/view/live_state.h"

namespace tutti::view {

/// JSON of the news, one line. The image is a JPEG of at most 640 px as a data URI; tracks are some of the
/// landmarks that the frame shows: their pixels in that image, newest first (TracksOf).
std::string LiveMessage(const LiveNews& news);

/// GET / (the page), GET /events (server-sent events), POST /control?do=pause|resume|step. Everything else is
/// 404.
class LiveServer {
 public:
  /// Throws InputError if it can't listen.
  LiveServer(const LiveViewOptions& options, LiveState& state);
  ~LiveServer();
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  std::string Url() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tutti::view
