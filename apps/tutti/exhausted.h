// What ran out, where the system had no more.
#pragma once

#include <exception>
#include <string>

namespace tutti::cli {

/// One sentence that says what ran out (memory, threads, descriptors, disk) and what to lower; empty if
/// `error` is of another kind.
std::string WhatRanOut(const std::exception& error);

}  // namespace tutti::cli
