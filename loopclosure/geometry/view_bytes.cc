#include "loopclosure/geometry/view_bytes.h"

#include <algorithm>
#include <cmath>

namespace tutti::internal {
namespace {

void SaveSet(const View::Set& set, ByteWriter& out) {
  std::vector<float> pixels;
  for (const cv::Point2f& pixel : set.pixels) pixels.insert(pixels.end(), {pixel.x, pixel.y});
  out.PutVector(pixels);
  out.PutMat(set.descriptors);
  std::vector<float> points;
  for (const Eigen::Vector3f& p : set.points) points.insert(points.end(), {p.x(), p.y(), p.z()});
  out.PutVector(points);
}

View::Set LoadSet(ByteReader& in) {
  View::Set set;
  const std::vector<float> pixels = in.GetVector<float>();
  const auto is_pixel = [](float value) { return std::abs(value) <= View::kFarthestPixel; };  // false for NaN
  if (pixels.size() % 2 != 0 || !std::all_of(pixels.begin(), pixels.end(), is_pixel)) {
    in.Damaged("a feature at an impossible pixel");
  }
  for (std::size_t i = 0; i + 1 < pixels.size(); i += 2) set.pixels.emplace_back(pixels[i], pixels[i + 1]);
  set.descriptors = in.GetMat();
  const std::vector<float> points = in.GetVector<float>();
  for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
    set.points.emplace_back(points[i], points[i + 1], points[i + 2]);
  }
  if (static_cast<std::size_t>(set.descriptors.rows) != set.pixels.size() || points.size() % 3 != 0 ||
      (!set.points.empty() && set.points.size() != set.pixels.size())) {
    in.Damaged("features without descriptors");
  }
  return set;
}

void SaveCamera(const PinholeCamera& camera, ByteWriter& out) {
  out.Put<std::int32_t>(camera.width);
  out.Put<std::int32_t>(camera.height);
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) out.Put(value);
  out.Put(static_cast<std::uint8_t>(camera.distortion));
  for (const double value : camera.coefficients) out.Put(value);
}

PinholeCamera LoadCamera(ByteReader& in) {
  PinholeCamera camera;
  camera.width = in.Get<std::int32_t>();
  camera.height = in.Get<std::int32_t>();
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value = in.Get<double>();
  const auto distortion = in.Get<std::uint8_t>();
  if (distortion > static_cast<std::uint8_t>(Distortion::kEquidistant))
    in.Damaged("an unknown lens distortion");
  camera.distortion = static_cast<Distortion>(distortion);
  for (double& value : camera.coefficients) value = in.Get<double>();
  if (!camera.Validate().empty()) in.Damaged("a camera that is not usable");
  return camera;
}

// What a view has beside the least.
constexpr char kHasCamera = 1, kHasRegions = 2, kHasNumbers = 4;

void LoadRegions(View& view, ByteReader& in) {
  const std::vector<std::int32_t> sides = in.GetVector<std::int32_t>();
  if (sides.size() % 4 != 0) in.Damaged("a camera's part of an image without a side");
  for (std::size_t i = 0; i < sides.size(); i += 4) {
    const std::int32_t x = sides[i], y = sides[i + 1], width = sides[i + 2], height = sides[i + 3];
    if (x < 0 || y < 0 || width < 1 || height < 1 || width > View::kFarthestPixel ||
        height > View::kFarthestPixel || x > View::kFarthestPixel || y > View::kFarthestPixel) {
      in.Damaged("a camera's part of an image at an impossible place");
    }
    view.cameras.emplace_back(x, y, width, height);
  }
}

void LoadNumbers(View::Set& set, ByteReader& in) {
  set.numbers = in.GetVector<int>();
  const auto is_number = [](int number) { return number >= 0; };
  if (set.numbers.size() != set.pixels.size() ||
      !std::all_of(set.numbers.begin(), set.numbers.end(), is_number)) {
    in.Damaged("features without numbers");
  }
}

}  // namespace

void SaveView(const View& view, ByteWriter& out) {
  out.Put(view.id);
  out.Put<std::int32_t>(view.size.width);
  out.Put<std::int32_t>(view.size.height);
  out.Put<char>(view.metric ? 1 : 0);
  out.Put(static_cast<char>((view.camera ? kHasCamera : 0) | (view.cameras.empty() ? 0 : kHasRegions) |
                            (view.caller.numbers.empty() ? 0 : kHasNumbers)));
  if (view.camera) SaveCamera(*view.camera, out);
  if (!view.cameras.empty()) {
    std::vector<std::int32_t> sides;
    for (const cv::Rect& r : view.cameras) sides.insert(sides.end(), {r.x, r.y, r.width, r.height});
    out.PutVector(sides);
  }
  out.Put<std::uint64_t>(view.members.size());
  for (const View::Set& set : view.members) SaveSet(set, out);
  SaveSet(view.caller, out);
  if (!view.caller.numbers.empty()) out.PutVector(view.caller.numbers);
}

View LoadView(ByteReader& in) {
  View view;
  view.id = in.Get<std::int64_t>();
  view.size.width = in.Get<std::int32_t>();
  view.size.height = in.Get<std::int32_t>();
  if (view.size.width < 1 || view.size.height < 1) in.Damaged("an image of an impossible size");
  view.metric = in.Get<char>() != 0;
  const char has = in.Get<char>();
  if ((has & ~(kHasCamera | kHasRegions | kHasNumbers)) != 0) in.Damaged("a view of an unknown kind");
  if ((has & kHasCamera) != 0) view.camera = LoadCamera(in);
  if ((has & kHasRegions) != 0) LoadRegions(view, in);
  const std::size_t sets = in.GetCount(2 * sizeof(std::uint64_t) + 1);
  for (std::size_t i = 0; i < sets; ++i) view.members.push_back(LoadSet(in));
  view.caller = LoadSet(in);
  if ((has & kHasNumbers) != 0) LoadNumbers(view.caller, in);
  return view;
}

}  // namespace tutti::internal
