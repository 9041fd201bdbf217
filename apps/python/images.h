// Images as numpy arrays, and back, without copies where that can be.
#pragma once

#include <pybind11/numpy.h>

#include <opencv2/core.hpp>

namespace tutti::python {

/// The pixels of an array, and what keeps them.
struct ImageView {
  cv::Mat pixels;         ///< empty for None; those of the array itself where each of its rows is contiguous
  pybind11::array owner;  ///< `pixels` are good as long as it lives
};

/// uint8 or uint16 of shape (H, W), or uint8 (H, W, 3), whose channels are as OpenCV has them (blue first)
/// unless `rgb`. Raises TypeError or ValueError, which call the array `name`.
ImageView ViewOfImage(const pybind11::object& array, const char* name, bool rgb = false);
/// float32 or float64 (H, W), metres.
ImageView ViewOfDepth(const pybind11::object& array, const char* name);
/// uint8 or bool (H, W).
ImageView ViewOfMask(const pybind11::object& array, const char* name);
/// One descriptor a row: uint8 or float32 (N, D). Owns its numbers.
cv::Mat DescriptorsOf(const pybind11::object& array, const char* name);

/// A read-only array on the pixels, which it keeps; None if there are none.
pybind11::object ArrayOfImage(const cv::Mat& image);

}  // namespace tutti::python
