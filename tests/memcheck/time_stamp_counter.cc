// Preloaded into programs under valgrind, see run.py.
namespace hwy::platform {

__attribute__((visibility("default"))) unsigned long TimerResolution() { return 1; }

}  // namespace hwy::platform
