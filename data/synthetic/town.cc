// A town of square blocks. Streets run along x and y; blocks of houses stand between them and around them.
#include <algorithm>
#include <cmath>

#include "data/synthetic/scene.h"
#include "data/synthetic/synthetic_random.h"
#include "data/synthetic/textures.h"

namespace tutti::synthetic {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kAlike = 4;            // facades of the houses that repeat
constexpr double kLane = 1.6;        // right of the middle of the street [m]
constexpr double kPavement = 0.125;  // of the street's width, on each side

Vector3d Lift(const Vector2d& p, double z) { return {p.x(), p.y(), z}; }

class TownBuilder {
 public:
  explicit TownBuilder(const SyntheticOptions& o)
      : options_(o),
        random_(o.seed * 0x51ED2701ULL + 7),
        later_(o.seed * 0x6C8E9CF5ULL + 13),
        pitch_(o.block_m + o.street_m) {}

  Scene Build() {
    MakeTextures();
    AddSky();
    AddGround();
    for (int i = -1; i <= options_.blocks_x; ++i) {
      for (int j = -1; j <= options_.blocks_y; ++j) AddBlock(i, j);
    }
    for (int i = 0; i <= options_.blocks_x; ++i) AddStreet({i * pitch_, 0}, {0, 1}, options_.blocks_y);
    for (int j = 0; j <= options_.blocks_y; ++j) AddStreet({0, j * pitch_}, {1, 0}, options_.blocks_x);
    AddRoute();
    AddLorries();
    return std::move(scene_);
  }

 private:
  std::uint64_t Seed() { return random_.Bits(); }

  void MakeTextures() {
    for (int i = 0; i < options_.facades; ++i) facades_.push_back(scene_.Add(FacadeTexture(Seed())));
    for (int i = 0; i < 8; ++i) walls_.push_back(scene_.Add(WallTexture(Seed())));
    for (int i = 0; i < options_.road_surfaces; ++i) roads_.push_back(scene_.Add(RoadTexture(Seed(), false)));
    for (int i = 0; i < 3; ++i) crossings_.push_back(scene_.Add(RoadTexture(Seed(), true)));
    for (int i = 0; i < std::max(1, options_.facades / 4); ++i) {
      BoxTextures car;
      car.front = scene_.Add(CarTexture(Seed(), false));
      const std::uint64_t paint = Seed();
      car.side = scene_.Add(CarTexture(paint, true));
      car.top = walls_[static_cast<std::size_t>(i) % walls_.size()];
      cars_.push_back(car);
    }
    scene_.movers = cars_;
    foliage_ = scene_.Add(FoliageTexture(Seed()));
    ground_ = scene_.Add(GroundTexture(Seed()));
    sky_ = scene_.Add(SkyTexture(Seed()));
  }

  void AddSky() {
    constexpr int kSides = 12;
    static constexpr double kRadius = 900, kTop = 500;
    const auto at = [](int k) {
      return Vector3d(kRadius * std::cos(2 * M_PI * k / kSides), kRadius * std::sin(2 * M_PI * k / kSides),
                      kTop);
    };
    for (int k = 0; k < kSides; ++k) {  // seen from inside: from left to right is clockwise
      Face face = Quad(at(k + 1), at(k) - at(k + 1), {0, 0, -kTop - 60}, sky_);
      face.repeat_u = 0.25;
      face.offset_u = 0.25 * (kSides - k);
      face.emits = true;
      scene_.faces.push_back(face);
    }
    Face top = Quad({kRadius, kRadius, kTop}, {-2 * kRadius, 0, 0}, {0, -2 * kRadius, 0}, sky_);
    top.emits = true;
    scene_.faces.push_back(top);
    for (int i = 0; i < 14; ++i) {  // towers outside: landmarks far away
      const double angle = random_.In(0, 2 * M_PI), distance = random_.In(160, 320);
      const Vector2d middle(0.5 * options_.blocks_x * pitch_, 0.5 * options_.blocks_y * pitch_);
      const double reach = distance + 0.5 * pitch_ * std::max(options_.blocks_x, options_.blocks_y);
      const int texture = Pick(facades_);
      const double yaw = random_.In(0, M_PI);
      const double length = random_.In(12, 24), width = random_.In(12, 24), height = random_.In(20, 48);
      AppendBox(scene_.faces, Lift(middle + reach * Vector2d(std::cos(angle), std::sin(angle)), 0),
                {length, width, height}, yaw, {texture, texture, walls_[0]});
    }
  }

  void AddGround() {
    constexpr double kHalf = 800;
    Face face = Quad({-kHalf, kHalf, -0.04}, {2 * kHalf, 0, 0}, {0, -2 * kHalf, 0}, ground_);
    face.repeat_u = face.repeat_v = 300;
    scene_.faces.push_back(face);
  }

  int Pick(const std::vector<int>& from) {
    return from[static_cast<std::size_t>(random_.Int(0, static_cast<int>(from.size()) - 1))];
  }

  // Houses along the four sides of a block, fronts to the street.
  void AddBlock(int i, int j) {
    const double low = 0.5 * options_.street_m, high = pitch_ - low;
    const Vector2d o(i * pitch_, j * pitch_);
    const Vector2d corners[4] = {o + Vector2d(low, low), o + Vector2d(high, low), o + Vector2d(high, high),
                                 o + Vector2d(low, high)};
    corner_height_ = random_.In(7.5, 11);
    for (int side = 0; side < 4; ++side) {
      const Vector2d start = corners[side], right = (corners[(side + 1) % 4] - start).normalized();
      double at = 0;
      while (at < options_.block_m - 0.01) {
        double width = random_.In(7, 11);
        const bool alike = random_.Unit() < options_.repeat_fraction;
        if (alike) width = 9;
        if (options_.block_m - at - width < 6) width = options_.block_m - at;
        AddHouse(start + at * right, right, width, alike, at == 0, at + width > options_.block_m - 0.01);
        at += width;
      }
    }
  }

  // `first`, `last`: at the corner of the block, where the front of the other street's house is the side
  // wall.
  void AddHouse(const Vector2d& left, const Vector2d& right, double width, bool alike, bool first,
                bool last) {
    const Vector2d outward(right.y(), -right.x());
    const double own_height = alike ? 9 : random_.In(6.5, 12.5), depth = 5;
    const double height = first || last ? corner_height_ : own_height;  // two fronts make one house
    const double setback = first || last ? 0.0 : alike ? 0.3 : random_.In(0, 0.9);
    const int which = alike ? random_.Int(0, kAlike - 1) : random_.Int(kAlike, options_.facades - 1);
    const int wall = alike ? walls_[0] : Pick(walls_);
    const Vector3d base = Lift(left - setback * outward, 0), r = Lift(right, 0), n = Lift(outward, 0);
    const Vector3d up(0, 0, height);
    Face front = Quad(base + up, width * r, -up, facades_[static_cast<std::size_t>(which)]);
    scene_.faces.push_back(front);
    for (const bool left_side : {true, false}) {
      if (left_side ? first : last) continue;
      Face side = left_side ? Quad(base - depth * n + up, depth * n, -up, wall)
                            : Quad(base + width * r + up, -depth * n, -up, wall);
      side.repeat_u = 1;
      side.repeat_v = 2;
      scene_.faces.push_back(side);
    }
    const int signs =
        random_.Int(first || last ? 1 : 0, 2);  // unlike the facades, no two signs look the same
    for (int k = 0; k < signs; ++k) {
      if (options_.sign_fraction < 1 && random_.Unit() >= options_.sign_fraction) continue;
      const double w = random_.In(0.6, 1.5), h = random_.In(0.6, 1.3), z = random_.In(1.6, 4.5);
      const Vector3d at =
          base + random_.In(0.3, width - w - 0.3) * r + (0.05 + 0.01 * k) * n + Vector3d(0, 0, z);
      scene_.faces.push_back(Quad(at, w * r, {0, 0, -h}, scene_.Add(SignTexture(Seed()))));
    }
  }

  // Tiles of road from one block before the town to one block after it, and what stands along it.
  void AddStreet(const Vector2d& start, const Vector2d& along, int blocks) {
    const Vector2d right(along.y(), -along.x());
    const double w = options_.street_m;
    const int tiles = std::max(1, static_cast<int>(std::round(options_.block_m / w)));
    for (int b = -1; b <= blocks; ++b) {
      const Vector2d crossing = start + b * pitch_ * along;
      // Streets of both directions meet here; the one along x lays the tile.
      if (along.x() > 0.5 && b >= 0) AddTile(crossing - 0.5 * w * along, along, w, Pick(crossings_));
      for (int t = 0; t < tiles; ++t) {
        const double length = options_.block_m / tiles;
        AddTile(crossing + (0.5 * w + t * length) * along, along, length, Pick(roads_));
      }
      for (double at = 0.5 * w + 3; at < pitch_ - 0.5 * w - 3; at += random_.In(5, 9)) {
        const double side = random_.Unit() < 0.5 ? 1 : -1;
        AddThing(crossing + at * along, along, side * right);
      }
    }
  }

  void AddTile(const Vector2d& start, const Vector2d& along, double length, int texture) {
    const double w = options_.street_m;
    const Vector2d right(along.y(), -along.x());
    Face face = Quad(Lift(start - 0.5 * w * right + length * along, 0), Lift(w * right, 0),
                     Lift(-length * along, 0), texture);
    face.repeat_v = length / w;
    scene_.faces.push_back(face);
  }

  // A parked car, a lamp post or a tree beside the lane.
  void AddThing(const Vector2d& middle, const Vector2d& along, const Vector2d& side) {
    const double half = 0.5 * options_.street_m, curb = half - kPavement * options_.street_m;
    const double yaw = std::atan2(along.y(), along.x()), kind = random_.Unit();
    if (kind < 0.5) {
      const double height = random_.In(1.35, 1.9), length = random_.In(3.7, 4.6);
      const BoxTextures look =
          cars_[static_cast<std::size_t>(random_.Int(0, static_cast<int>(cars_.size()) - 1))];
      const std::size_t first = scene_.faces.size();
      const Vector2d at = middle + (curb - 1.0) * side;
      if (curb > 3.3) AppendBox(scene_.faces, Lift(at, 0), {length, 1.7, height}, yaw, look);
      if (curb > 3.3 && options_.other_cars) AddLaterCar(first, at, along, 0.65);
      return;
    }
    if (curb > 3.3 && options_.other_cars)
      AddLaterCar(scene_.faces.size(), middle + (curb - 1.0) * side, along, 0.2);
    const Vector2d foot = middle + (curb + 0.45) * side;
    const int bark = Pick(walls_);
    if (kind < 0.8) {
      AppendBox(scene_.faces, Lift(foot, 0), {0.16, 0.16, 5}, yaw, {bark, bark, bark});
      AppendBox(scene_.faces, Lift(foot - 0.5 * side, 5), {0.3, 1.1, 0.2}, yaw, {bark, bark, bark});
      scene_.lamps.push_back(Lift(foot - 0.85 * side, 4.9));
    } else {
      const double crown = random_.In(1.3, 2.0);
      AppendBox(scene_.faces, Lift(foot, 0), {0.25, 0.25, 2.4}, yaw, {bark, bark, bark});
      AppendBox(scene_.faces, Lift(foot, 2.4), {crown, crown, crown}, yaw + 0.4,
                {foliage_, foliage_, foliage_});
    }
  }

  // What is parked later where scene_.faces has a car from face `first` on (or none): with so much
  // probability one of another look, size and place. Its random numbers are no others' business: a world
  // keeps its bytes.
  void AddLaterCar(std::size_t first, const Vector2d& at, const Vector2d& along, double probability) {
    ParkingPlace place;
    place.at = at;
    place.first_face = first;
    place.faces = scene_.faces.size() - first;
    if (later_.Unit() < probability) {
      BoxTextures look;
      look.front = scene_.Add(CarTexture(later_.Bits(), false));
      look.side = scene_.Add(CarTexture(later_.Bits(), true));
      look.top = walls_[static_cast<std::size_t>(later_.Int(0, static_cast<int>(walls_.size()) - 1))];
      const double height = later_.In(1.3, 1.7), width = later_.In(1.6, 1.8), length = later_.In(3.6, 5.0);
      AppendBox(place.later, Lift(at + later_.In(-0.6, 0.6) * along, 0), {length, width, height},
                std::atan2(along.y(), along.x()), look);
    }
    if (place.faces > 0 || !place.later.empty()) scene_.parking.push_back(std::move(place));
  }

  void AddLorries() {
    if (options_.occlusion <= 0) return;
    for (int i = 0; i < 12; ++i) {
      BoxTextures look;
      look.front = scene_.Add(CarTexture(later_.Bits(), false));
      look.side = scene_.Add(BusTexture(later_.Bits()));
      look.top = walls_[0];
      scene_.lorries.push_back(look);
    }
  }

  void AddRoute() {
    const double x = options_.blocks_x * pitch_, y = options_.blocks_y * pitch_;
    std::vector<Vector2d> way = {{0, 0}, {x, 0}};
    if (options_.blocks_x > 1 && options_.blocks_y > 1) {  // leave a corner block out
      way.insert(way.end(), {{x, y - pitch_}, {x - pitch_, y - pitch_}, {x - pitch_, y}, {0, y}});
    } else {
      way.insert(way.end(), {{x, y}, {0, y}});
    }
    std::vector<Vector2d> lane;
    const std::size_t n = way.size();
    for (std::size_t k = 0; k < n; ++k) {
      const Vector2d in = (way[k] - way[(k + n - 1) % n]).normalized(),
                     out = (way[(k + 1) % n] - way[k]).normalized();
      lane.push_back(way[k] + kLane * (Vector2d(in.y(), -in.x()) + Vector2d(out.y(), -out.x())));
    }
    lane.insert(lane.begin() + 1,
                lane[0] + 0.35 * (lane[1] - lane[0]));  // start on the straight, not in the corner
    std::rotate(lane.begin(), lane.begin() + 1, lane.end());
    const double rounding = std::min(9.0, 0.3 * pitch_);
    scene_.routes.emplace_back(SmoothLoop(lane, 0.1, rounding), options_.speed_mps, 0.5, 2.0);
  }

  const SyntheticOptions options_;
  Random random_, later_;  // later_: of what the second lap alone has
  double pitch_;
  double corner_height_ = 9;  // of the block that is built [m]
  Scene scene_;
  std::vector<int> facades_, walls_, roads_, crossings_;
  std::vector<BoxTextures> cars_;
  int foliage_ = 0, ground_ = 0, sky_ = 0;
};

}  // namespace

Scene BuildTown(const SyntheticOptions& options) { return TownBuilder(options).Build(); }

}  // namespace tutti::synthetic
