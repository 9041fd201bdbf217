// Preloaded into a program: the machine's clock goes back by a day whenever it is asked again.
#include <dlfcn.h>
#include <sys/time.h>

#include <atomic>
#include <ctime>

namespace {

constexpr std::time_t kDayS = 86400;

int Ask(clockid_t clock, timespec* now) {
  static const auto real = reinterpret_cast<int (*)(clockid_t, timespec*)>(dlsym(RTLD_NEXT, "clock_gettime"));
  static std::atomic<std::time_t> asked{0};
  const int result = real(clock, now);
  if (clock == CLOCK_REALTIME && result == 0) now->tv_sec -= kDayS * asked++;
  return result;
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* now) noexcept { return Ask(clock, now); }

std::time_t time(std::time_t* now) noexcept {
  timespec precise{};
  Ask(CLOCK_REALTIME, &precise);
  if (now != nullptr) *now = precise.tv_sec;
  return precise.tv_sec;
}

int gettimeofday(timeval* now, void* /*zone*/) noexcept {
  timespec precise{};
  Ask(CLOCK_REALTIME, &precise);
  now->tv_sec = precise.tv_sec;
  now->tv_usec = precise.tv_nsec / 1000;
  return 0;
}

}  // extern "C"
