// `tutti plot`, end to end, through the real executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;

// #0072b2 and #d55e00, as Cairo writes them.
constexpr const char* kBlue = "rgb(0%,44.705882%,69.803922%)";
constexpr const char* kVermilion = "rgb(83.529412%,36.862745%,0%)";

class PlotCommand : public ::testing::Test {
 protected:
  PlotCommand() {
    Save("reference.txt", 0);
    Save("good.txt", 0.1);
    Save("bad.txt", 0.5);
  }
  void Save(const std::string& name, double wave) const {
    Trajectory out;
    for (int k = 0; k < 200; ++k) {
      const double a = 0.03 * k;
      out.push_back(
          {0.1 * k, Pose(ExpSO3({0, 0, a}), {20 * std::cos(a), 20 * std::sin(a), wave * std::cos(9 * a)})});
    }
    WriteTrajectory(folder_ / name, out, TrajectoryFormat::kTum);
  }
  testing::ProcessResult Plot(const std::string& what, const std::vector<std::string>& files,
                              const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"plot", "--reference", folder_ / "reference.txt"};
    arguments.insert(arguments.end(), {"--estimate", folder_ / "good.txt", folder_ / "bad.txt"});
    arguments.insert(arguments.end(), {"--what", what, "--out"});
    for (const std::string& file : files) arguments.push_back((folder_ / file).string());
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunTutti(arguments);
  }
  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(PlotCommand, EveryKindIsDrawnAsSvgAndPng) {
  for (const std::string what : {"trajectory", "error", "rpe"}) {
    Done(Plot(what, {what + ".svg", what + ".png"}));
    const std::string svg = ReadAll(folder_ / (what + ".svg"));
    EXPECT_THAT(svg, AllOf(HasSubstr("good.txt"), HasSubstr("bad.txt"), HasSubstr("[m]"), HasSubstr("</svg>"),
                           HasSubstr(kBlue), HasSubstr(kVermilion), Not(HasSubstr("nan"))));
    EXPECT_FALSE(cv::imread((folder_ / (what + ".png")).string()).empty());
  }
  EXPECT_THAT(ReadAll(folder_ / "trajectory.svg"), HasSubstr("\nreference\n"));
  EXPECT_THAT(ReadAll(folder_ / "error.svg"), HasSubstr("distance along the reference [m]"));
}

TEST_F(PlotCommand, WithoutAReferenceTheFilesAreDrawnAsTheyAre) {
  const std::string good = (folder_ / "good.txt").string(), bad = (folder_ / "bad.txt").string();
  for (const std::string what : {"trajectory", "xyz", "rpy", "speed"}) {
    const std::string svg = (folder_ / (what + ".svg")).string();
    Done(RunTutti({"plot", good, bad, "--what", what, "--out", svg}));
    EXPECT_THAT(ReadAll(svg), AllOf(HasSubstr("\ngood.txt\n"), HasSubstr("\nbad.txt\n"), HasSubstr("</svg>"),
                                    Not(HasSubstr("\nreference\n")), Not(HasSubstr("nan"))));
  }
  EXPECT_THAT(ReadAll(folder_ / "xyz.svg"),
              AllOf(HasSubstr("x [m]"), HasSubstr("z [m]"), HasSubstr("time [s]")));
  EXPECT_THAT(ReadAll(folder_ / "rpy.svg"), AllOf(HasSubstr("roll [deg]"), HasSubstr("yaw [deg]")));
  EXPECT_THAT(ReadAll(folder_ / "speed.svg"), HasSubstr("speed [m/s]"));
}

TEST_F(PlotCommand, OverTimeTheReferenceIsDrawnToo) {
  for (const std::string what : {"xyz", "rpy", "speed"}) {
    ASSERT_EQ(Plot(what, {what + ".svg"}).status, 0);
    EXPECT_THAT(ReadAll(folder_ / (what + ".svg")), HasSubstr("\nreference\n"));
  }
}

TEST_F(PlotCommand, ErrorsAreDrawnOnTheMapAndAsDistributions) {
  for (const std::string what : {"error-map", "box", "violin"}) {
    Done(Plot(what, {what + ".svg", what + ".png"}));
    EXPECT_THAT(ReadAll(folder_ / (what + ".svg")), AllOf(HasSubstr("[m]"), Not(HasSubstr("nan"))));
    EXPECT_FALSE(cv::imread((folder_ / (what + ".png")).string()).empty());
  }
  // Many colours, and the bar that explains them.
  const std::string map = ReadAll(folder_ / "error-map.svg");
  EXPECT_THAT(map, AllOf(HasSubstr("absolute translation error [m]"), HasSubstr("\nreference\n")));
  std::set<std::string> colours;
  for (std::size_t at = map.find("stroke:rgb("); at != std::string::npos;
       at = map.find("stroke:rgb(", at + 1))
    colours.insert(map.substr(at, map.find(')', at) - at));
  EXPECT_GT(colours.size(), 5u);
  EXPECT_THAT(ReadAll(folder_ / "box.svg"), AllOf(HasSubstr("\ngood.txt\n"), HasSubstr("\nbad.txt\n")));
}

TEST_F(PlotCommand, WhatNeedsAReferenceOrStampsSaysSo) {
  const std::string good = (folder_ / "good.txt").string(), svg = (folder_ / "a.svg").string();
  for (const std::string what : {"error", "rpe", "error-map", "box", "violin"}) {
    const auto run = RunTutti({"plot", good, "--what", what, "--out", svg});
    EXPECT_EQ(run.status, 1);
    EXPECT_THAT(run.output, HasSubstr("--reference")) << what;
  }
  EXPECT_EQ(RunTutti({"plot", "--out", svg}).status, 1);
  const std::string kitti = (folder_ / "a.kitti").string();
  ASSERT_EQ(RunTutti({"convert", good, kitti, "--to", "kitti"}).status, 0);
  EXPECT_THAT(RunTutti({"plot", kitti, "--what", "speed", "--out", svg}).output, HasSubstr("--times"));
  ASSERT_EQ(RunTutti({"plot", kitti, "--what", "xyz", "--out", svg}).status, 0);
  EXPECT_THAT(ReadAll(svg), HasSubstr("\nframe\n"));
}

TEST_F(PlotCommand, EveryFormatHasTheSameBytesAgain) {
  for (const std::string ending : {".pdf", ".svg", ".png"}) {
    ASSERT_EQ(Plot("error", {"a" + ending, "b" + ending}).status, 0);
    EXPECT_EQ(ReadAll(folder_ / ("a" + ending)), ReadAll(folder_ / ("b" + ending))) << ending;
  }
  EXPECT_THAT(ReadAll(folder_ / "a.pdf"), StartsWith("%PDF"));
}

TEST_F(PlotCommand, FontsForPapers) {
  ASSERT_EQ(Plot("error", {"a.svg"}).status, 0);
  ASSERT_EQ(Plot("error", {"b.svg"}, {"--font", "monospace"}).status, 0);
  ASSERT_EQ(Plot("error", {"c.svg"}, {"--font-scale", "1.5"}).status, 0);
  EXPECT_NE(ReadAll(folder_ / "a.svg"), ReadAll(folder_ / "c.svg"));
  EXPECT_THAT(ReadAll(folder_ / "b.svg"), HasSubstr("</svg>"));
  EXPECT_NE(Plot("error", {"d.svg"}, {"--font-scale", "0"}).status, 0);
}

TEST_F(PlotCommand, WhatCanNotBeDrawnIsRefusedInOneLine) {
  const auto refused = [](const testing::ProcessResult& run, const std::string& text) {
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_THAT(run.output, AllOf(StartsWith("tutti: "), HasSubstr(text)));
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
  };
  refused(Plot("error", {"a.gif"}), "ends in .svg, .png or .pdf");
  refused(Plot("error", {"no/a.svg"}), "a.svg");
  refused(Plot("rpe", {"a.svg"}, {"--rpe-delta", "1000", "--rpe-unit", "metres"}), "--rpe-delta");
}

TEST_F(PlotCommand, TitleOfOnesOwn) {
  ASSERT_EQ(Plot("trajectory", {"a.svg"}, {"--title", "Town & country"}).status, 0);
  EXPECT_THAT(ReadAll(folder_ / "a.svg"), HasSubstr("Town &amp; country"));
}

}  // namespace
}  // namespace tutti
