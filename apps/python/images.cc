#include "apps/python/arrays.h"

#include <opencv2/imgproc.hpp>
#include <string>

namespace tutti::python {
namespace {

namespace py = pybind11;

std::string Shown(const py::array& array) {
  std::string text = py::str(array.dtype()).cast<std::string>() + " of shape (";
  for (py::ssize_t i = 0; i < array.ndim(); ++i) text += (i > 0 ? ", " : "") + std::to_string(array.shape(i));
  return text + ")";
}

py::array AsArray(const py::object& object, const char* name, const std::string& wanted) {
  if (py::isinstance<py::array>(object)) return py::reinterpret_borrow<py::array>(object);
  throw py::type_error(std::string(name) + " must be a numpy array, " + wanted + ", not " +
                       py::str(py::type::of(object).attr("__name__")).cast<std::string>());
}

[[noreturn]] void WrongType(const py::array& array, const char* name, const std::string& wanted) {
  throw py::type_error(std::string(name) + " must be " + wanted + ", not " + Shown(array));
}

[[noreturn]] void WrongShape(const py::array& array, const char* name, const std::string& wanted) {
  throw py::value_error(std::string(name) + " must be " + wanted + ", not " + Shown(array));
}

// OpenCV knows a step from row to row; within a row there are no gaps.
bool RowsAreContiguous(const py::array& array) {
  py::ssize_t step = array.itemsize();
  for (py::ssize_t i = array.ndim() - 1; i >= 1; --i) {
    if (array.shape(i) > 1 && array.strides(i) != step) return false;
    step *= array.shape(i);
  }
  return array.shape(0) <= 1 || array.strides(0) >= step;
}

ImageView ViewOf(py::array array, const char* name, const std::string& wanted, int depth) {
  const bool colour = array.ndim() == 3;
  for (py::ssize_t i = 0; i < array.ndim(); ++i) {
    if (array.shape(i) < 1 || array.shape(i) > (1 << 20)) WrongShape(array, name, wanted);
  }
  if (!RowsAreContiguous(array)) array = py::array::ensure(array, py::array::c_style);
  const auto step =
      array.shape(0) > 1 ? static_cast<std::size_t>(array.strides(0)) : std::size_t{cv::Mat::AUTO_STEP};
  // The library reads what it is given, and writes nothing.
  void* data = const_cast<void*>(array.data());  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  const cv::Mat pixels(static_cast<int>(array.shape(0)), static_cast<int>(array.shape(1)),
                       CV_MAKETYPE(depth, colour ? 3 : 1), data, step);
  return {pixels, array};
}

}  // namespace

ImageView ViewOfImage(const py::object& object, const char* name, bool rgb) {
  static const std::string kWanted = "uint8 of shape (H, W) or (H, W, 3), or uint16 of shape (H, W)";
  if (object.is_none()) return {};
  const py::array array = AsArray(object, name, kWanted);
  const bool wide = py::isinstance<py::array_t<std::uint16_t>>(array);
  if (!wide && !py::isinstance<py::array_t<std::uint8_t>>(array)) WrongType(array, name, kWanted);
  if (array.ndim() != 2 && (array.ndim() != 3 || array.shape(2) != 3 || wide))
    WrongShape(array, name, kWanted);
  ImageView view = ViewOf(array, name, kWanted, wide ? CV_16U : CV_8U);
  if (rgb && view.pixels.channels() == 3) {
    cv::Mat bgr;
    cv::cvtColor(view.pixels, bgr, cv::COLOR_RGB2BGR);
    view.pixels = bgr;
  }
  return view;
}

ImageView ViewOfDepth(const py::object& object, const char* name) {
  static const std::string kWanted = "metres as float32 of shape (H, W)";
  if (object.is_none()) return {};
  py::array array = AsArray(object, name, kWanted);
  if (py::isinstance<py::array_t<double>>(array)) array = py::array_t<float>::ensure(array);
  if (!py::isinstance<py::array_t<float>>(array)) WrongType(array, name, kWanted);
  if (array.ndim() != 2) WrongShape(array, name, kWanted);
  return ViewOf(array, name, kWanted, CV_32F);
}

ImageView ViewOfMask(const py::object& object, const char* name) {
  static const std::string kWanted = "uint8 or bool of shape (H, W)";
  if (object.is_none()) return {};
  const py::array array = AsArray(object, name, kWanted);
  if (!py::isinstance<py::array_t<std::uint8_t>>(array) && !py::isinstance<py::array_t<bool>>(array))
    WrongType(array, name, kWanted);
  if (array.ndim() != 2) WrongShape(array, name, kWanted);
  return ViewOf(array, name, kWanted, CV_8U);
}

cv::Mat DescriptorsOf(const py::object& object, const char* name) {
  static const std::string kWanted = "uint8 or float32 of shape (N, D)";
  const py::array array = AsArray(object, name, kWanted);
  const bool real = py::isinstance<py::array_t<float>>(array);
  if (!real && !py::isinstance<py::array_t<std::uint8_t>>(array)) WrongType(array, name, kWanted);
  if (array.ndim() != 2) WrongShape(array, name, kWanted);
  if (array.shape(0) == 0) return {};
  return ViewOf(array, name, kWanted, real ? CV_32F : CV_8U).pixels.clone();
}

py::object ArrayOfImage(const cv::Mat& image) {
  if (image.empty()) return py::none();
  py::dtype type = py::dtype::of<std::uint8_t>();
  if (image.depth() == CV_32F) type = py::dtype::of<float>();
  if (image.depth() == CV_16U) type = py::dtype::of<std::uint16_t>();
  const py::capsule owner(new cv::Mat(image), [](void* mat) { delete static_cast<cv::Mat*>(mat); });
  std::vector<py::ssize_t> shape = {image.rows, image.cols};
  std::vector<py::ssize_t> strides = {static_cast<py::ssize_t>(image.step[0]),
                                      static_cast<py::ssize_t>(image.elemSize())};
  if (image.channels() > 1) {
    shape.push_back(image.channels());
    strides.push_back(static_cast<py::ssize_t>(image.elemSize1()));
  }
  py::array array(type, shape, strides, image.data, owner);
  array.attr("flags").attr("writeable") = false;  // the library may still be reading them
  return array;
}

}  // namespace tutti::python
