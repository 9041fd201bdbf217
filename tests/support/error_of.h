// What a call complains about.
#pragma once

#include <string>

#include "tutti/core/error.h"

namespace tutti::testing {

/// Message of the InputError that a call throws; "no error" if it throws none.
template <typename F>
std::string ErrorOf(F call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace tutti::testing
