// A furnished room, walked around in.
#include <cmath>

#include "data/synthetic/scene.h"
#include "data/synthetic/synthetic_random.h"
#include "data/synthetic/textures.h"

namespace tutti::synthetic {
namespace {

using Eigen::Vector3d;

constexpr double kLength = 8, kWidth = 6, kHeight = 2.8;  // x, y, z [m]

void Add(Scene& scene, const Vector3d& corner, const Vector3d& u, const Vector3d& v, int texture,
         double repeat_u = 1, double repeat_v = 1) {
  scene.faces.push_back(Quad(corner, u, v, texture, repeat_u, repeat_v));
}

// What of a wall is behind a curtain, from its left end [m].
struct Curtain {
  double from = 0, to = 0;
  bool Hides(double at, double breadth) const { return at < to && at + breadth > from; }
};

// A wall with pictures, and furniture before it. `left`: its upper left corner as seen from inside.
void AddWall(Scene& scene, const Vector3d& left, const Vector3d& right, double length, const Curtain& curtain,
             Random& random) {
  const Vector3d down(0, 0, -kHeight), inward(right.y(), -right.x(), 0);
  Add(scene, left, length * right, down, scene.Add(WallpaperTexture(random.Bits())), length / kHeight);
  for (double at = random.In(0.2, 0.6); at < length - 1.2; at += random.In(0.9, 1.5)) {
    const double w = random.In(0.4, 0.9), h = random.In(0.4, 0.9), z = random.In(0.3, 1.0);
    const int look = scene.Add(SignTexture(random.Bits()));
    if (curtain.Hides(at, w)) continue;
    Add(scene, left + at * right + 0.03 * inward - Vector3d(0, 0, z), w * right, {0, 0, -h}, look);
  }
  if (curtain.to > curtain.from)
    Add(scene, left + curtain.from * right + 0.04 * inward, (curtain.to - curtain.from) * right, down,
        scene.Add(CurtainTexture(random.Bits())), std::ceil(curtain.to - curtain.from));
  const double yaw = std::atan2(inward.y(), inward.x());
  for (double at = random.In(0.5, 0.9); at < length - 0.9; at += random.In(1.2, 2.2)) {
    const double height = random.In(0.5, 1.7), breadth = random.In(0.6, 1.1), depth = random.In(0.3, 0.5);
    const Vector3d size(depth, breadth, height);
    const int front =
        scene.Add(random.Unit() < 0.6 ? ShelfTexture(random.Bits()) : WoodTexture(random.Bits()));
    const int side = scene.Add(WoodTexture(random.Bits()));
    const Vector3d foot = left + at * right + (0.5 * size.x() + 0.02) * inward - Vector3d(0, 0, kHeight);
    const bool hidden = curtain.Hides(at - 0.5 * breadth, breadth);
    if (!hidden) AppendBox(scene.faces, foot, size, yaw, {front, side, side});
    if (random.Unit() < 0.7) {  // something on top
      const double tall = random.In(0.1, 0.3), broad = random.In(0.1, 0.3), deep = random.In(0.1, 0.2);
      const int look = scene.Add(SignTexture(random.Bits()));
      const double turn = random.In(-0.5, 0.5), shift = random.In(-0.2, 0.2);
      if (!hidden)
        AppendBox(scene.faces, foot + Vector3d(0, 0, size.z()) + shift * right, {deep, broad, tall},
                  yaw + turn, {look, look, side});
    }
  }
}

// Wide ones, evenly along the way on its right, where the camera looks. They stand along it.
void AddDoors(Scene& scene, int doors, Random& random) {
  constexpr double kBeside = 0.55, kBreadth = 1.5, kThick = 0.04, kTall = 2.3;
  const Route& way = scene.routes.front();
  for (int k = 0; k < doors; ++k) {
    const double at = way.Length() * (k + 0.5) / doors, yaw = way.HeadingAt(at);
    const Eigen::Vector2d foot = way.PointAt(at) + kBeside * Eigen::Vector2d(std::sin(yaw), -std::cos(yaw));
    const int paint = scene.Add(PaintTexture(random.Bits()));
    AppendBox(scene.faces, {foot.x(), foot.y(), 0}, {kBreadth, kThick, kTall}, yaw, {paint, paint, paint});
  }
}

}  // namespace

Scene BuildRoom(const SyntheticOptions& options) {
  Scene scene;
  Random random(options.seed * 0x2545F491ULL + 3);
  const double x = 0.5 * kLength, y = 0.5 * kWidth;
  Add(scene, {-x, y, 0}, {kLength, 0, 0}, {0, -kWidth, 0}, scene.Add(WoodTexture(random.Bits())),
      kLength / 2.1, kWidth / 1.9);
  cv::Mat plaster = GroundTexture(random.Bits());
  plaster += cv::Scalar(105);
  Add(scene, {x, y, kHeight}, {-kLength, 0, 0}, {0, -kWidth, 0}, scene.Add(plaster), 3, 2);
  Random bare(options.seed * 0x2545F491ULL + 31);
  const auto curtain = [&](double length) {
    const double covered = options.bare_fraction * length, from = bare.In(0, length - covered);
    return Curtain{from, from + covered};
  };
  // Seen from inside, the wall at +x runs from +y on the left to -y on the right.
  AddWall(scene, {x, y, kHeight}, {0, -1, 0}, kWidth, curtain(kWidth), random);
  AddWall(scene, {x, -y, kHeight}, {-1, 0, 0}, kLength, curtain(kLength), random);
  AddWall(scene, {-x, -y, kHeight}, {0, 1, 0}, kWidth, curtain(kWidth), random);
  AddWall(scene, {-x, y, kHeight}, {1, 0, 0}, kLength, curtain(kLength), random);

  const int cloth = scene.Add(WallpaperTexture(random.Bits())),
            hair = scene.Add(FoliageTexture(random.Bits()));
  scene.movers = {{cloth, cloth, hair}};
  scene.mover_size = {0.45, 0.45, 1.7};
  scene.mover_left = -0.9;
  scene.mover_speed = 0.35;

  std::vector<Eigen::Vector2d> way;
  for (int i = 0; i < 360; ++i) {
    const double a = 2 * M_PI * i / 360;
    way.emplace_back(0.24 * kLength * std::cos(a), 0.22 * kWidth * std::sin(a));
  }
  scene.routes.emplace_back(SmoothLoop(way, 0.01, 0.3), options.speed_mps, 0.6, 0.5);
  AddDoors(scene, options.plain_doors, bare);
  scene.eye_height = 1.4;
  scene.gaze_right = 1.0;
  scene.gaze_down = 0.12;
  scene.sway = 0.03;
  return scene;
}

}  // namespace tutti::synthetic
