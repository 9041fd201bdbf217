// A corridor around a building's core, walked round and round: plain walls, doors that look alike, few marks.
#include <algorithm>
#include <cmath>

#include "data/synthetic/scene.h"
#include "data/synthetic/synthetic_random.h"
#include "data/synthetic/textures.h"

namespace tutti::synthetic {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kHalfWidth = 1.1, kWallHeight = 2.6;  // of the corridor [m]
constexpr double kBesideDoors = 0.08;  // things on the wall stand out so far, to be drawn over it [m]

// A rectangle about the origin: how far its sides are from it [m].
struct Rectangle {
  double x, y;
};

class CorridorBuilder {
 public:
  explicit CorridorBuilder(const SyntheticOptions& o)
      : options_(o), random_(o.seed * 0x6C8E9CF5ULL + 5), way_{0.5 * o.corridor_m, 0.25 * o.corridor_m} {}

  Scene Build() {
    MakeTextures();
    const Rectangle outer{way_.x + kHalfWidth, way_.y + kHalfWidth},
        inner{way_.x - kHalfWidth, way_.y - kHalfWidth};
    AddFloorAndCeiling(outer);
    AddLamps();
    // Clockwise as seen from above for the walls seen from within, counter-clockwise for the core.
    AddWall({outer.x, outer.y}, {0, -1}, 2 * outer.y);
    AddWall({outer.x, -outer.y}, {-1, 0}, 2 * outer.x);
    AddWall({-outer.x, -outer.y}, {0, 1}, 2 * outer.y);
    AddWall({-outer.x, outer.y}, {1, 0}, 2 * outer.x);
    AddWall({-inner.x, -inner.y}, {1, 0}, 2 * inner.x);
    AddWall({inner.x, -inner.y}, {0, 1}, 2 * inner.y);
    AddWall({inner.x, inner.y}, {-1, 0}, 2 * inner.x);
    AddWall({-inner.x, inner.y}, {0, -1}, 2 * inner.y);
    AddWay();
    return std::move(scene_);
  }

 private:
  void MakeTextures() {
    lamp_ = scene_.Add(LampTexture());
    radiator_ = scene_.Add(RadiatorTexture());
    for (int i = 0; i < 5; ++i) doors_.push_back(scene_.Add(DoorTexture(random_.Bits())));
    for (int i = 0; i < 2; ++i) notices_.push_back(scene_.Add(SignTexture(random_.Bits())));
    const int cloth = scene_.Add(WallpaperTexture(random_.Bits())),
              hair = scene_.Add(FoliageTexture(random_.Bits()));
    scene_.movers = {{cloth, cloth, hair}};
    scene_.mover_size = {0.45, 0.45, 1.7};
    scene_.mover_left = 0.55;
    scene_.mover_speed = -0.9;
  }

  void Add(const Vector3d& corner, const Vector3d& u, const Vector3d& v, int texture, double repeat_u = 1,
           double repeat_v = 1) {
    scene_.faces.push_back(Quad(corner, u, v, texture, repeat_u, repeat_v));
  }

  // Floor, ceiling and walls bear traces of use that no other place has.
  void AddFloorAndCeiling(const Rectangle& r) {
    constexpr double kPanels = 2.4;  // side of what a texture shows [m]
    const double core_x = way_.x - kHalfWidth, core_y = way_.y - kHalfWidth;
    for (double x = -r.x; x < r.x; x += kPanels) {
      for (double y = -r.y; y < r.y; y += kPanels) {
        if (x > -core_x && x + kPanels < core_x && y > -core_y && y + kPanels < core_y) continue;
        Add({x, y + kPanels, 0}, {kPanels, 0, 0}, {0, -kPanels, 0},
            scene_.Add(PanelTexture(random_.Bits(), 120, 8)));
        Add({x + kPanels, y + kPanels, kWallHeight}, {-kPanels, 0, 0}, {0, -kPanels, 0},
            scene_.Add(PanelTexture(random_.Bits(), 215, 3)));
      }
    }
  }

  void AddLamps() {
    constexpr double kPitch = 3.6, kLong = 1.2, kWide = 0.3, kBelow = 0.02;
    const auto lamp = [&](const Vector2d& middle, const Vector2d& size) {
      Add({middle.x() + 0.5 * size.x(), middle.y() + 0.5 * size.y(), kWallHeight - kBelow}, {-size.x(), 0, 0},
          {0, -size.y(), 0}, lamp_);
      scene_.faces.back().emits = true;
    };
    for (const double side : {-1.0, 1.0}) {
      for (double x = -way_.x + 1; x < way_.x; x += kPitch + random_.In(-0.6, 0.6))
        lamp({x, side * way_.y}, {kLong, kWide});
      for (double y = -way_.y + 2.5; y < way_.y - 1; y += kPitch + random_.In(-0.6, 0.6))
        lamp({side * way_.x, y}, {kWide, kLong});
    }
  }

  // `left`: the wall's left end as seen by somebody before it.
  void AddWall(const Vector2d& left, const Vector2d& right, double length) {
    const Vector3d start(left.x(), left.y(), 0), along(right.x(), right.y(), 0),
        out(right.y(), -right.x(), 0);
    const int pieces = static_cast<int>(std::ceil(length / kWallHeight));
    const double piece = length / pieces;
    for (int k = 0; k < pieces; ++k) {  // worn differently everywhere
      Add(start + k * piece * along + Vector3d(0, 0, kWallHeight), piece * along, {0, 0, -kWallHeight},
          scene_.Add(PlasterTexture(random_.Bits())));
    }
    for (double at = random_.In(1.2, 3); at < length - 2.4;) {
      const double width = AddThing(start + at * along + kBesideDoors * out, along);
      at += width + random_.In(0.8, 2.6);
    }
  }

  // What hangs or stands at the wall; returns its width. `foot`: its left end on the floor.
  double AddThing(const Vector3d& foot, const Vector3d& along) {
    const bool alike = random_.Unit() < options_.repeat_fraction;
    const double kind = random_.Unit();
    const auto add = [&](double right, double top, double width, double height, int texture) {
      Add(foot + right * along + Vector3d(0, 0, top), width * along, {0, 0, -height}, texture);
    };
    if (kind < 0.6) {  // a door, and its name plate
      constexpr double kDoor = 0.95;
      add(0, 2.05, kDoor, 2.05, Pick(doors_));
      add(kDoor + 0.12, 1.65, 0.24, 0.18, alike ? notices_[0] : scene_.Add(SignTexture(random_.Bits())));
      return kDoor + 0.36;
    }
    if (kind < 0.8) {
      add(0, 0.75, 1.1, 0.6, radiator_);
      return 1.1;
    }
    const double width = alike ? 0.5 : random_.In(0.4, 0.8), height = alike ? 0.7 : random_.In(0.5, 0.9);
    add(0, 1.9, width, height, alike ? Pick(notices_) : scene_.Add(SignTexture(random_.Bits())));
    return width;
  }

  int Pick(const std::vector<int>& from) {
    return from[static_cast<std::size_t>(random_.Int(0, static_cast<int>(from.size()) - 1))];
  }

  void AddWay() {
    const std::vector<Vector2d> corners = {
        {-0.4 * way_.x, -way_.y}, {way_.x, -way_.y}, {way_.x, way_.y}, {-way_.x, way_.y}, {-way_.x, -way_.y}};
    scene_.routes.emplace_back(SmoothLoop(corners, 0.05, 1.6), options_.speed_mps, 0.5, 0.6);
    scene_.eye_height = 1.5;
    scene_.sway = 0.02;
  }

  const SyntheticOptions options_;
  Random random_;
  const Rectangle way_;
  Scene scene_;
  int lamp_ = 0, radiator_ = 0;
  std::vector<int> doors_, notices_;
};

}  // namespace

Scene BuildCorridor(const SyntheticOptions& options) { return CorridorBuilder(options).Build(); }

}  // namespace tutti::synthetic
