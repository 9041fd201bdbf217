// `tutti evaluate`: files by place, evo's names, limits, runs, published figures; through the real
// executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/backend/trajectory_file.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::RunTutti;
using testing::WriteAll;

class EvaluateLimits : public ::testing::Test {
 protected:
  // 200 poses at 10 Hz on a curve; `error` is the amplitude of a wave across it.
  static Trajectory Curve(double error = 0, double scale = 1, int poses = 200) {
    Trajectory out;
    for (int k = 0; k < poses; ++k) {
      const double a = 0.03 * k;
      const Eigen::Vector3d p(20 * std::cos(a), 20 * std::sin(a), std::sin(3 * a) + error * std::cos(9 * a));
      out.push_back({1000 + 0.1 * k, Pose(ExpSO3({0, 0, a}), scale * p)});
    }
    return out;
  }
  std::string Save(const std::string& name, const Trajectory& trajectory,
                   PoseFileFormat format = PoseFileFormat::kTum) const {
    fs::create_directories((folder_ / name).parent_path());
    WritePoseFile(folder_ / name, trajectory, format);
    return (folder_ / name).string();
  }
  testing::ProcessResult Evaluate(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "evaluate");
    return RunTutti(arguments);
  }
  nlohmann::json Json(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--json", folder_ / "e.json"});
    Done(Evaluate(arguments));
    return testing::ReadJson(folder_ / "e.json");
  }
  void ExpectRefused(const std::vector<std::string>& arguments, const std::vector<std::string>& texts) const {
    const testing::ProcessResult run = Evaluate(arguments);
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_LE(std::count(run.output.begin(), run.output.end(), '\n'), 2) << run.output;  // CLI11 adds one
    for (const std::string& text : texts) EXPECT_THAT(run.output, HasSubstr(text));
  }

  const fs::path folder_ = testing::FreshFolder();
  const std::string reference_ = Save("r.txt", Curve()), estimate_ = Save("e.txt", Curve(0.1));
};

TEST_F(EvaluateLimits, FilesNeedNoOptionBeforeThem) {
  const std::string by_option = Evaluate({"--reference", reference_, "--estimate", estimate_}).output;
  EXPECT_THAT(by_option, HasSubstr("200 pairs"));
  EXPECT_EQ(Evaluate({reference_, estimate_}).output, by_option);
  EXPECT_EQ(Evaluate({reference_, "--estimate", estimate_}).output, by_option);
  EXPECT_EQ(Evaluate({"--ref", reference_, estimate_}).output, by_option);
  EXPECT_EQ(Json({reference_, estimate_, reference_})["estimates"].size(), 2u);
  ExpectRefused({reference_}, {"no estimate", "GT EST..."});
  ExpectRefused({}, {"no reference", "GT EST..."});
}

TEST_F(EvaluateLimits, NamesThatUsersOfEvoKnowMeanTheSame) {
  const std::string scaled = Save("s.txt", Curve(0.1, 0.5));
  const auto mode = [&](const std::vector<std::string>& words) {
    std::vector<std::string> arguments = {"tum", reference_, scaled};
    arguments.insert(arguments.end(), words.begin(), words.end());
    return Json(arguments)["alignment"]["mode"].get<std::string>();
  };
  EXPECT_EQ(mode({"-a"}), "se3");
  EXPECT_EQ(mode({"-as"}), "sim3");
  EXPECT_EQ(mode({"-a", "--correct_scale"}), "sim3");
  EXPECT_EQ(mode({"-s"}), "scale");
  EXPECT_EQ(mode({"--align_origin"}), "origin");
  EXPECT_EQ(Evaluate({reference_, scaled, "-s", "--align", "sim3"}).status, 1);
  struct Unit {
    std::string letter, name, delta;  // a pose goes on by 0.6 m and turns by 1.72 deg
  };
  for (const auto& [letter, unit, delta] : {Unit{"f", "frames", "1"},
                                            {"m", "metres", "1.2"},
                                            {"d", "degrees", "1.7"},
                                            {"r", "radians", "1"},
                                            {"s", "seconds", "1"}}) {
    const auto json = Json({reference_, estimate_, "--delta", delta, "--delta_unit", letter, "--all_pairs",
                            "--t_max_diff", "0.02", "--t_offset", "0", "--n_to_align", "100"});
    EXPECT_EQ(json["rpe"]["unit"], unit);
    EXPECT_EQ(json["rpe"]["all_pairs"], true);
    EXPECT_EQ(json["alignment"]["first_poses"], 100);
    EXPECT_GT(json["rpe"]["translation"]["count"], 50);
  }
  ExpectRefused({reference_, estimate_, "-u", "feet"}, {"'feet'", "frames"});
  // evo's `euroc` is a csv against a TUM file.
  const std::string csv = Save("r.csv", Curve(), PoseFileFormat::kEuroc);
  EXPECT_EQ(Json({"euroc", csv, estimate_, "-a"})["pairs"], 200);
}

TEST_F(EvaluateLimits, PlanesFiltersAndPointDistancesReachTheEvaluation) {
  const auto plane = Json({reference_, estimate_, "--align", "none", "--project-to-plane", "xy"});
  EXPECT_LT(plane["ate"]["max"].get<double>(), 1e-9);  // the wave is along z
  EXPECT_EQ(plane["plane"], "xy");
  EXPECT_EQ(Json({reference_, estimate_, "--downsample", "20"})["pairs"], 20);
  const auto moved =
      Json({reference_, reference_, "--motion_filter", "1.9", "360"});  // 0.6 m a pose: every fourth of 200
  EXPECT_NEAR(moved["pairs"].get<double>(), 50, 1);
  EXPECT_EQ(moved["coverage"]["share"], 1.0);
  const auto far = Json({reference_, Save("s.txt", Curve(0, 1.1)), "--align", "none"});
  EXPECT_NEAR(far["rpe"]["point_distance_percent"]["mean"].get<double>(), 10, 1e-6);
  ExpectRefused({reference_, estimate_, "--motion-filter", "-1", "5"}, {"--motion-filter"});
}

TEST_F(EvaluateLimits, CoverageAndPairsStandBesideTheAteWhichIsFlagged) {
  Trajectory half = Curve(0.1, 1, 100);
  for (StampedPose& pose : half) pose.stamp_s += 0.004;
  const std::string part = Save("half.txt", half);
  const std::string text = Evaluate({reference_, part}).output;
  EXPECT_THAT(text, AllOf(HasSubstr("coverage: 50.00 % (100 of 200"), HasSubstr("ATE [m] !"),
                          HasSubstr("unmatched: reference 100, estimate 0"), HasSubstr("median 4.000 ms")));
  EXPECT_THAT(Evaluate({reference_, estimate_}).output, Not(HasSubstr("!")));
  EXPECT_THAT(Evaluate({reference_, estimate_, part}).output,
              AllOf(HasSubstr("coverage [%]"), HasSubstr("100.00 "), HasSubstr("50.00 !")));
  // The list of images knows better: there were none after the 100th.
  std::string frames = "# stamp file\n";
  for (int k = 0; k < 100; ++k)
    frames += std::to_string(1000 + 0.1 * k) + " rgb/" + std::to_string(k) + ".png\n";
  WriteAll(folder_ / "rgb.txt", frames);
  const auto json = Json({reference_, part, "--frames", folder_ / "rgb.txt"});
  EXPECT_EQ(json["coverage"]["all"], 100);
  EXPECT_EQ(json["coverage"]["full"], true);
  EXPECT_EQ(json["association"]["reference_unmatched"], 100);
  WriteAll(folder_ / "rgb.txt", "1 a\n0.5 b\n");
  ExpectRefused({reference_, part, "--frames", folder_ / "rgb.txt"}, {"rgb.txt:2:", "back in time"});
  WriteAll(folder_ / "rgb.txt", "1 a\nx b\n");
  ExpectRefused({reference_, part, "--frames", folder_ / "rgb.txt"}, {"rgb.txt:2:", "'x' is not a number"});
}

TEST_F(EvaluateLimits, AnEstimateBeyondALimitHasAnExitStatusOfItsOwn) {
  const double ate = Json({reference_, estimate_})["ate"]["rmse"];
  ASSERT_GT(ate, 0.01);
  const std::string above = std::to_string(1.01 * ate), below = std::to_string(0.99 * ate);
  EXPECT_EQ(Evaluate({reference_, estimate_, "--max-ate", above, "--min-coverage", "1"}).status, 0);
  const auto bad = Evaluate({reference_, estimate_, reference_, "--max-ate", below});
  EXPECT_EQ(bad.status, 3);
  EXPECT_THAT(bad.output, AllOf(HasSubstr("e.txt: the ATE of"), HasSubstr("--max-ate"),
                                Not(HasSubstr("r.txt: the ATE"))));
  const std::string part = Save("part.txt", Curve(0, 1, 180));
  EXPECT_EQ(Evaluate({reference_, part, "--min-coverage", "0.9"}).status, 0);
  const auto less = Evaluate({reference_, part, "--min-coverage", "0.91"});
  EXPECT_EQ(less.status, 3);
  EXPECT_THAT(less.output, HasSubstr("the coverage of 0.9 is below --min-coverage 0.91"));
  EXPECT_EQ(Evaluate({reference_, part, "--min-coverage", "95"}).status, 1);
}

TEST_F(EvaluateLimits, ARunIsEvaluatedAsItWasGivenOutToo) {
  Save("run/trajectory.txt", Curve(0.01));
  Save("run/trajectory_online.txt", Curve(0.2, 1, 190));
  Save("run/trajectory_odometry.txt", Curve(0.4));
  const fs::path summary = folder_ / "run" / "summary.json";
  const auto write = [&](const std::string& truth) {
    WriteAll(summary, R"({"sensor": "mono", "frames": {"total": 200}, "evaluation": {"alignment": "sim3",)"
                      R"( "ground_truth": ")" +
                          truth + "\"}}");
  };
  write(reference_);
  const std::string run = (folder_ / "run").string();
  const auto json = Json({"--run", run});
  ASSERT_EQ(json["estimates"].size(), 3u);
  EXPECT_EQ(json["estimates"][0]["name"], "run, final");
  EXPECT_EQ(json["estimates"][1]["name"], "run, as first given out");
  EXPECT_EQ(json["estimates"][1]["coverage"]["share"], 0.95);
  EXPECT_EQ(json["estimates"][2]["alignment"]["mode"], "sim3");
  EXPECT_LT(json["estimates"][0]["ate"]["rmse"], json["estimates"][1]["ate"]["rmse"]);
  EXPECT_EQ(Json({"--run", run, "--align", "se3"})["estimates"][0]["alignment"]["mode"], "se3");
  write("");
  ExpectRefused({"--run", run}, {"--reference"});
  EXPECT_EQ(Evaluate({"--run", run, "--reference", reference_}).status, 0);
  fs::remove(summary);
  ExpectRefused({"--run", run}, {"summary.json", "--run"});
}

TEST_F(EvaluateLimits, PublishedFiguresStandBesideOnesOwn) {
  const auto rows = Evaluate({"--against", "euroc"});
  EXPECT_EQ(rows.status, 0);
  EXPECT_THAT(rows.output, AllOf(HasSubstr("ORB-SLAM3"), HasSubstr("0.521"), HasSubstr("stereo-inertial"),
                                 HasSubstr("V203"), HasSubstr("T-RO 2021")));
  EXPECT_THAT(Evaluate({"--against", "tum"}).output, HasSubstr("fr1_desk2"));
  EXPECT_THAT(Evaluate({"--against", "kitti", "--table-format", "markdown"}).output, HasSubstr("| GigaSLAM"));
  const std::string truth = Save("MH_01_easy/gt.txt", Curve());
  EXPECT_THAT(Done(Evaluate({truth, estimate_, "--against", "euroc", "--sensor", "stereo"})),
              AllOf(HasSubstr("euroc MH01"), HasSubstr("ORB-SLAM3"), HasSubstr("0.029"),
                    HasSubstr("this evaluation"), Not(HasSubstr("0.036"))));
  const auto json = Json({truth, estimate_, "--against", "euroc", "--sensor", "stereo"});
  EXPECT_EQ(json["published"]["sequence"], "MH01");
  EXPECT_EQ(json["published"]["rows"][0]["ate_rmse_m"], 0.029);
}

TEST_F(EvaluateLimits, AnotherProtocolIsRefusedWithWhatToPass) {
  const std::string truth = Save("MH_01_easy/gt.txt", Curve());
  ExpectRefused({truth, estimate_, "--against", "euroc"}, {"--sensor", "stereo-inertial"});
  ExpectRefused({truth, estimate_, "--against", "euroc", "--sensor", "mono"}, {"no figures", "mono"});
  ExpectRefused({truth, estimate_, "--against", "euroc", "--sensor", "stereo", "--align", "sim3"},
                {"--align se3"});
  ExpectRefused({truth, estimate_, "--against", "euroc", "--sensor", "stereo", "--interpolate"},
                {"--interpolate"});
  ExpectRefused({reference_, estimate_, "--against", "euroc", "--sensor", "stereo"}, {"--sequence", "MH01"});
  ExpectRefused({reference_, estimate_, "--against", "tum", "--sensor", "mono", "--sequence", "fr1_desk"},
                {"--align sim3"});
  ExpectRefused({truth, estimate_, "--against", "eurok"}, {"euroc"});
}

}  // namespace
}  // namespace tutti
