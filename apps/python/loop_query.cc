#include "apps/python/loop_query.h"

#include <pybind11/numpy.h>

#include <utility>

#include "apps/python/images.h"
#include "apps/python/poses.h"
#include "tutti/core/error.h"

namespace tutti::python {
namespace {

// (N, 2) to (N, 5): x, y, size, angle, response.
std::vector<cv::KeyPoint> KeypointsOf(const py::object& object, const std::string& name) {
  if (object.is_none()) return {};
  const py::array_t<double> rows = RowsOf(object, name, {2, 3, 4, 5});
  std::vector<cv::KeyPoint> keypoints;
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const auto at = [&](int column, float otherwise) {
      return column < rows.shape(1) ? static_cast<float>(rows.at(i, column)) : otherwise;
    };
    keypoints.emplace_back(at(0, 0), at(1, 0), at(2, 1), at(3, -1), at(4, 0));
  }
  return keypoints;
}

Features FeaturesOf(const py::handle& object, const std::string& name) {
  const std::string of = "member_features['" + name + "']";
  Features features;
  if (py::isinstance<py::array>(object)) {  // of the image as a whole
    const auto vector = py::reinterpret_borrow<py::array>(object);
    const py::object row = vector.ndim() == 1 ? vector.attr("reshape")(1, -1) : py::object(vector);
    features.descriptors = DescriptorsOf(row, of.c_str());
    return features;
  }
  if (!py::isinstance<py::tuple>(object) || py::len(object) != 2)
    throw py::type_error(of + " must be (keypoints, descriptors), or one vector for a dense member");
  const auto pair = py::reinterpret_borrow<py::tuple>(object);
  features.keypoints = KeypointsOf(pair[0], of + ": keypoints");
  features.descriptors = DescriptorsOf(pair[1], (of + ": descriptors").c_str());
  return features;
}

// (keypoints, descriptors) or (keypoints, descriptors, points).
FeatureSet FeatureSetOf(const py::object& object) {
  if (!py::isinstance<py::tuple>(object) || py::len(object) < 2 || py::len(object) > 3)
    throw py::type_error("features must be (keypoints, descriptors) or (keypoints, descriptors, points)");
  const auto parts = py::reinterpret_borrow<py::tuple>(object);
  FeatureSet set;
  set.keypoints = KeypointsOf(parts[0], "features: keypoints");
  set.descriptors = DescriptorsOf(parts[1], "features: descriptors");
  if (parts.size() == 3 && !parts[2].is_none()) {
    const py::array_t<double> points = RowsOf(parts[2], "features: points", {3});
    for (py::ssize_t i = 0; i < points.shape(0); ++i)
      set.points.emplace_back(points.at(i, 0), points.at(i, 1), points.at(i, 2));
  }
  return set;
}

}  // namespace

QueryOf MakeQuery(std::int64_t id, const QueryArguments& arguments) {
  QueryOf made;
  LoopQuery& query = made.query;
  query.id = id;
  query.stamp_s = arguments.stamp;
  query.metric = arguments.metric;
  const auto keep = [&made](ImageView view) {
    made.owners.push_back(std::move(view.owner));
    return view.pixels;
  };
  if (arguments.image.is_none() && arguments.member_features.is_none())
    throw py::type_error(
        "image is None, which cv2.imread returns for a file that it can't read; give an array, or "
        "member_features instead of an image");
  query.image = keep(ViewOfImage(arguments.image, "image", arguments.rgb));
  query.depth_m = keep(ViewOfDepth(arguments.depth, "depth"));
  query.mask = keep(ViewOfMask(arguments.mask, "mask"));
  if (!arguments.camera.is_none()) query.camera = arguments.camera.cast<PinholeCamera>();
  if (!arguments.features.is_none()) query.features = FeatureSetOf(arguments.features);
  if (!arguments.pose_prior.is_none()) query.pose_prior = arguments.pose_prior.cast<PosePrior>();
  if (!arguments.member_features.is_none()) {
    if (!py::isinstance<py::dict>(arguments.member_features))
      throw py::type_error("member_features must be a dict: name -> (keypoints, descriptors)");
    for (const auto& [name, features] : py::reinterpret_borrow<py::dict>(arguments.member_features)) {
      const auto word = name.cast<std::string>();
      query.member_features[word] = FeaturesOf(features, word);
    }
  }
  return made;
}

}  // namespace tutti::python
