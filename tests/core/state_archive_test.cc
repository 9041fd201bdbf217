#include "core/state_archive.h"

#include <gtest/gtest.h>

#include <climits>
#include <cmath>
#include <limits>

#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

struct Part {
  int number = 0;
  std::vector<float> values;
};
template <class Archive>
void State(Archive& archive, Part& part) {
  archive(part.number, part.values);
}

enum class Colour { kRed, kBlue };

struct Whole {
  template <class Archive>
  void State(Archive& archive) {
    archive(flag, colour, text, pose, similarity, matrix, maybe, nothing, parts, queue, set, map, triple,
            first, second);
  }
  bool flag = false;
  Colour colour = Colour::kRed;
  std::string text;
  Pose pose;
  Similarity similarity;
  Eigen::Matrix2f matrix = Eigen::Matrix2f::Zero();
  std::optional<double> maybe;
  std::optional<Part> nothing;
  std::vector<Part> parts;
  std::deque<std::pair<int, double>> queue;
  std::set<std::string> set;
  std::map<int, std::vector<int>> map;
  std::array<std::uint8_t, 3> triple{};
  std::shared_ptr<const Part> first, second;
};

Whole Example() {
  Whole whole;
  whole.flag = true;
  whole.colour = Colour::kBlue;
  whole.text = std::string("a\0b", 3);
  whole.pose = Pose(Eigen::Quaterniond(0.5, 0.1, -0.2, 0.3), Eigen::Vector3d(1e-300, -0.0, 1.0 / 3));
  whole.similarity = Similarity(1.5, whole.pose.rotation, Eigen::Vector3d::Ones());
  whole.matrix << 1, 2, 3, 4;
  whole.maybe = std::numeric_limits<double>::infinity();
  whole.parts = {{1, {0.5f}}, {2, {}}};
  whole.queue = {{3, 0.1}, {4, 0.2}};
  whole.set = {"x", "y"};
  whole.map = {{-1, {}}, {7, {8, 9}}};
  whole.triple = {1, 2, 255};
  whole.first = whole.second = std::make_shared<const Part>(Part{5, {1, 2, 3}});
  return whole;
}

std::string Bytes(const Whole& whole) {
  SharedObjectsOut shared;
  StateWriter out(&shared);
  out(whole);
  return out.Take();
}

Whole Read(const std::string& bytes) {
  SharedObjectsIn shared;
  StateReader in(bytes, "some.file", &shared);
  Whole whole;
  in(whole);
  in.ExpectEnd();
  return whole;
}

TEST(StateArchive, WhatIsReadWritesTheSameBytes) {
  const std::string bytes = Bytes(Example());
  const Whole read = Read(bytes);
  EXPECT_EQ(Bytes(read), bytes);
  EXPECT_NE(Bytes(Whole()), bytes);
  EXPECT_EQ(read.pose.rotation.coeffs(), Example().pose.rotation.coeffs()) << "no rounding, no normalisation";
  EXPECT_TRUE(std::signbit(read.pose.translation.y()));
  EXPECT_EQ(read.map.at(7), (std::vector<int>{8, 9}));
  EXPECT_FALSE(read.nothing.has_value());
}

TEST(StateArchive, SmallAndGrowingNumbersTakeAByteEach) {
  std::vector<int> small = {0, -1, 63, -64}, growing = {0, 1, 5, 100}, wide = {INT_MIN, INT_MAX},
                   last = {INT_MAX};
  const std::string bytes = StateBytes(SmallNumbers{&small}, GrowingNumbers{&growing});
  EXPECT_EQ(bytes.size(), 2 * (1 + 4u));
  std::vector<int> a = {7}, b, c;
  ReadStateBytes(bytes, "f", SmallNumbers{&a}, GrowingNumbers{&b});
  EXPECT_EQ(a, small);
  EXPECT_EQ(b, growing);
  ReadStateBytes(StateBytes(SmallNumbers{&wide}), "f", SmallNumbers{&c});
  EXPECT_EQ(c, wide);
  const std::string beyond = StateBytes(GrowingNumbers{&last});
  EXPECT_THROW(ReadStateBytes(beyond, "f", GrowingNumbers{&c}), InputError) << "none can follow it";
  EXPECT_THROW(ReadStateBytes("\x05\x01", "f", SmallNumbers{&c}), InputError) << "more numbers than bytes";
}

TEST(StateArchive, AnObjectThatTwoPointToIsOneAfterwards) {
  const Whole read = Read(Bytes(Example()));
  ASSERT_TRUE(read.first);
  EXPECT_EQ(read.first, read.second);
  EXPECT_EQ(read.first->values.size(), 3u);
}

TEST(StateArchive, AnObjectIsOneAcrossTheSectionsOfAFile) {
  const auto part = std::make_shared<const Part>(Part{5, {1, 2, 3}});
  SharedObjectsOut shared;
  StateWriter first(&shared), second(&shared);
  first(part);
  second(part);
  const std::string bytes[] = {first.Take(), second.Take()};
  EXPECT_LT(bytes[1].size(), bytes[0].size());
  SharedObjectsIn known;
  std::shared_ptr<const Part> a, b;
  StateReader(bytes[0], "f", &known)(a);
  StateReader(bytes[1], "f", &known)(b);
  EXPECT_EQ(a, b);
}

TEST(StateArchive, CutOffAnywhereItIsRefusedByName) {
  const std::string bytes = Bytes(Example());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    try {
      Read(bytes.substr(0, size));
      FAIL() << size;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("some.file"), std::string::npos);
    }
  }
  EXPECT_THROW(Read(bytes + "x"), InputError);
}

TEST(StateArchive, AnObjectOfAnotherKindIsRefused) {
  SharedObjectsOut shared;
  StateWriter out(&shared);
  out(std::make_shared<const Part>());
  const std::string bytes = out.Take();
  SharedObjectsIn known;
  std::shared_ptr<const Part> part;
  StateReader(bytes, "f", &known)(part);
  std::shared_ptr<const std::string> text;
  StateReader in(bytes, "f", &known);
  EXPECT_THROW(in(text), InputError);
}

}  // namespace
}  // namespace tutti::internal
