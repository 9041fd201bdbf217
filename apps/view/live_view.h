// `tutti run --view`: a run to look at in a browser while it goes on.
#pragma once

#include <memory>
#include <string>

#include "apps/run/run_observer.h"

namespace tutti {

struct LiveViewOptions {
  std::string address =
      "127.0.0.1";         ///< to listen at; another one than loopback needs the token of LiveView::url
  int port = 8077;         ///< 0: any free one
  double abandoned_s = 3;  ///< a run that is paused goes on when nobody has looked at it for this long [s]
  double idle_s = 0;       ///< wait at most this long for the first viewer before the first frame [s]

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
};

/// A run that is looked at.
struct LiveView {
  std::shared_ptr<RunObserver> observer;  ///< serves the page as long as it lives
  std::string url;                        ///< to open in a browser, with the token if there is one
};

/// Serves one page and its data (server-sent events) from now on, and nothing else. The tracking thread only
/// leaves the newest state; images are encoded and sent by the server's threads, and what a browser is too
/// slow for is left out. Pausing holds the run up as long as somebody looks. Throws InputError if the address
/// or the port can't be used, or tutti was built without cpp-httplib.
///
/// Loopback: requests must name localhost (no other site's page can be made to ask), and commands need a
/// header that other sites can't send. Elsewhere: everything needs a random token of 128 bits.
LiveView OpenLiveView(const LiveViewOptions& options);

}  // namespace tutti
