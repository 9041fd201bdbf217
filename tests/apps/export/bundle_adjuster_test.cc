// COLMAP's own bundle adjustment of an exported model: wrong axes, inverses or pixels cost hundreds of
// pixels, and a map that COLMAP can make much better was not a good one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "apps/export/colmap_model.h"
#include "apps/export/keyframe_images.h"
#include "tests/apps/export/colmap_files.h"
#include "tests/apps/export/mapped_room.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

struct Adjusted {
  double initial_px = -1, final_px = -1;  // root mean square over coordinates
  double moved_m = 0, turned_deg = 0;     // the most that an image did
};

double CostAfter(const std::string& output, const std::string& label) {
  const std::size_t at = output.find(label);
  if (at == std::string::npos) return -1;
  return std::stod(output.substr(output.find(':', at) + 1));
}

// What COLMAP says, with its default options: focal lengths, poses and points are free.
Adjusted Adjust(const fs::path& folder) {
  const fs::path after = folder / "adjusted";
  fs::create_directories(after);
  const testing::ProcessResult said =
      testing::RunColmap({"bundle_adjuster", "--input_path", folder, "--output_path", after});
  EXPECT_EQ(said.status, 0) << said.output;
  const testing::ProcessResult converted = testing::RunColmap(
      {"model_converter", "--input_path", after, "--output_path", after, "--output_type", "TXT"});
  EXPECT_EQ(converted.status, 0) << converted.output;
  Adjusted result;
  result.initial_px = CostAfter(said.output, "Initial cost");
  result.final_px = CostAfter(said.output, "Final cost");
  const std::map<std::string, Pose> before = testing::ImagePoses(folder / "images.txt"),
                                    now = testing::ImagePoses(after / "images.txt");
  EXPECT_EQ(before.size(), now.size());
  for (const auto& [name, T_camera_world] : before) {
    const Pose T_before = T_camera_world.Inverse(), T_now = now.at(name).Inverse();
    result.moved_m = std::max(result.moved_m, (T_now.translation - T_before.translation).norm());
    result.turned_deg = std::max(result.turned_deg, (T_before.Inverse() * T_now).Angle() * 180 / M_PI);
  }
  return result;
}

std::vector<std::size_t> All(const MapModel& model) {
  std::vector<std::size_t> all;
  for (std::size_t k = 0; k < model.keyframes.size(); ++k) all.push_back(k);
  return all;
}

// `tutti export --colmap` makes such a model; this one has all keyframes.
ColmapModel ColmapOf(const testing::MappedRoom& room) {
  MapModel model = room.Model();
  RefineTracks(KeyframeImages(*room.dataset, model), All(model), &model);
  return ColmapModel(model, All(model));
}

void Print(const char* name, const ColmapModel& colmap, const Adjusted& adjusted) {
  std::printf(
      "  %s: %zu images, %zu points, mean track %.2f, %zu left out; initial cost %.3f px, final %.3f "
      "px; moved at most %.2f mm, %.4f deg\n",
      name, colmap.Images().size(), colmap.Points().size(), colmap.MeanTrackLength(), colmap.LeftOut(),
      adjusted.initial_px, adjusted.final_px, 1000 * adjusted.moved_m, adjusted.turned_deg);
}

TEST(BundleAdjuster, OfColmapMovesNoCameraOfTheRoom) {
  TUTTI_REQUIRE_COLMAP();
  const testing::MappedRoom room = testing::WholeRoom();
  ASSERT_GT(room.slam->Report().corrections, 0) << "the loop is closed";
  const ColmapModel colmap = ColmapOf(room);
  const fs::path folder = testing::FreshFolder();
  colmap.Write(folder);
  const Adjusted adjusted = Adjust(folder);
  Print("room", colmap, adjusted);
  EXPECT_GE(adjusted.initial_px, 0);
  EXPECT_LE(adjusted.initial_px, 1.0);
  EXPECT_LE(adjusted.moved_m, 0.01);
  EXPECT_LE(adjusted.turned_deg, 0.1);
}

// That the test above would see a mistake: poses the wrong way round.
TEST(BundleAdjuster, OfColmapSeesPosesThatAreTheWrongWayRound) {
  TUTTI_REQUIRE_COLMAP();
  MapModel model = testing::Room().Model();
  for (ModelKeyframe& keyframe : model.keyframes) keyframe.T_world_camera = keyframe.T_world_camera.Inverse();
  const fs::path folder = testing::FreshFolder();
  ColmapModel(model, All(model)).Write(folder);
  const testing::ProcessResult said =
      testing::RunColmap({"bundle_adjuster", "--input_path", folder, "--output_path", folder,
                          "--BundleAdjustment.max_num_iterations", "1"});
  EXPECT_GT(CostAfter(said.output, "Initial cost"), 10.0);
}

TEST(BundleAdjuster, RedkitchenHasManyLongTracks) {
  TUTTI_REQUIRE_DATA(data, "redkitchen");
  const testing::MappedRoom kitchen =
      testing::MapOf(testing::SourceDir() / "data/configs/7scenes.yaml", data, 250);
  const ColmapModel colmap = ColmapOf(kitchen);
  EXPECT_GE(colmap.Points().size(), 2000u);
  EXPECT_GE(colmap.MeanTrackLength(), 3.0);
  TUTTI_REQUIRE_COLMAP();
  const fs::path folder = testing::FreshFolder();
  colmap.Write(folder);
  const Adjusted adjusted = Adjust(folder);
  Print("redkitchen", colmap, adjusted);
  EXPECT_LE(adjusted.initial_px, 1.0);
}

}  // namespace
}  // namespace tutti
