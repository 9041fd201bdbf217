#include "apps/tutti/exhausted.h"

#include <cerrno>
#include <new>
#include <system_error>

namespace tutti::cli {
namespace {

// OpenCV's exception, which this program does not link.
bool SaysNoMemory(const std::string& text) {
  return text.find("Insufficient memory") != std::string::npos ||
         text.find("Failed to allocate") != std::string::npos;
}

std::string OfCode(const std::error_code& code) {
  if (code.category() != std::system_category() && code.category() != std::generic_category()) return {};
  switch (code.value()) {
    case ENOMEM:
      return "memory";
    case EAGAIN:
      return "threads";
    case EMFILE:
    case ENFILE:
      return "descriptors";
    case ENOSPC:
    case EDQUOT:
      return "disk";
    default:
      return {};
  }
}

}  // namespace

std::string WhatRanOut(const std::exception& error) {
  std::string what;
  const auto* system = dynamic_cast<const std::system_error*>(&error);
  if (system != nullptr) what = OfCode(system->code());
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr || SaysNoMemory(error.what())) what = "memory";
  if (what == "memory")
    return "there is not enough memory; give fewer --threads, smaller images or fewer frames, or raise the "
           "limit "
           "(ulimit -v)";
  if (what == "threads")
    return "the system starts no more threads; give fewer --threads, or raise the limits (ulimit -u, ulimit "
           "-v)";
  if (what == "descriptors")
    return "no more files can be open at a time; give fewer --threads, or raise the limit (ulimit -n)";
  if (what == "disk") return "the disk is full; free some space, or give a folder on another disk";
  return {};
}

}  // namespace tutti::cli
