// What strangers' files and odd command lines do to the commands: one clear line or a result, never a crash,
// a hang or "internal error".
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::ReadAll;
using testing::RunTutti;
using testing::WriteAll;

constexpr const char* kMark = "\xEF\xBB\xBF";
constexpr const char* kNoUtf8 = "n\xFF";

std::string Replaced(std::string text, char what, const std::string& with) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += with.size())
    text.replace(at, 1, with);
  return text;
}

class HardInput : public ::testing::Test {
 protected:
  static std::string Tum() {
    std::string text;
    for (int i = 0; i < 9; ++i) {
      text += std::to_string(10 + i) + ".5 " + std::to_string(i) + ".5 ";
      text += std::to_string(i * i) + ".25 0 0 0 0.6 0.8\n";
    }
    return text;
  }
  static std::string Graph(const std::string& more = "") {
    return "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1.5 0.25 0 1 0 0 1 0 1\n" + more;
  }
  fs::path File(const std::string& name, const std::string& text) const {
    WriteAll(folder_ / name, text);
    return folder_ / name;
  }
  // Refused in one short sentence.
  static void ExpectRefused(const testing::ProcessResult& run, const std::string& what) {
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_THAT(run.output, AllOf(HasSubstr(what), Not(HasSubstr("internal error"))));
    EXPECT_LT(run.output.size(), 700U);
  }

  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(HardInput, ATrajectoryIsTheSameWithMarkCarriageReturnsAndCommas) {
  const fs::path plain = File("plain.txt", Tum());
  for (const std::string& text : {kMark + Tum(), Replaced(Tum(), '\n', "\r\n"), Replaced(Tum(), ' ', ","),
                                  Replaced(Tum(), ' ', ", ")}) {
    const fs::path other = File("other.txt", text), out = folder_ / "out.txt";
    EXPECT_THAT(Done(RunTutti({"convert", other, out, "--to", "tum"})), HasSubstr("(tum)"));
    ASSERT_EQ(RunTutti({"convert", plain, folder_ / "as_is.txt", "--to", "tum"}).status, 0);
    EXPECT_EQ(ReadAll(out), ReadAll(folder_ / "as_is.txt"));
  }
}

TEST_F(HardInput, SecondsAreNoNanoseconds) {
  const fs::path file = File("tum.csv", Replaced(Tum(), ' ', ","));
  ExpectRefused(RunTutti({"convert", file, folder_ / "o", "--to", "tum", "--from", "euroc"}), "nanoseconds");
  const fs::path whole = File("whole.csv", "0,1,0,0,0,0,0,1\n1,2,0,0,0,0,0,1\n2,3,1,0,0,0,0,1\n");
  ExpectRefused(RunTutti({"convert", whole, folder_ / "o", "--to", "tum"}), "nanoseconds");
}

TEST_F(HardInput, DecimalCommasAreNamed) {
  const fs::path tum = File("tum.txt", Replaced(Tum(), '.', ","));
  ExpectRefused(RunTutti({"evaluate", "--reference", tum, "--estimate", tum}),
                "tum.txt:1: '10,5' has a decimal comma");
  const fs::path graph = File("graph.g2o", Replaced(Graph(), '.', ","));
  ExpectRefused(RunTutti({"optimize", graph, "--out", folder_ / "o.g2o"}), "graph.g2o:3: '1,5' has a comma");
}

TEST_F(HardInput, AGraphIsTheSameWithMarkAndCarriageReturns) {
  const fs::path out = folder_ / "out.g2o";
  ASSERT_EQ(RunTutti({"optimize", File("a.g2o", Graph()), "--out", out}).status, 0);
  const std::string plain = ReadAll(out);
  for (const std::string& text : {kMark + Graph(), Replaced(Graph(), '\n', "\r\n")}) {
    const auto run = RunTutti({"optimize", File("b.g2o", text), "--out", out});
    EXPECT_THAT(run.output, Not(HasSubstr("warning")));
    EXPECT_EQ(ReadAll(out), plain);
  }
}

TEST_F(HardInput, LongWordsAreCutOff) {
  const std::string word(1000000, 'X');
  ExpectRefused(RunTutti({"optimize", File("tag.g2o", word + " 1 2\n"), "--out", folder_ / "o"}), "XXX...");
  const fs::path more = File("more.g2o", Graph(word + " 1\n"));
  ExpectRefused(RunTutti({"optimize", more, "--out", folder_ / "o"}), "XXX... (1 line)");
  const std::string warned = Done(RunTutti({"optimize", more, "--out", folder_ / "o", "--ignore-unknown"}));
  EXPECT_LT(warned.size(), 1500U);
  ExpectRefused(RunTutti({"convert", File("t.txt", word + " 0 0 0 0 0 0 1\n"), folder_ / "o", "--to", "tum"}),
                "XXX...' is not a number");
}

TEST_F(HardInput, WhereNothingCanMoveThereAreNoIterations) {
  const fs::path graph = File("fixed.g2o", Graph("FIX 0\nFIX 1\n"));
  for (const char* solver : {"ceres", "block"}) {
    EXPECT_THAT(Done(RunTutti({"optimize", graph, "--out", folder_ / "o.g2o", "--solver", solver})),
                HasSubstr("after 0 iterations"));
  }
}

TEST_F(HardInput, NamesThatAreNotUtf8KeepTheResults) {
  const fs::path tum = File(std::string(kNoUtf8) + ".txt", Tum()), json = folder_ / "out.json";
  EXPECT_EQ(RunTutti({"evaluate", "--reference", tum, "--estimate", tum, "--json", json}).status, 0);
  EXPECT_NO_THROW(testing::ReadJson(json));
  const fs::path graph = File(std::string(kNoUtf8) + ".g2o", Graph());
  EXPECT_EQ(RunTutti({"optimize", graph, "--out", folder_ / "o.g2o", "--json", json}).status, 0);
  EXPECT_NO_THROW(testing::ReadJson(json));
}

TEST_F(HardInput, NumbersHaveABound) {
  const std::vector<std::string> base = {"generate", "--sensor", "mono",    "--out", folder_ / "world",
                                         "--frames", "1",        "--width", "64",    "--height",
                                         "48"};
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"--focal", "inf"},   {"--focal", "nan"},       {"--focal", "1e-300"},
      {"--focal", "0.001"}, {"--rate", "1e308"},      {"--rate", "1e-20"},
      {"--rate", "1e12"},   {"--speed", "inf"},       {"--baseline", "inf"},
      {"--laps", "inf"},    {"--threads", "1000000"}, {"--seed", "99999999999999999999999"}};
  for (const auto& [option, value] : wrong) {
    std::vector<std::string> arguments = base;
    arguments.insert(arguments.end(), {option, value});
    const auto run = RunTutti(arguments);
    EXPECT_EQ(run.status, 1) << option << " " << value << ": " << run.output;
    EXPECT_FALSE(fs::exists(folder_ / "world")) << option << " " << value;
  }
  ExpectRefused(
      RunTutti({"generate", "--sensor", "mono", "--out", folder_ / "world", "--frames", "3000000000"}),
      "--frames: '3000000000' does not fit; give a whole number from -2147483648 to 2147483647");
  std::vector<std::string> greatest = base;
  greatest.insert(greatest.end(), {"--seed", "18446744073709551615"});
  EXPECT_EQ(RunTutti(greatest).status, 0);
  ExpectRefused(
      RunTutti({"loops", "--images", "x", "--ground-truth", "y", "--out", "z", "--threads", "100000"}),
      "--threads");
}

TEST_F(HardInput, ConfigurationsThatCanNotBeComputedWithAreRefused) {
  const fs::path config = testing::TinyConfig(folder_);
  const auto with = [&](const std::string& name, const std::string& text) {
    return RunTutti(testing::RunArguments(File(name, text), testing::TinyTown(), folder_ / "out"));
  };
  for (const char* focal : {"1e-300", "1e300", "0.1"}) {
    const auto run =
        with("fx.yaml", ReadAll(config) + "camera:\n  width: 320\n  height: 160\n  fx: " + focal +
                            "\n  fy: 100\n  cx: 160\n  cy: 80\n");
    ExpectRefused(run, "camera");
  }
  ExpectRefused(with("two.yaml", ReadAll(config) + "---\nrun:\n  threads: 1\n"),
                "more than one YAML document");
  EXPECT_FALSE(fs::exists(folder_ / "out" / "summary.json"));
}

TEST_F(HardInput, AGroundTruthThatIsNoFileIsNamed) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  fs::remove(data / "poses.txt");
  fs::create_directories(data / "poses.txt");
  ExpectRefused(RunTutti(testing::RunArguments(testing::TinyConfig(folder_), data, folder_ / "out")),
                "poses.txt: should be the ground truth");
}

// A file may claim any size, and /dev/zero never ends: neither time nor memory is spent on them. A pipe in a
// folder may have nobody who writes.
TEST_F(HardInput, TextsWithoutEndAreRefusedAtOnce) {
  const fs::path tum = File("tum.txt", Tum()), graph = File("g.g2o", Graph()), out = folder_ / "out";
  const fs::path sparse = File("sparse", "# text\n"), pipe = folder_ / "pipe";
  const fs::path& data = testing::TinyTown();
  fs::resize_file(sparse, 300'000'000'000ULL);
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  using Commands = std::vector<std::vector<std::string>>;
  const auto texts = [&](const fs::path& file) {
    return Commands{{"run", data, "--out", out, "--config", file},
                    {"run", data, "--out", out, "--calibration", file},
                    {"close", "--trajectory", file, "--images", data, "--out", out},
                    {"loops", data, "--out", out, "--ground-truth", file},
                    {"optimize", file, "--out", folder_ / "o.g2o"},
                    {"evaluate", tum, file, "--format", "tum"},
                    {"collect", file}};
  };
  const auto everything = [&](const fs::path& file) {
    Commands commands = texts(file);
    for (const std::vector<std::string>& more :
         Commands{{"run", data, "--out", out, "--ground-truth", file},
                  {"close", "--trajectory", tum, "--images", data, "--out", out, "--times", file},
                  {"loops", data, "--out", out, "--mask", file},
                  {"loops", data, "--out", out, "--places", file},
                  {"evaluate", tum, file},
                  {"evaluate", tum, tum, "--frames", file},
                  {"convert", graph, folder_ / "o", "--to", "tum", "--times", file},
                  {"plot", tum, file, "--out", folder_ / "o.svg"},
                  {"compare-loops", file},
                  {"map", "info", file},
                  {"localize", "--map", file, data, "--out", out},
                  {"merge", file, file, "--out", folder_ / "o.tutti"},
                  {"export", file, "--tum", folder_ / "o"}})
      commands.push_back(more);
    return commands;
  };
  for (const Commands& commands : {texts(sparse), texts("/dev/zero"), everything(pipe)}) {
    for (const std::vector<std::string>& command : commands) {
      const auto run = RunTutti(command);
      EXPECT_EQ(run.status, 1) << command[0] << ": " << run.output;
      EXPECT_THAT(run.output, AllOf(Not(HasSubstr("internal error")), Not(HasSubstr("memory; give"))))
          << command[0];
    }
  }
}

TEST_F(HardInput, NoResultTakesThePlaceOfWhatItIsMadeOf) {
  const fs::path tum = File("tum.txt", Tum()), graph = File("g.g2o", Graph()),
                 map = File("map.tutti", "a map");
  const fs::path table = File("table.json", "{}"), times = File("times.txt", "1\n2\n");
  const fs::path linked = folder_ / "linked.txt",
                 summary = File("summary.json", "{\"frames\": 1, \"loops\": 1}");
  fs::create_symlink("tum.txt", linked);
  File("trajectory.txt", Tum());  // with the summary: as a run's folder
  for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{
           {"convert", tum, tum, "--to", "kitti"},
           {"convert", tum, linked, "--to", "kitti"},
           {"convert", graph, folder_ / "o", "--to", "tum", "--times", times, "--times-out", times},
           {"evaluate", tum, tum, "--json", linked},
           {"evaluate", tum, tum, "--errors", tum},
           {"evaluate", "--run", folder_, "--reference", tum, "--json", summary},
           {"optimize", graph, "--out", graph},
           {"optimize", graph, "--out", folder_ / "o.g2o", "--json", graph},
           {"collect", summary, "--json", summary},
           {"compare-loops", table, "--out", table},
           {"export", map, "--tum", map},
           {"export", map, "--landmarks", folder_ / "o.ply", "--g2o", folder_ / "." / "map.tutti"}}) {
    ExpectRefused(RunTutti(command), "is read, and would be overwritten");
  }
  EXPECT_EQ(ReadAll(tum) + ReadAll(graph) + ReadAll(map), Tum() + Graph() + "a map");
  EXPECT_FALSE(fs::exists(folder_ / "o"));
}

TEST_F(HardInput, LoopsSkipsAndCountsWhatIsNoImage) {
  const fs::path images = folder_ / "images", out = folder_ / "out";
  fs::create_directories(images);
  constexpr int kGood = 4, kBad = 4;
  for (int i = 0; i < kGood; ++i)
    cv::imwrite((images / (std::string(kNoUtf8) + std::to_string(i) + ".png")).string(),
                testing::TexturedImage(static_cast<std::uint32_t>(i)));
  const std::string claims("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\xEA\x60\0\0\xEA\x60\x08\0\0\0\0\0\0\0\0", 33);
  WriteAll(images / "a.png", claims + std::string("\0\0\0\0IEND\xAE\x42\x60\x82", 12));
  ASSERT_EQ(mkfifo((images / "b.png").c_str(), 0600), 0);
  fs::create_symlink("c.png", images / "c.png");
  WriteAll(images / "d.png", "");
  fs::resize_file(images / "d.png", 300000000000ULL);
  fs::create_directories(images / "e.png");
  WriteAll(folder_ / "truth.txt", Replaced(std::string(kGood + kBad, 'x'), 'x', "0 0 0 0 0 0 0 0\n"));
  Done(RunTutti({"loops", "--images", images, "--ground-truth", folder_ / "truth.txt", "--out", out}));
  const auto json = testing::ReadJson(out / "results.json");
  EXPECT_EQ(json["images"], kGood + kBad);
  EXPECT_EQ(json["images_damaged"], kBad);
}

TEST_F(HardInput, ForceRemovesNoneButItsOwnFiles) {
  const fs::path world = folder_ / "world";
  const std::vector<std::string> arguments = {"generate", "--sensor", "mono", "--out",    world, "--frames",
                                              "1",        "--width",  "64",   "--height", "48",  "--force"};
  ASSERT_EQ(RunTutti(arguments).status, 0);
  EXPECT_EQ(RunTutti(arguments).status, 0);
  WriteAll(world / "image_0" / "mine.png", "mine");
  ExpectRefused(RunTutti(arguments), "mine.png: is none of tutti generate's files");
  EXPECT_EQ(ReadAll(world / "image_0" / "mine.png"), "mine");
  EXPECT_TRUE(fs::exists(world / "image_0" / "000000.png"));
  fs::remove(world / "image_0" / "mine.png");
  WriteAll(world / "config.yaml", "mine");
  ExpectRefused(RunTutti(arguments), "did not write");
  EXPECT_TRUE(fs::exists(world / "image_0" / "000000.png"));
}

TEST_F(HardInput, WhatRanOutIsSaid) {
#ifdef TUTTI_SANITIZED
  GTEST_SKIP() << "sanitizers need more addresses than the limit leaves";
#endif
  std::string long_graph;
  for (int i = 0; i < 300000; ++i)
    long_graph += "EDGE_SE2 " + std::to_string(i) + " " + std::to_string(i + 1) + " 1 0 0 1 0 0 1 0 1\n";
  const fs::path graph = File("long.g2o", long_graph);
  ExpectRefused(
      testing::RunInShell("ulimit -v 150000; exec \"$@\"", {"optimize", graph, "--out", folder_ / "o"}),
      "not enough memory");
}

}  // namespace
}  // namespace tutti
