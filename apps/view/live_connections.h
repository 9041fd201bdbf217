// Who may look at the live view, and which connections to it are open.
#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <string>

namespace tutti::view {

/// 127.0.0.0/8, ::1 and localhost.
bool IsLoopback(const std::string& address);

/// 128 random bits from the system, in hex.
std::string RandomToken();

/// True if both are the same; takes as long for any two of one length.
bool SameToken(const std::string& a, const std::string& b);

/// True if the header Host names this machine: another site's name that was made to point here (DNS
/// rebinding) does not.
bool NamesLoopback(const std::string& host_header);

/// Bounds what strangers can hold open. Thread-safe. Whoever serves a connection calls Enter, Open, Asked
/// (its request is complete) and Leave, in this order; whoever accepts them calls MakeRoom before the next.
class LiveConnections {
 public:
  static constexpr int kMost = 32;              ///< open at a time; others wait in the system's queue
  static constexpr int kReserve = 64;           ///< descriptors that stay free for the run's own files
  static constexpr double kEvictEvery_s = .01;  ///< pace at which room is made, so that a flood costs little

  void Enter();
  /// Returns once one more may be open. While there are kMost, the one that has been sending its request for
  /// longest is ended. At once after Close.
  void MakeRoom();
  /// False: `socket` is to be closed without an answer, because descriptors are scarce, or after Close.
  bool Open(int socket);
  /// The request is complete: no longer ended to make room.
  void Asked(int socket);
  /// The opposite of Enter and Open; close `socket` after it, not before.
  void Leave(int socket);
  /// Ends those that have not asked at once, the others after `grace_s` seconds.
  void Close(double grace_s);

 private:
  struct Connection {
    long number = 0;  // grows with each
    bool asked = false;
  };
  void EvictOldest();  // with mutex_ held

  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<int, Connection> open_;  // by socket
  int entered_ = 0;
  long next_ = 0;
  bool closed_ = false;
};

}  // namespace tutti::view
