// `tutti evaluate` and `tutti convert`, end to end, through the real executable.
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
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;
using testing::WriteAll;

class EvaluateCommand : public ::testing::Test {
 protected:
  // A curve of 200 poses at 10 Hz, and the same with the scale, the turn and the wave given.
  static Trajectory Curve(double scale = 1, double turn = 0, double wave = 0) {
    Trajectory out;
    for (int k = 0; k < 200; ++k) {
      const double a = 0.03 * k;
      const Eigen::Vector3d p(20 * std::cos(a), 20 * std::sin(a), std::sin(3 * a) + wave * std::cos(9 * a));
      const Eigen::Quaterniond R = ExpSO3({0, 0, turn});
      out.push_back({1000 + 0.1 * k, Pose(R * ExpSO3({0, 0, a}), scale * (R * p))});
    }
    return out;
  }
  std::string Save(const std::string& name, const Trajectory& trajectory,
                   PoseFileFormat format = PoseFileFormat::kTum) const {
    WritePoseFile(folder_ / name, trajectory, format);
    return (folder_ / name).string();
  }
  nlohmann::json Evaluate(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "evaluate");
    arguments.insert(arguments.end(), {"--json", folder_ / "e.json"});
    Done(RunTutti(arguments));
    return testing::ReadJson(folder_ / "e.json");
  }
  static void ExpectRefused(const testing::ProcessResult& run, const std::vector<std::string>& texts) {
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_THAT(run.output, StartsWith("tutti: "));
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
    for (const std::string& text : texts) EXPECT_THAT(run.output, HasSubstr(text));
  }

  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(EvaluateCommand, MixesFormatsOnBothSides) {
  const std::string tum = Save("a.tum", Curve()), kitti = Save("a.kitti", Curve(), PoseFileFormat::kKitti);
  const std::string euroc = Save("a.csv", Curve(), PoseFileFormat::kEuroc);
  const std::string g2o = Save("a.g2o", Curve(), PoseFileFormat::kG2o);
  WriteTimes(folder_ / "times.txt", Curve());
  const std::string times = (folder_ / "times.txt").string();
  for (const std::string& reference : {tum, kitti, euroc, g2o}) {
    const auto json =
        Evaluate({"--reference", reference, "--times", times, "--estimate", tum, kitti, euroc, g2o});
    ASSERT_EQ(json["estimates"].size(), 4u);
    for (const auto& estimate : json["estimates"]) {
      EXPECT_EQ(estimate["pairs"], 200) << reference << estimate["name"];
      EXPECT_LT(estimate["ate"]["max"].get<double>(), 1e-6);
      EXPECT_LT(estimate["rpe"]["rotation_deg"]["max"].get<double>(), 1e-5);
    }
  }
}

TEST_F(EvaluateCommand, WithoutTimesAMixtureIsRefusedWithTheOptionThatHelps) {
  const std::string tum = Save("a.tum", Curve()), kitti = Save("a.kitti", Curve(), PoseFileFormat::kKitti);
  ExpectRefused(RunTutti({"evaluate", "--reference", kitti, "--estimate", tum}), {"a.kitti", "--times"});
  ExpectRefused(RunTutti({"evaluate", "--reference", tum, "--estimate", kitti}), {"a.kitti", "--times"});
}

TEST_F(EvaluateCommand, EveryAlignmentDoesWhatItSays) {
  const std::string reference = Save("r.txt", Curve());
  const std::string turned = Save("t.txt", Curve(1, 1.0)), scaled = Save("s.txt", Curve(0.5));
  const std::string both = Save("b.txt", Curve(0.5, 1.0));
  const auto max = [&](const std::string& estimate, const std::string& align) {
    return Evaluate({"--reference", reference, "--estimate", estimate, "--align", align})["ate"]["max"]
        .get<double>();
  };
  EXPECT_GT(max(turned, "none"), 1);
  EXPECT_LT(max(turned, "origin"), 1e-6);
  EXPECT_LT(max(turned, "se3"), 1e-6);
  EXPECT_LT(max(turned, "yaw"), 1e-6);
  EXPECT_GT(max(scaled, "se3"), 1);
  EXPECT_LT(max(scaled, "scale"), 1e-6);
  EXPECT_GT(max(both, "scale"), 1);
  EXPECT_LT(max(both, "sim3"), 1e-6);
}

TEST_F(EvaluateCommand, SeveralEstimatesInOneTableOfEveryFormat) {
  const std::string reference = Save("r.txt", Curve());
  const std::string a = Save("a_1.txt", Curve(1, 0, 0.1)), b = Save("b.txt", Curve(1, 0, 0.2));
  const auto table = [&](const std::string& format) {
    return RunTutti({"evaluate", "--reference", reference, "--estimate", a, b, "--table-format", format})
        .output;
  };
  EXPECT_THAT(table("text"), AllOf(HasSubstr("a_1.txt"), HasSubstr("b.txt"), HasSubstr("ATE rmse [m]")));
  EXPECT_THAT(table("markdown"), AllOf(HasSubstr("| a_1.txt "), HasSubstr("|--")));
  EXPECT_THAT(table("latex"), AllOf(HasSubstr("a\\_1.txt"), HasSubstr("\\begin{tabular}{lrrr"),
                                    HasSubstr("t\\_rel [\\%]"), HasSubstr("\\bottomrule")));
  const auto named =
      RunTutti({"evaluate", "--reference", reference, "--estimate", a, b, "--name", "ours", "theirs"});
  EXPECT_THAT(named.output, AllOf(HasSubstr("theirs"), Not(HasSubstr("a_1.txt"))));
  ExpectRefused(RunTutti({"evaluate", "--reference", reference, "--estimate", a, b, "--name", "ours"}),
                {"1 names for 2 estimates"});
}

TEST_F(EvaluateCommand, ErrorsPoseByPoseHaveTheStatisticsOfTheTable) {
  const std::string reference = Save("r.txt", Curve()), estimate = Save("e.txt", Curve(1, 0, 0.3));
  const fs::path csv = folder_ / "errors.csv";
  const auto json = Evaluate({"--reference", reference, "--estimate", estimate, "--errors", csv});
  const std::string text = ReadAll(csv);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 201);
  EXPECT_THAT(text, HasSubstr("\"e.txt\",1000.1"));
  EXPECT_GT(json["ate"]["max"].get<double>(), 0.1);
}

TEST_F(EvaluateCommand, OffsetUnitsAndInterpolationReachTheEvaluation) {
  const std::string reference = Save("r.txt", Curve());
  Trajectory late = Curve(1, 0, 0.1);
  for (StampedPose& pose : late) pose.stamp_s += 7.05;
  const std::string estimate = Save("e.txt", late);
  const auto json =
      Evaluate({"--reference", reference, "--estimate", estimate, "--time-offset", "-7.0", "--interpolate",
                "--rpe-delta", "2", "--rpe-unit", "seconds", "--rpe-all-pairs"});
  EXPECT_EQ(json["pairs"], 199);
  EXPECT_EQ(json["rpe"]["unit"], "seconds");
  EXPECT_EQ(json["rpe"]["translation"]["count"], 181);  // the last start with an end in 2 s +- 10 %
  EXPECT_LT(json["ate"]["rmse"].get<double>(), 0.5);
}

TEST_F(EvaluateCommand, DegenerateInputNamesFileAndLine) {
  const std::string reference = Save("r.txt", Curve());
  const auto evaluate = [&](const std::string& text) {
    WriteAll(folder_ / "bad.txt", text);
    return RunTutti({"evaluate", "--reference", reference, "--estimate", folder_ / "bad.txt"});
  };
  ExpectRefused(evaluate("1000 0 0 0 0 0 0 1\n"), {"bad.txt", "1 pair of poses is too few"});
  ExpectRefused(evaluate("5 0 0 0 0 0 0 1\n6 0 0 0 0 0 0 1\n"),
                {"bad.txt", "1000.000 .. 1019.900 s", "5.000 .. 6.000 s"});
  ExpectRefused(evaluate("1000 0 0 0 0 0 0 1\n1000.1 nan 0 0 0 0 0 1\n"), {"bad.txt:2:", "not finite"});
  ExpectRefused(evaluate("1000 0 0 0 0 0 0 0\n"), {"bad.txt:1:", "quaternion is zero"});
  ExpectRefused(evaluate("1000 0 0 0 0 0 0 1\n999 0 0 0 0 0 0 1\n"), {"bad.txt:2:", "back in time"});
  ExpectRefused(evaluate(""), {"bad.txt", "no pose"});
  ExpectRefused(evaluate("1000 0 0 0 0 0 0 1\n1000.1 1 0 0 0 0 0 1\n1000.2 2 0 0 0 0 0 1\n"),
                {"bad.txt", "on a line"});
  ExpectRefused(evaluate("1000 0 0 0 0 0 0 1\n1000.1 1e308 0 0 0 0 0 1\n"), {"bad.txt:2:", "too large"});
  EXPECT_THAT(
      Done(evaluate(
          "1000 20 0 0 0 0 0 1\n1000 20 0 0 0 0 0 1\n1000.1 20 1 0 0 0 0 2\n1000.2 19 2 1 0 0 0 1\n")),
      AllOf(HasSubstr("bad.txt:2: repeats the time stamp"),
            HasSubstr("bad.txt:3: the quaternion is not of length 1")));
}

TEST_F(EvaluateCommand, StampsOfAnyUnitAreSaidOnceAndConvertedWithoutLoss) {
  std::string nanoseconds;
  for (const StampedPose& p : Curve(1, 0, 0.1)) {
    const auto& t = p.pose.translation;
    nanoseconds += std::to_string(1403636579763555584 + std::llround(1e9 * (p.stamp_s - 1000))) + ".000000";
    for (const double v : {t.x(), t.y(), t.z(), 0.0, 0.0, 0.0, 1.0}) nanoseconds += " " + std::to_string(v);
    nanoseconds += "\n";
  }
  WriteAll(folder_ / "ns.txt", nanoseconds);
  Trajectory truth = Curve();
  for (StampedPose& pose : truth) pose.stamp_s += 1403636579.763555584 - 1000;
  const std::string reference = Save("r.txt", truth), ns = (folder_ / "ns.txt").string();
  const std::string run = Done(RunTutti({"evaluate", reference, ns}));
  const std::string said = "its time stamps are in nanoseconds";
  EXPECT_THAT(run, AllOf(HasSubstr("200 pairs"), HasSubstr(said)));
  EXPECT_EQ(run.find(said), run.rfind(said));
  const std::string euroc = (folder_ / "e.csv").string(), back = (folder_ / "back.txt").string();
  EXPECT_EQ(RunTutti({"convert", ns, euroc, "--to", "euroc"}).status, 0);
  EXPECT_THAT(ReadAll(euroc),
              AllOf(HasSubstr("\n1403636579763555584,"), HasSubstr("\n1403636599663555584,")));
  EXPECT_EQ(RunTutti({"convert", euroc, back, "--to", "tum"}).status, 0);
  EXPECT_THAT(ReadAll(back), HasSubstr("\n1403636579.763555584 "));
  WriteAll(folder_ / "late.txt", "99999999999 0 0 0 0 0 0 1\n");
  ExpectRefused(RunTutti({"convert", folder_ / "late.txt", euroc, "--to", "euroc"}),
                {"e.csv", "does not fit into EuRoC's nanoseconds"});
}

TEST_F(EvaluateCommand, OfPositionsAloneLeavesOutRotationsAndSaysSo) {
  const std::string full = Save("r.txt", Curve()), estimate = Save("e.txt", Curve(1, 0, 0.3));
  Trajectory alone = Curve();
  for (StampedPose& pose : alone) pose.pose.rotation = Eigen::Quaterniond(0, 0, 0, 0);
  const std::string zero = Save("zero.txt", alone), leica = (folder_ / "leica.csv").string();
  std::string rows = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m]\n";
  for (const StampedPose& p : alone) {
    rows += std::to_string(std::llround(1e9 * p.stamp_s));
    for (const double v : {p.pose.translation.x(), p.pose.translation.y(), p.pose.translation.z()})
      rows += "," + std::to_string(v);
    rows += "\n";
  }
  WriteAll(leica, rows);
  const double ate = Evaluate({"--reference", full, "--estimate", estimate})["ate"]["rmse"];
  for (const std::string& reference : {zero, leica}) {
    const auto json = Evaluate({"--reference", reference, "--estimate", estimate});
    EXPECT_NEAR(json["ate"]["rmse"].get<double>(), ate, 1e-6);
    EXPECT_TRUE(json["ate_rotation_deg"].is_null());
    EXPECT_EQ(json["rotations"], false);
    const auto one = RunTutti({"evaluate", reference, estimate});
    EXPECT_THAT(one.output, AllOf(HasSubstr("positions alone"), Not(HasSubstr("ATE rotation"))));
    EXPECT_THAT(RunTutti({"evaluate", reference, estimate, zero}).output, HasSubstr("positions alone"));
    const std::string errors = (folder_ / "errors.csv").string();
    EXPECT_EQ(RunTutti({"evaluate", reference, estimate, "--errors", errors}).status, 0);
    EXPECT_THAT(ReadAll(errors), HasSubstr(",,\n"));
  }
  ExpectRefused(RunTutti({"convert", leica, folder_ / "k.txt", "--to", "kitti"}),
                {"k.txt", "positions alone"});
  const std::string svg = (folder_ / "p.svg").string();
  ExpectRefused(RunTutti({"plot", estimate, "--reference", leica, "--what", "rpe", "--out", svg}),
                {"positions alone"});
  ExpectRefused(RunTutti({"plot", leica, "--what", "rpy", "--out", svg}), {"leica.csv", "positions alone"});
  EXPECT_EQ(RunTutti({"plot", estimate, "--reference", leica, "--what", "error", "--out", svg}).status, 0);
}

TEST_F(EvaluateCommand, OfFramesWithNumbersPairsByTheNumber) {
  const auto save = [&](const std::string& name, int step, const std::string& last) {
    std::string text;
    const Trajectory curve = Curve();
    for (std::size_t k = 0; k < curve.size(); k += static_cast<std::size_t>(step)) {
      text += std::to_string(k);
      const Eigen::Matrix4d m = curve[k].pose.Matrix();
      for (int i = 0; i < 12; ++i) text += " " + std::to_string(m(i / 4, i % 4));
      text += last + "\n";
    }
    WriteAll(folder_ / name, text);
    return (folder_ / name).string();
  };
  const std::string sparse = save("poses.txt", 4, ""), all = save("cam0_to_world.txt", 1, " 0 0 0 1");
  const std::string kitti = Save("kitti.txt", Curve(), PoseFileFormat::kKitti);
  for (const std::string& reference : {all, kitti}) {
    const auto json = Evaluate({"--reference", reference, "--estimate", sparse});
    EXPECT_EQ(json["pairs"], 50);
    EXPECT_LT(json["ate"]["max"].get<double>(), 1e-5);
  }
}

TEST_F(EvaluateCommand, RotationDriftHasOneUnit) {
  const std::string reference = Save("r.txt", Curve()), estimate = Save("e.txt", Curve(1, 0, 0.3));
  EXPECT_THAT(RunTutti({"evaluate", reference, estimate}).output, HasSubstr("deg/100 m"));
  EXPECT_THAT(RunTutti({"evaluate", reference, estimate, reference}).output, HasSubstr("deg/100 m"));
}

TEST_F(EvaluateCommand, OnePairSaysNothingWhereItIsLaidOnItself) {
  const std::string reference = Save("r.txt", Curve());
  WriteAll(folder_ / "one.txt", "1000 0 0 0 0 0 0 1\n");
  const std::string one = (folder_ / "one.txt").string();
  for (const char* align : {"origin", "se3", "sim3", "scale", "yaw"})
    ExpectRefused(RunTutti({"evaluate", "--reference", reference, "--estimate", one, "--align", align}),
                  {"one.txt", "1 pair of poses is too few"});
  EXPECT_EQ(Evaluate({"--reference", reference, "--estimate", one, "--align", "none"})["pairs"], 1);
}

TEST_F(EvaluateCommand, OptionsOutOfRangeAreRefusedInOneShortLine) {
  const std::string file = Save("r.txt", Curve());
  const std::vector<std::pair<std::string, std::string>> bad = {
      {"--align-first", "-3"}, {"--rpe-delta", "0"},      {"--rpe-delta", "nan"},
      {"--max-diff", "-1"},    {"--rpe-tolerance", "-1"}, {"--max-gap", "x"}};
  for (const auto& [option, value] : bad) {
    const auto run = RunTutti({"evaluate", "--reference", file, "--estimate", file, option, value});
    EXPECT_EQ(run.status, 1) << option;
    EXPECT_THAT(run.output, HasSubstr(option)) << value;
    EXPECT_LT(run.output.size(), 120u) << run.output;
  }
}

TEST_F(EvaluateCommand, ConvertsThereAndBack) {
  const std::string tum = Save("a.tum", Curve());
  const std::string times = (folder_ / "times.txt").string();
  for (const std::string format : {"kitti", "euroc", "g2o"}) {
    const std::string there = (folder_ / ("there." + format)).string();
    const std::string back = (folder_ / ("back." + format)).string();
    auto run = RunTutti({"convert", tum, there, "--to", format, "--times-out", times});
    EXPECT_EQ(run.status, 0) << run.output;
    run = RunTutti({"convert", there, back, "--to", "tum", "--times", times});
    EXPECT_EQ(run.status, 0) << run.output;
    const auto json = Evaluate({"--reference", tum, "--estimate", back, "--align", "none"});
    EXPECT_EQ(json["pairs"], 200);
    EXPECT_LT(json["ate_full"]["max"].get<double>(), 1e-7) << format;
  }
  ExpectRefused(RunTutti({"convert", folder_ / "there.kitti", "/dev/null", "--to", "tum"}),
                {"there.kitti", "--times"});
  ExpectRefused(RunTutti({"convert", tum, "/proc/no/x", "--to", "tum"}), {"/proc/no/x"});
}

}  // namespace
}  // namespace tutti
