// A camera as users write it in one word. Not installed.
#pragma once

#include <string>

#include "tutti/core/camera.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// How it is written, for help and messages.
constexpr const char* kCameraText = "fx,fy,cx,cy[,k1,k2,p1,p2[,k3]]";

/// The camera of a text like that [px]; width and height stay 0. Throws InputError that names `option`.
PinholeCamera ParseCamera(const std::string& text, const std::string& option = "--camera");

/// A width or height that a file gives as any number [px]. Of what is no such size: -1, which
/// PinholeCamera::Validate refuses.
int PixelsOf(double value);

}  // namespace tutti::internal
#pragma GCC visibility pop
