#include "tutti/slam/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

#include "tests/support/error_of.h"
#include "tests/support/in_folder.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string Message(const std::string& text) {
  try {
    ParseConfig(text, "my.yaml");
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(Config, EmptyFileKeepsAllDefaults) {
  const RunConfig config = ParseConfig("", "my.yaml");
  EXPECT_EQ(config.run.loop_delay_frames, SlamOptions().loop_delay_frames);
  EXPECT_FALSE(config.dataset.camera.has_value());
}

TEST(Config, ReadsEverySection) {
  const RunConfig config = ParseConfig(
      "dataset: {sensor: stereo, type: kitti, stride: 2}\n"
      "camera: {width: 640, height: 480, fx: 520, fy: 521, cx: 318, cy: 236, baseline_m: 0.5}\n"
      "odometry: {features: 700}\n"
      "loops:\n  members: [sift, orb]\n  verification: {min_inliers: 33}\n"
      "graph: {robust: gnc, solver: block}\n"
      "run: {threads: 1}\n",
      "my.yaml");
  EXPECT_EQ(config.dataset.sensor, Sensor::kStereo);
  EXPECT_EQ(config.dataset.stride, 2);
  ASSERT_TRUE(config.dataset.camera.has_value());
  EXPECT_EQ(config.dataset.camera->fy, 521);
  EXPECT_EQ(config.dataset.baseline_m, 0.5);
  EXPECT_EQ(config.odometry.features, 700);
  EXPECT_EQ(config.loops.members, (std::vector<std::string>{"sift", "orb"}));
  EXPECT_EQ(config.loops.verification.min_inliers, 33);
  EXPECT_EQ(config.graph.robust, RobustLoss::kGnc);
  EXPECT_EQ(config.graph.solver, PoseGraphSolver::kBlock);
  EXPECT_EQ(ParseConfig("", "my.yaml").graph.solver, PoseGraphSolver::kCeres);
  EXPECT_EQ(config.run.threads, 1);
}

TEST(Config, ReadsTheNetworkOfTheMemberDnn) {
  const LoopDetectorOptions loops = ParseConfig(
                                        "loops:\n  members: [orb, dnn]\n  dnn: {model: net.onnx, width: 224, "
                                        "height: 200, mean: [1, 2.5, 3],\n"
                                        "    scale: 0.5, stddev: [4, 5, 6], swap_rb: false, layer: pool}\n",
                                        "my.yaml")
                                        .loops;
  EXPECT_EQ(loops.members, (std::vector<std::string>{"orb", "dnn"}));
  EXPECT_EQ(loops.dnn.model, "net.onnx");
  EXPECT_EQ(loops.dnn.width, 224);
  EXPECT_EQ(loops.dnn.height, 200);
  EXPECT_EQ(loops.dnn.mean, (std::array<double, 3>{1, 2.5, 3}));
  EXPECT_EQ(loops.dnn.scale, 0.5);
  EXPECT_EQ(loops.dnn.stddev, (std::array<double, 3>{4, 5, 6}));
  EXPECT_FALSE(loops.dnn.swap_rb);
  EXPECT_EQ(loops.dnn.layer, "pool");
  EXPECT_THAT(Message("loops:\n  dnn:\n    mean: [1, 2]\n"),
              AllOf(HasSubstr("my.yaml:3:"), HasSubstr("3 numbers")));
  EXPECT_THAT(Message("loops:\n  dnn:\n    stddev: [1, 2, x]\n"), HasSubstr("'x' is not a finite number"));
  EXPECT_THAT(Message("loops:\n  dnn: {width: 9}\n"),
              AllOf(HasSubstr("my.yaml:2:"), HasSubstr("16 to 4096")));
  EXPECT_THAT(Message("loops:\n  stm_size: 5\n  members: [dnn]\n"),
              AllOf(HasSubstr("my.yaml:3:"), HasSubstr("dnn.model is empty")));
  LoopDetectorOptions set;
  SetLoopOptions({"members=[dnn]", "dnn.model=a.onnx", "dnn.mean=[7, 8, 9]"}, set);
  EXPECT_EQ(set.dnn.mean, (std::array<double, 3>{7, 8, 9}));
}

TEST(Config, UnknownKeyNamesLineAndNearestKey) {
  EXPECT_THAT(Message("odometry:\n  features: 900\nloops:\n  loop_treshold: 0.2\n"),
              AllOf(HasSubstr("my.yaml:4:"), HasSubstr("loop_treshold"), HasSubstr("'loop_threshold'")));
  EXPECT_THAT(Message("loops:\n  verification:\n    min_inlier: 3\n"),
              AllOf(HasSubstr("my.yaml:3:"), HasSubstr("'min_inliers'")));
}

TEST(Config, UnknownSectionNamesNearestSection) {
  EXPECT_THAT(Message("\nodometri:\n  features: 900\n"),
              AllOf(HasSubstr("my.yaml:2:"), HasSubstr("'odometry'")));
}

TEST(Config, RepeatedKeyIsRefused) {
  EXPECT_THAT(Message("run:\n  threads: 1\n  threads: 2\n"),
              AllOf(HasSubstr("my.yaml:3:"), HasSubstr("twice")));
}

TEST(Config, WrongTypesAreRefusedWithTheirLine) {
  EXPECT_THAT(Message("run:\n  threads: two\n"), AllOf(HasSubstr("my.yaml:2:"), HasSubstr("whole number")));
  EXPECT_THAT(Message("run:\n  threads: 1.5\n"), HasSubstr("my.yaml:2:"));
  EXPECT_THAT(Message("run:\n  loops: maybe\n"), HasSubstr("true or false"));
  EXPECT_THAT(Message("run:\n  loop_min_age_s: .nan\n"), HasSubstr("finite number"));
  EXPECT_THAT(Message("loops:\n  seed: -3\n"), HasSubstr("not negative"));
  EXPECT_THAT(Message("dataset:\n  sensor: sonar\n"), HasSubstr("mono, stereo, rgbd"));
  EXPECT_THAT(Message("loops:\n  members: surf\n"), HasSubstr("list"));
  EXPECT_THAT(Message("run: 5\n"), HasSubstr("my.yaml:1:"));
  EXPECT_THAT(Message("run:\n  threads: [1]\n"), HasSubstr("my.yaml:2:"));
}

TEST(Config, ValuesOutOfRangePointToTheirLine) {
  EXPECT_EQ(Message("run:\n  loops: true\n  loop_delay_frames: 0\n"),
            "my.yaml:3: run: loop_delay_frames must be at least 1 [frames], not 0");
  EXPECT_THAT(Message("loops:\n  stm_size: 10\n  loop_threshold: 7\n"), HasSubstr("my.yaml:3:"));
  EXPECT_THAT(Message("camera:\n  width: 640\n  height: 480\n  fx: -5\n  fy: 500\n  cx: 300\n  cy: 200\n"),
              HasSubstr("my.yaml:"));
}

TEST(Config, ACameraThatCanNotBeIsNamedOnce) {
  const std::string size = "camera: {width: 640, height: 480, fx: ", centre = ", cy: 240}\n";
  EXPECT_THAT(Message(size + "0.1, fy: 500, cx: 320" + centre),
              HasSubstr("my.yaml:1: camera: the focal lengths"));
  EXPECT_THAT(Message(size + "500, fy: 500, cx: 900" + centre),
              HasSubstr("my.yaml:1: camera: the principal point"));
}

TEST(Config, TheRightCameraStandsWithinTheLeftOne) {
  const std::string lens = "width: 640, height: 480, fx: 500, fy: 500, cx: 320, cy: 240";
  const auto file = [&](const std::string& transform) {
    return "camera:\n  width: 640\n  height: 480\n  fx: 510\n  fy: 510\n  cx: 320\n  cy: 240\n  right: {" +
           lens + ", T_right_left: " + transform + "}\n";
  };
  const TransformRows wanted{1, 0, 0, -0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  for (const char* transform : {"[1, 0, 0, -0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]",
                                "[[1, 0, 0, -0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"}) {
    const RunConfig config = ParseConfig(file(transform), "my.yaml");
    ASSERT_TRUE(config.dataset.right);
    EXPECT_EQ(config.dataset.right->fx, 500);
    EXPECT_EQ(config.dataset.camera->fx, 510);
    EXPECT_EQ(config.dataset.T_right_left, wanted);
  }
  EXPECT_FALSE(ParseConfig("camera: {" + lens + "}\n", "my.yaml").dataset.right);
  EXPECT_THAT(Message(file("[1, 2, 3]")), HasSubstr("needs 16 numbers, or 4 lists of 4"));
  EXPECT_THAT(Message(file("[[1, 0], [0, 1]]")), HasSubstr("needs 16 numbers, or 4 lists of 4"));
  EXPECT_THAT(Message(file("[2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]")),
              HasSubstr("my.yaml:8: dataset: camera.right.T_right_left is not a rigid transform"));
  EXPECT_THAT(Message("camera: {right: {" + lens + "}}\n"), HasSubstr("T_right_left is missing"));
}

TEST(Config, OneDocumentAlone) {
  for (const char* text : {"---\nrun:\n  threads: 1\n", "# a\n---\nrun:\n  threads: 1\n...\n",
                           "%YAML 1.2\n---\nrun:\n  threads: 1\n# end\n", "run: {threads: 1}\n...\n# end\n",
                           "\xEF\xBB\xBF# a\n---\nrun:\n  threads: 1\n"})
    EXPECT_EQ(ParseConfig(text, "my.yaml").run.threads, 1) << text;
  for (const char* text : {"---\n---\nrun:\n  threads: 1\n", "run: {threads: 1}\n--- \nrun: {threads: 2}\n",
                           ", run:\n  threads: 1\n", ","})  // of commas LoadAll makes documents without end
    EXPECT_THAT(Message(text), HasSubstr("my.yaml: holds more than one YAML document")) << text;
  for (const char* text : {"]\nrun:\n  threads: 1\n", "run: {threads: 1}\n, graph: {}\n"})
    EXPECT_THAT(Message(text), HasSubstr("not valid YAML")) << text;
  EXPECT_EQ(ParseConfig("--- # nothing\n", "my.yaml").run.threads, RunConfig().run.threads);
}

TEST(Config, BrokenYamlNamesTheLine) { EXPECT_THAT(Message("run:\n  threads: [1\n"), HasSubstr("my.yaml:")); }

TEST(Config, MissingFileSaysWhatIsNeeded) {
  try {
    LoadConfig("/nowhere/x.yaml");
    FAIL() << "no error";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("/nowhere/x.yaml"), HasSubstr("--config")));
  }
}

TEST(Config, ThatIsPartOfTuttiIsThereByItsNameFromAnyFolder) {
  const testing::InFolder elsewhere(testing::FreshFolder());
  const RunConfig wanted = LoadConfig(testing::SourceDir() / "data/configs/euroc_stereo.yaml");
  for (const char* name : {"euroc_stereo", "euroc_stereo.yaml", "data/configs/euroc_stereo.yaml"}) {
    EXPECT_EQ(LoadConfig(name).dataset.sensor, wanted.dataset.sensor) << name;
    EXPECT_EQ(LoadConfig(name).dataset.type, DatasetType::kEuroc) << name;
  }
  EXPECT_THROW(LoadConfig("elsewhere/euroc_stereo.yaml"), InputError);
  std::ofstream("euroc_stereo") << "dataset:\n  sensor: mono\n";
  EXPECT_EQ(LoadConfig("euroc_stereo").dataset.sensor, Sensor::kMono) << "a file of this name comes first";
}

TEST(SetOptions, TakesTheKeysOfEverySection) {
  RunConfig config;
  SetOptions({"run.threads=1", "odometry.features=900", "loops.extraction.features=300", "loops.rule=orb",
              "graph.solver=block", "dataset.stride=2", "run.threads=3"},
             config);
  EXPECT_EQ(config.run.threads, 3);
  EXPECT_EQ(config.odometry.features, 900);
  EXPECT_EQ(config.loops.extraction.features, 300);
  EXPECT_EQ(config.loops.rule, CombinationRule::kSingle);
  EXPECT_EQ(config.graph.solver, PoseGraphSolver::kBlock);
  EXPECT_EQ(config.dataset.stride, 2);
  EXPECT_FALSE(config.dataset.camera);
  SetOptions({"camera.fx=500", "camera.fy=500", "camera.width=640", "camera.height=480", "camera.cx=320",
              "camera.cy=240"},
             config);
  ASSERT_TRUE(config.dataset.camera);
  EXPECT_EQ(config.dataset.camera->fx, 500);
}

TEST(SetOptions, SaysWhatIsWrongAndChangesNothing) {
  const auto message = [](const std::string& assignment) {
    RunConfig config;
    try {
      SetOptions({"dataset.stride=2", assignment}, config);
    } catch (const InputError& error) {
      EXPECT_EQ(config.dataset.stride, 1);
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(message("run.threads"), HasSubstr("section.key=value"));
  EXPECT_THAT(message("odometry.feature=3"), HasSubstr("did you mean 'odometry.features'?"));
  RunConfig config;
  SetOptions({"camera.fx=500", "camera.fy=500", "camera.width=640", "camera.height=480", "camera.cx=320",
              "camera.cy=240"},
             config);
  EXPECT_THAT(testing::ErrorOf([&] { SetOptions({"camera.fx=0.1"}, config); }),
              HasSubstr("--set: camera: the focal lengths"));
  EXPECT_THAT(message("rule=orb"), HasSubstr("did you mean 'loops.rule'?"));
  EXPECT_THAT(message("run.threads=0"), HasSubstr("run: threads"));
  EXPECT_THAT(message("graph.solver=quick"), HasSubstr("graph.solver=quick"));
}

TEST(SetLoopOptions, TakesTheKeysOfTheLoopsSection) {
  LoopDetectorOptions options;
  options.seed = 7;
  SetLoopOptions({"stm_size=20", "extraction.features=300", "rule=product", "stm_size=25"}, options);
  EXPECT_EQ(options.stm_size, 25);
  EXPECT_EQ(options.extraction.features, 300);
  EXPECT_EQ(options.rule, CombinationRule::kProduct);
  EXPECT_EQ(options.seed, 7u);
}

TEST(SetLoopOptions, SaysWhatIsWrongAndChangesNothing) {
  const auto message = [](const std::string& assignment) {
    LoopDetectorOptions options;
    std::string error = testing::ErrorOf([&] { SetLoopOptions({"stm_size=20", assignment}, options); });
    EXPECT_EQ(options.stm_size, LoopDetectorOptions().stm_size);
    return error;
  };
  EXPECT_THAT(message("stm_size"), HasSubstr("key=value"));
  EXPECT_THAT(message("extraction.feature=3"), HasSubstr("did you mean 'extraction.features'?"));
  EXPECT_THAT(message("extraction.features=many"), HasSubstr("'many' is not a whole number"));
  EXPECT_THAT(message("extraction.features=0"), HasSubstr("extraction.features must be"));
  EXPECT_THAT(message("stm_size=[1"), HasSubstr("not valid YAML"));
}

// The camera's defaults are zeros, "no camera": as a file that is not a usable camera.
std::string WithoutCamera(const std::string& help) {
  const std::size_t camera = help.find("camera:"), odometry = help.find("odometry:");
  return help.substr(0, camera) + help.substr(odometry);
}

TEST(Config, HelpIsAValidFileWithTheDefaults) {
  const RunConfig defaults;
  const RunConfig config = ParseConfig(WithoutCamera(HelpConfig(true)), "help");
  const auto a = DescribeConfig(config), b = DescribeConfig(defaults);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_EQ(a[i].value, b[i].value) << a[i].section << "." << a[i].name;
}

TEST(Config, HelpWritesNumbersOutUnlessTheyAreTinyOrHuge) {
  EXPECT_THAT(HelpConfig(true), HasSubstr("depth_units_per_m: 0 "));
  EXPECT_THAT(HelpConfig(true), Not(HasSubstr("e+")));
  RunConfig config;
  config.dataset.depth_units_per_m = 80;
  std::string shown;
  for (const ConfigEntry& entry : DescribeConfig(config)) {
    if (entry.name == "depth_units_per_m") shown = entry.value;
  }
  EXPECT_EQ(shown, "80");
}

TEST(Config, HelpShowsWhatUsersSetAndAllWhenAsked) {
  const auto lines = [](const std::string& text) { return std::count(text.begin(), text.end(), '\n'); };
  EXPECT_LT(lines(HelpConfig(false)), 80);
  EXPECT_GT(lines(HelpConfig(true)), 120);
  EXPECT_THAT(HelpConfig(false),
              AllOf(HasSubstr("  fx: "), HasSubstr("  members: "), HasSubstr("--advanced")));
  EXPECT_THAT(HelpConfig(false), Not(HasSubstr("hypothesis_ratio")));
  EXPECT_THAT(HelpConfig(true), HasSubstr("hypothesis_ratio"));
  EXPECT_NO_THROW(ParseConfig(WithoutCamera(HelpConfig(false)), "help"));
}

TEST(Config, EveryConfigurationThatComesWithTheProjectLoads) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(testing::SourceDir() / "data" / "configs")) {
    if (entry.path().extension() != ".yaml") continue;
    EXPECT_NO_THROW(LoadConfig(entry.path())) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 15);
}

}  // namespace
}  // namespace tutti
