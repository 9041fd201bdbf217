// The HTTP side of the live view.
#pragma once

#include <memory>
#include <string>

#include "apps/view/live_state.h"
#include "apps/view/live_view.h"

namespace tutti::view {

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
