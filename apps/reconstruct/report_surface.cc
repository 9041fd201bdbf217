#include "apps/reconstruct/written_maps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <unordered_map>
#include <utility>
#include <vector>

#include "apps/dense/voxel_blocks.h"
#include "apps/report/page.h"
#include "core/replaced_file.h"
#include "tutti/core/pose.h"

namespace tutti {
namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kMostVertices = 30'000;  // with twice as many triangles, 0.7 MB of a page

// Vertices of the same cell are one: the sums of their places and colours, and how many they are.
class Clusters {
 public:
  Clusters(const PointCloud& vertices, const Eigen::Vector3f& low, double cell) {
    std::unordered_map<std::uint64_t, std::uint32_t> numbers;
    cluster_of.reserve(vertices.points.size());
    for (std::size_t i = 0; i < vertices.points.size(); ++i) {
      const Eigen::Vector3d at = (vertices.points[i] - low).cast<double>() / cell;
      const std::uint64_t key = BlockKey(at.array().floor().matrix().cast<int>());
      const auto [found, is_new] = numbers.emplace(key, static_cast<std::uint32_t>(sums_.size()));
      if (is_new) sums_.push_back(Vector7d::Zero());
      cluster_of.push_back(found->second);
      sums_[found->second] += Sum(vertices, i);
    }
  }

  std::size_t Count() const { return sums_.size(); }

  PointCloud Means() const {
    PointCloud means;
    for (const Vector7d& sum : sums_) {
      means.points.emplace_back((sum.head<3>() / sum[6]).cast<float>());
      means.colours.emplace_back();
      for (int c = 0; c < 3; ++c)
        means.colours.back()[static_cast<std::size_t>(c)] =
            static_cast<std::uint8_t>(std::lround(sum[3 + c] / sum[6]));
    }
    return means;
  }

  std::vector<std::uint32_t> cluster_of;  // by vertex

 private:
  using Vector7d = Eigen::Matrix<double, 7, 1>;

  static Vector7d Sum(const PointCloud& vertices, std::size_t i) {
    Vector7d sum;
    sum << vertices.points[i].cast<double>(), vertices.colours[i][0], vertices.colours[i][1],
        vertices.colours[i][2], 1;
    return sum;
  }

  std::vector<Vector7d> sums_;
};

template <class T>
std::string Packed(const std::vector<T>& values) {  // little-endian, as all that Debian builds for
  return Base64(values.data(), values.size() * sizeof(T));
}

Similarity AlignmentOf(const Json& json) {
  Similarity alignment;
  alignment.scale = json.at("scale").get<double>();
  const auto q = json.at("rotation").get<std::vector<double>>(),
             t = json.at("translation").get<std::vector<double>>();
  alignment.rotation = Eigen::Quaterniond(q.at(3), q.at(0), q.at(1), q.at(2));
  alignment.translation = Eigen::Vector3d(t.at(0), t.at(1), t.at(2));
  return alignment;
}

// Places as 16 bit numbers within a cube.
Json SurfaceJson(const TriangleMesh& mesh, const Similarity& alignment) {
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
  for (const Eigen::Vector3f& point : mesh.vertices.points) {
    points.push_back(alignment * point.cast<double>());
    low = low.cwiseMin(points.back());
    high = high.cwiseMax(points.back());
  }
  constexpr double kSteps = 65535;
  const double step = std::max(1e-6, (high - low).maxCoeff()) / kSteps;
  std::vector<std::uint16_t> places, corners;
  std::vector<std::uint8_t> colours;
  for (const Eigen::Vector3d& point : points)
    for (int k = 0; k < 3; ++k)
      places.push_back(static_cast<std::uint16_t>(std::lround((point[k] - low[k]) / step)));
  for (const auto& colour : mesh.vertices.colours)
    colours.insert(colours.end(), colour.begin(), colour.end());
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t corner : triangle) corners.push_back(static_cast<std::uint16_t>(corner));
  return {{"low", {low.x(), low.y(), low.z()}},
          {"step", step},
          {"places", Packed(places)},
          {"colours", Packed(colours)},
          {"corners", Packed(corners)}};
}

}  // namespace

TriangleMesh Thinned(const TriangleMesh& surface, std::size_t most) {
  if (surface.vertices.points.size() <= most) return surface;
  Eigen::Vector3f low = surface.vertices.points.front(), high = low;
  for (const Eigen::Vector3f& point : surface.vertices.points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  // From cells that are too small; each step leaves about two thirds of the vertices.
  constexpr double kGrowth = 1.22;
  double cell = std::max(1e-6, static_cast<double>((high - low).maxCoeff())) / 1000;
  std::optional<Clusters> clusters(std::in_place, surface.vertices, low, cell);
  for (; clusters->Count() > most; clusters.emplace(surface.vertices, low, cell)) cell *= kGrowth;
  TriangleMesh thin;
  thin.vertices = clusters->Means();
  std::set<std::array<std::uint32_t, 3>> seen;  // the least corner first
  for (const auto& [a, b, c] : surface.triangles) {
    std::array<std::uint32_t, 3> corners = {clusters->cluster_of[a], clusters->cluster_of[b],
                                            clusters->cluster_of[c]};
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) continue;
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    if (seen.insert(corners).second) thin.triangles.push_back(corners);
  }
  return thin;
}

bool ShowInReport(const std::filesystem::path& folder, const TriangleMesh& surface) {
  std::optional<Json> run = ReadRunReport(folder);
  if (!run || !run->contains("alignment") || surface.triangles.empty()) return false;
  (*run)["surface"] = SurfaceJson(Thinned(surface, kMostVertices), AlignmentOf((*run)["alignment"]));
  internal::WriteFile(folder / "report.json",
                      run->dump(-1, ' ', false, Json::error_handler_t::replace) + "\n");
  WriteReportPage(folder / "report.html", SingleRunPage(std::move(*run)));
  return ReportsAvailable();
}

}  // namespace tutti
