#include "apps/run/checkpoint.h"

#include <chrono>
#include <exception>
#include <utility>

namespace tutti {

Checkpointer::~Checkpointer() {
  if (writing_.valid()) writing_.wait();
}

bool Checkpointer::Due() {
  if (writing_.valid()) {
    if (writing_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
    Wait();
  }
  return !since_ || since_->Seconds() >= interval_s_;
}

void Checkpointer::Begin(MapSnapshot snapshot, std::function<void(const MapSink&)> more) {
  Wait();
  since_.emplace();
  writing_ = std::async(std::launch::async, [file = file_, snapshot = std::move(snapshot),
                                             more = std::move(more)] { snapshot.Write(file, more); });
}

void Checkpointer::Wait() {
  if (!writing_.valid()) return;
  try {
    writing_.get();
  } catch (const std::exception& error) {
    problem_ = std::string("no checkpoint: ") + error.what();
  }
}

std::optional<std::string> Checkpointer::TakeProblem() { return std::exchange(problem_, std::nullopt); }

}  // namespace tutti
