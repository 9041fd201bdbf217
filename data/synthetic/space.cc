// A room or a hall around a way that is given: as large as the way needs, with nothing in the way.
#include <algorithm>
#include <cmath>

#include "data/synthetic/scene.h"
#include "data/synthetic/synthetic_random.h"
#include "data/synthetic/textures.h"

namespace tutti::synthetic {
namespace {

using Eigen::Vector3d;

// How large things are, and how far from the way.
struct Style {
  double beside_m, above_m, below_m;  // walls, ceiling and floor are so far from the way
  double panel_m;                     // one look of a wall, floor or ceiling
  double posters_each_m;              // of a wall: one on average
  double least_m, most_m;             // edges of what stands around
  double clear_m;                     // from the way
  double box_each_m2;                 // of the floor: one is tried
};
constexpr Style kRoom{1.6, 1.2, 0.5, 2.4, 0.7, 0.3, 1.1, 0.7, 0.8};
constexpr Style kHall{3.0, 3.0, 0.8, 4.0, 1.2, 0.6, 2.6, 1.2, 3.0};

// A wall, floor or ceiling of panels, no two alike. `corner`, `u`, `v` as of a Face.
template <class Look>
void AddPanels(Scene& scene, const Vector3d& corner, const Vector3d& u, const Vector3d& v, double panel_m,
               const Look& look) {
  const int across = std::max(1, static_cast<int>(std::lround(u.norm() / panel_m)));
  const int down = std::max(1, static_cast<int>(std::lround(v.norm() / panel_m)));
  for (int j = 0; j < down; ++j) {
    for (int i = 0; i < across; ++i)
      scene.faces.push_back(
          Quad(corner + i * u / across + j * v / down, u / across, v / down, scene.Add(look())));
  }
}

// Of all sizes, anywhere on the wall: what is near and what is far both have something to show.
void AddPosters(Scene& scene, const Vector3d& corner, const Vector3d& along, double length, double height,
                const Style& style, Random& random) {
  const Vector3d inward(along.y(), -along.x(), 0);
  const int count = static_cast<int>(length * height / (style.posters_each_m * style.posters_each_m) / 2);
  for (int k = 0; k < count; ++k) {
    const double w = style.posters_each_m * random.In(0.3, 1.0), h = w * random.In(0.7, 1.4);
    const double at = random.In(0, std::max(0.1, length - w)), z = random.In(0, std::max(0.1, height - h));
    const int look = scene.Add(SignTexture(random.Bits()));
    scene.faces.push_back(Quad(corner + at * along + (0.02 + 0.0005 * k) * inward - Vector3d(0, 0, z),
                               w * along, {0, 0, -h}, look));
  }
}

// Half the diagonal of a box's floor, whichever way it is turned.
bool IsClear(const Vector3d& base, const Vector3d& size, double clear, const std::vector<Vector3d>& way) {
  const double reach = 0.5 * std::hypot(size.x(), size.y()) + clear;
  return std::all_of(way.begin(), way.end(), [&](const Vector3d& p) {
    return p.z() > base.z() + size.z() + clear || (p - base).head<2>().norm() > reach;
  });
}

}  // namespace

Scene BuildSpaceAround(const SyntheticOptions& options, const std::vector<Vector3d>& way) {
  const bool hall = options.scene == SyntheticScene::kHall;
  const Style& style = hall ? kHall : kRoom;
  Vector3d low = way.front(), high = way.front();
  for (const Vector3d& p : way) low = low.cwiseMin(p), high = high.cwiseMax(p);
  low -= Vector3d(style.beside_m, style.beside_m, style.below_m);
  high += Vector3d(style.beside_m, style.beside_m, style.above_m);
  const Vector3d size = high - low;
  Scene scene;
  Random random(options.seed * 0x2545F491ULL + 47);
  const auto floor = [&] {
    return hall ? PanelTexture(random.Bits(), 120, 90) : GroundTexture(random.Bits());
  };
  const auto ceiling = [&] { return PanelTexture(random.Bits(), 190, 60); };
  const auto wall = [&] { return hall ? WallTexture(random.Bits()) : WallpaperTexture(random.Bits()); };
  const double x = size.x(), y = size.y(), z = size.z();
  AddPanels(scene, {low.x(), high.y(), low.z()}, {x, 0, 0}, {0, -y, 0}, style.panel_m, floor);
  AddPanels(scene, high, {-x, 0, 0}, {0, -y, 0}, style.panel_m, ceiling);
  // Seen from inside, the wall at +x runs from +y on the left to -y on the right.
  const struct {
    Vector3d left, along;
    double length;
  } walls[] = {{high, {0, -1, 0}, y},
               {{high.x(), low.y(), high.z()}, {-1, 0, 0}, x},
               {{low.x(), low.y(), high.z()}, {0, 1, 0}, y},
               {{low.x(), high.y(), high.z()}, {1, 0, 0}, x}};
  for (const auto& w : walls) {
    AddPanels(scene, w.left, w.length * w.along, {0, 0, -z}, style.panel_m, wall);
    AddPosters(scene, w.left, w.along, w.length, z, style, random);
  }
  const int boxes = static_cast<int>(x * y / style.box_each_m2);
  for (int k = 0; k < boxes; ++k) {
    const double length = random.In(style.least_m, style.most_m),
                 width = random.In(style.least_m, style.most_m);
    const double height = random.In(style.least_m, std::min(2 * style.most_m, 0.8 * z));
    const double at_x = random.In(low.x() + 0.5, high.x() - 0.5),
                 at_y = random.In(low.y() + 0.5, high.y() - 0.5);
    const double yaw = random.In(0, M_PI);
    const std::uint64_t front = random.Bits(), side = random.Bits(), top = random.Bits();
    const Vector3d base(at_x, at_y, low.z()), edges(length, width, height);
    if (!IsClear(base, edges, style.clear_m, way)) continue;
    const int shelf = scene.Add(hall ? BusTexture(front) : ShelfTexture(front));
    AppendBox(scene.faces, base, edges, yaw,
              {shelf, scene.Add(SignTexture(side)), scene.Add(WoodTexture(top))});
  }
  // What the world asks of every scene; nothing moves on it.
  scene.routes.emplace_back(SmoothLoop({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, 0.1, 0.2), 1, 1, 1);
  return scene;
}

}  // namespace tutti::synthetic
