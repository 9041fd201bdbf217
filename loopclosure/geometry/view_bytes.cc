#include "loopclosure/geometry/view_bytes.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "loopclosure/store/packed_mat.h"

namespace tutti::internal {
namespace {

// What MakeView gives a feature without a point; all others are saved.
Eigen::Vector3f Unknown() { return Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()); }
bool IsUnknown(const Eigen::Vector3f& point) {
  const Eigen::Vector3f unknown = Unknown();
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): these bits of all that are no number
  return std::memcmp(point.data(), unknown.data(), sizeof(float) * 3) == 0;
}

// Pixels as those of keypoints in a saved odometry (StateOfKeypoints), so that zstd finds the same bytes.
void SaveSet(const View::Set& set, ByteWriter& out) {
  std::vector<float> part(set.pixels.size());
  const auto put_part = [&](const auto& value) {
    std::transform(set.pixels.begin(), set.pixels.end(), part.begin(), value);
    out.PutPlanes(part);
  };
  put_part([](const cv::Point2f& p) { return p.x; });
  put_part([](const cv::Point2f& p) { return p.y; });
  set.descriptors.Put(out);
  std::vector<float> known;
  std::vector<std::uint8_t> is_known((set.points.size() + 7) / 8, 0);
  for (std::size_t i = 0; i < set.points.size(); ++i) {
    const Eigen::Vector3f& p = set.points[i];
    if (IsUnknown(p)) continue;
    is_known[i / 8] = static_cast<std::uint8_t>(is_known[i / 8] | 1U << i % 8);
    known.insert(known.end(), {p.x(), p.y(), p.z()});
  }
  out.Put<std::uint32_t>(static_cast<std::uint32_t>(set.points.size()));
  out.PutRaw(is_known.data(), is_known.size());
  out.PutPlanes(known);
}

void LoadPoints(View::Set& set, ByteReader& in) {
  const auto count = in.Get<std::uint32_t>();
  if (count != 0 && count != set.pixels.size()) in.Damaged("features without points");
  std::vector<std::uint8_t> is_known((count + std::size_t{7}) / 8, 0);
  in.GetRaw(is_known.data(), is_known.size());
  const std::vector<float> known = in.GetPlanes();
  set.points.reserve(count);
  auto next = known.begin();
  for (std::size_t i = 0; i < count; ++i) {
    set.points.push_back(Unknown());
    if ((is_known[i / 8] & 1U << i % 8) == 0) continue;
    if (known.end() - next < 3) in.Damaged("features without points");
    set.points.back() = {next[0], next[1], next[2]};
    next += 3;
  }
  if (next != known.end()) in.Damaged("points without features");
}

View::Set LoadSet(ByteReader& in) {
  View::Set set;
  const std::vector<float> x = in.GetPlanes(), y = in.GetPlanes();
  const auto is_pixel = [](float value) { return std::abs(value) <= View::kFarthestPixel; };  // false for NaN
  if (x.size() != y.size() || !std::all_of(x.begin(), x.end(), is_pixel) ||
      !std::all_of(y.begin(), y.end(), is_pixel)) {
    in.Damaged("a feature at an impossible pixel");
  }
  set.pixels.reserve(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) set.pixels.emplace_back(x[i], y[i]);
  set.descriptors = PackedMat::Get(in);
  if (static_cast<std::size_t>(set.descriptors.rows()) != set.pixels.size())
    in.Damaged("features without descriptors");
  LoadPoints(set, in);
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
  SaveSet(view.caller, out);  // first: next to what it may be like (SectionWriter)
  out.Put<std::uint64_t>(view.members.size());
  for (const View::Set& set : view.members) SaveSet(set, out);
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
  view.caller = LoadSet(in);
  const std::size_t sets = in.GetCount(2 * sizeof(std::uint64_t) + 1);
  for (std::size_t i = 0; i < sets; ++i) view.members.push_back(LoadSet(in));
  if ((has & kHasNumbers) != 0) LoadNumbers(view.caller, in);
  return view;
}

}  // namespace tutti::internal
