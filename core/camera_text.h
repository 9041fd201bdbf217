// A camera as users write it in one word, and its lens as other programs name it. Not installed.
#pragma once

#include <string>
#include <vector>

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

/// Sets the distortion of `camera`. `model`: the name that another program gives the lens ("plumb_bob",
/// "KannalaBrandt8", "OPENCV", ...; upper and lower case, blanks and signs don't count); empty: radtan.
/// `values`: k1 k2 p1 p2 k3 and what OpenCV has behind them, or k1 k2 k3 k4 of a fisheye. A model that tutti
/// hasn't got passes where its coefficients make it one that tutti has. Returns what is wrong and what to do;
/// empty: nothing.
std::string SetLens(const std::string& model, const std::vector<double>& values, PinholeCamera& camera);

}  // namespace tutti::internal
#pragma GCC visibility pop
